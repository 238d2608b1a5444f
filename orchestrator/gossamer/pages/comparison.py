"""A sensor beside what it must beat, in words and as a picture: pages of identifications and assessments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from gossamer_files.charts import Chart, bars, with_interval
from gossamer_models.automatic.compare import LESS, Interval, clearly_less
from gossamer_orchestrator.pages.page import Kind

OWN = "this sensor"
LARGER = "with more error, though the intervals overlap, than"


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Errors of a sensor and of its rivals in one quantity of one record.

    Attributes
    ----------
    record, quantity : str
        Where, and what: "resistance", "strain".
    does : str
        What is done with the quantity, for instance "is predicted".
    own : tuple of float
        NRMSE of the sensor [% of range].
    rivals : mapping of str to tuple of float
        Those of the rivals.
    """

    record: str
    quantity: str
    does: str
    own: Interval
    rivals: Mapping[str, Interval]

    @property
    def beaten(self) -> bool:
        """Whether the error of a rival is clearly smaller."""
        return any(clearly_less(rival, self.own) for rival in self.rivals.values())

    @property
    def ahead(self) -> bool:
        """Whether the error is clearly smaller than that of every rival."""
        return all(clearly_less(self.own, rival) for rival in self.rivals.values())

    @property
    def sentence(self) -> str:
        """Say the error and how it stands beside those of the rivals; overlapping intervals leave that open."""
        value, low, high = self.own
        order = ("better than", "not clearly better than", "no better than", LARGER, "worse than")
        words: dict[str, list[str]] = {word: [] for word in order}
        for name, rival in self.rivals.items():
            if clearly_less(rival, self.own):
                word = "worse than"
            elif rival[0] < value:
                word = LARGER if rival[0] < LESS * value else "no better than"
            else:
                word = "better than" if clearly_less(self.own, rival) else "not clearly better than"
            words[word].append(f"a {name} ({rival[0]:.2f} %)")
        compared = "; ".join(f"{word} {' and '.join(names)}" for word, names in words.items() if names)
        error = f"{value:.2f} % (90 % interval {low:.2f} to {high:.2f} %)"
        return f"{self.quantity.capitalize()} {self.does} with an error of {error}{': ' * bool(compared)}{compared}."


def verdict(comparisons: Sequence[Comparison], stretch: str) -> tuple[Kind, str, list[str]]:
    """Return what a page says first, and a sentence for each record and quantity where there are several records.

    Parameters
    ----------
    comparisons : sequence of Comparison
        At least one.
    stretch : str
        Part of each record that the errors are of.
    """
    kind: Kind = "healthy" if all(each.ahead for each in comparisons) else "none"
    kind = "invalid" if any(each.beaten for each in comparisons) else kind
    records = list(dict.fromkeys(each.record for each in comparisons))
    unit = "Errors are root mean squares in % of the range of the record (NRMSE)."
    if len(records) == 1:
        sentences = [each.sentence for each in comparisons]
        return kind, f"On the {stretch} of {records[0]}: {' '.join(sentences)}", [unit]
    parts = []
    for quantity, does in dict.fromkeys((each.quantity, each.does) for each in comparisons):
        errors = [each.own[0] for each in comparisons if each.quantity == quantity]
        parts.append(f"{quantity} {does} with errors of {min(errors):.2f} to {max(errors):.2f} %")
    beaten = sum(each.beaten for each in comparisons)
    rest = f"in {beaten} of {len(comparisons)} comparisons" if beaten else "nowhere"
    names = " or a ".join(dict.fromkeys(name for each in comparisons for name in each.rivals))
    sentence = f"On the {stretch}es of {len(records)} records {' and '.join(parts)}; a {names} is clearly better {rest}."
    return kind, sentence, [unit, *(f"{each.record}: {each.sentence}" for each in comparisons)]


def comparison_chart(comparisons: Sequence[Comparison], section: str) -> Chart:
    """Return a picture of the errors of one record."""
    quantities = [each.quantity for each in comparisons]
    traces = []
    for name, color in zip([OWN, *comparisons[0].rivals], ("@0", "@grey", "@3"), strict=False):
        errors = np.array([each.own if name == OWN else each.rivals[name] for each in comparisons])
        value, low, high = errors.T
        ends = np.minimum(low, value), np.maximum(high, value)
        traces.append(with_interval(bars(name, quantities, value, color), *ends, color="@ink"))
    title, y = "Error beside that of simple models", "NRMSE [% of range]"
    note, text = (
        "Lines: 90 % confidence from blocks of the samples. Lower is better.",
        " ".join(each.sentence for each in comparisons),
    )
    layout = {"barmode": "group", "yaxis": {"rangemode": "tozero"}}
    return Chart(title, "", y, traces, note=note, text=text, layout=layout, section=section)

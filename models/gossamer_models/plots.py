"""Charts of one record and of what a sensor makes of it: resistance, residual, loop, strain and its error.

A chart that is added to ``record_charts`` is drawn for every record by ``gossamer identify`` and ``gossamer assess``, on
their pages and, under its name in ``FILES``, as a file.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from gossamer_files.charts import Chart, Trace, area, band, curve, rule, section

from .arrays import Rows, Vector
from .fitting.records import Record, judged_rows
from .replay import Recovered

BAND = 2.0  # standard deviations to each side
FILES = {
    "Loop": "loop",
    "Resistance over time": "history",
    "Residual": "residual",
    "Strain over time": "strain",
    "Error of the recovered strain": "strain_residual",
}


@dataclass(frozen=True, kw_only=True)
class ModelledRecord:
    """A record and what a sensor makes of it.

    Attributes
    ----------
    record : Record
        The record, in the units of its file.
    predicted : ndarray, shape (m,)
        Resistance [ohm] for its strain.
    recovered : mapping of str to Recovered
        Strain from its resistance, by compensator.
    first : ndarray of bool, shape (m,)
        Stretch that is marked.
    stretch : str
        What it is, for instance "training stretch".
    fitted : str
        What a model is on the marked stretch, for instance "fitted"; empty if it is a prediction there too.
    """

    record: Record
    predicted: Vector
    recovered: Mapping[str, Recovered]
    first: Rows
    stretch: str = "training stretch"
    fitted: str = "fitted"

    def curves(self, x: Vector, y: Vector) -> list[Trace]:
        """Return a curve of what is fitted and one of what is predicted, where there is any."""
        if not self.fitted:
            return [curve("predicted", x, y, "@1")]
        parts = ((self.fitted, self.first, "@0"), ("predicted", ~self.first, "@1"))
        return [curve(name, x, np.where(rows, y, np.nan), color) for name, rows, color in parts if rows.any()]

    def over_time(self, title: str, y: str, traces: Sequence[Trace], **more: Any) -> Chart:  # noqa: ANN401
        """Return a chart over time with the first stretch marked; all of a record are zoomed together."""
        marked, linked = self.record.time[self.first], f"time of {self.record.name}"
        marks = [area(float(marked[0]), float(marked[-1]))] if marked.size else []
        return Chart(title, "time [s]", y, traces, marks=[*marks, *more.pop("marks", ())], linked=linked, **more)


def record_charts(seen: ModelledRecord) -> list[Chart]:
    """Return the charts of one record."""
    return section(seen.record.name, [*_of_resistance(seen), *(_of_strain(seen) if seen.recovered else [])])


def record_files(seen: ModelledRecord) -> dict[str, Chart]:
    """Return the charts of one record by the names of their files."""
    stem, charts = Path(seen.record.name).stem, {chart.title: chart for chart in record_charts(seen)}
    titled = {
        title: replace(chart, title=f"{seen.record.name}: {title[0].lower()}{title[1:]}") for title, chart in charts.items()
    }
    return {f"{stem}_{name}": titled[title] for title, name in FILES.items() if title in titled}


def quantity(record: Record) -> str:
    """Name what a record measured beside strain, with the unit that its file states: a signal if it is a ratio."""
    return {"ohm": "resistance [ohm]", "1": "signal [1]"}.get(record.unit or "", "resistance [unit not stated]")


def _of_resistance(seen: ModelledRecord) -> list[Chart]:
    record, unit = seen.record, quantity(seen.record)
    t, R, strain, size = record.time, record.resistance, 100.0 * record.strain, float(np.ptp(record.resistance))
    residual = 100.0 * (seen.predicted - R) / size
    worst = int(np.abs(residual).argmax())
    measured = [curve("measured", x, R, "@grey", width=3) for x in (t, strain)]
    reach = f"from {R.min():.6g} to {R.max():.6g} over {t[-1]:.6g} s"
    said = f"Measured resistance of {record.name} {reach}, and that of the model."
    far = f"The residual is largest at {t[worst]:.6g} s, {residual[worst]:.2f} % of the range."
    loop = f"Resistance over strain from {strain.min():.4g} to {strain.max():.4g} %, measured and modelled."
    history, note = [measured[0], *seen.curves(t, seen.predicted)], f"Grey area: {seen.stretch}."
    y, left = "model - measured [% of range]", f"Of the record's range of {size:.4g}."
    return [
        seen.over_time("Resistance over time", unit, history, note=note, text=said, broad=True),
        seen.over_time("Residual", y, seen.curves(t, residual), note=left, text=far, marks=[rule(y=0.0)]),
        Chart("Loop", "strain [%]", unit, [measured[1], *seen.curves(strain, seen.predicted)], text=loop),
    ]


def _of_strain(seen: ModelledRecord) -> list[Chart]:
    t, strain = seen.record.time, 100.0 * seen.record.strain
    size, rest = float(np.ptp(strain)), judged_rows(seen.first)
    histories, errors, stated, said = [], [], [], []
    for k, (name, found) in enumerate(seen.recovered.items()):
        recovered, color = 100.0 * found.strain, f"@{k % 4}"
        error = 100.0 * (recovered - strain) / size
        known = np.isfinite(error)
        rms = float(np.sqrt(np.mean(error[known] ** 2))) if known.any() else np.nan
        said.append(f"{name}: root mean square error {rms:.3g} % of the range over the whole record.")
        if found.deviation is not None:
            reach = BAND * 100.0 * found.deviation
            label = f"± {BAND:g} stated deviations" + (f", {name}" if len(seen.recovered) > 1 else "")
            histories += band(label, t, recovered - reach, recovered + reach, color)
            errors += band(label, t, -100.0 * reach / size, 100.0 * reach / size, color)
            where = f"Outside the {seen.stretch}" if rest is not seen.first else "Here"
            if (known & rest).any():
                beyond = 100.0 * float(np.mean((np.abs(recovered - strain) > reach)[known & rest]))
                stated.append(f"{where} {beyond:.1f} % of the errors of {name} leave the band; 5 % would be right.")
        histories.append(curve(name, t, recovered, color))
        errors.append(curve(name, t, error, color))
    silent = [name for name, found in seen.recovered.items() if found.deviation is None]
    stated += [f"No deviation is stated by {' and '.join(silent)}."] if silent else []
    delays = [f"{found.delay:.4g} s by {name}" for name, found in seen.recovered.items() if found.delay > 0.0]
    late = f" Delays are taken back: {', '.join(delays)}." if delays else ""
    note, applied = f"Recovered from the measured resistance.{late}", curve("applied", t, strain, "@grey", width=3)
    text = f"Applied strain from {strain.min():.4g} to {strain.max():.4g} % and strain recovered from the resistance."
    left, y = " ".join([f"Of the record's range of {size:.4g} % strain.", *stated]), "recovered - applied [% of range]"
    return [
        seen.over_time("Strain over time", "strain [%]", [applied, *histories], note=note, text=text, broad=True),
        seen.over_time("Error of the recovered strain", y, errors, note=left, text=" ".join(said), marks=[rule(y=0.0)]),
    ]

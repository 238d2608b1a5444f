"""A sensor of two records of silver thread, judged on two others with scales of their own, as ``gossamer assess`` does.

Which records are fitted and which judged was given before. The model was chosen among six with a look at the judged
records, so it is not blind.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from gossamer_models.identify import identify_files, settings_for
from gossamer_models.review import Judged, judge_files

from .measured import NYLON_COLUMNS, Comparison
from .metrics import Metric

FITTED, JUDGED = ("strain_sin_30", "strain_mixed_15_25"), ("strain_triangular", "strain_sin_20")
TARGETS = (3.0, 4.0)  # NRMSE [% of range] of the output and of the recovered strain


def run_reviewed(data: Path) -> list[Comparison]:
    """Fit two whole records; judge the second half of two others, with scales fitted to their first half."""
    fitted, others = ([data / "nylon_silver" / f"{name}.csv" for name in names] for names in (FITTED, JUDGED))
    settings = settings_for("preisach-hats", earlier=True)
    with TemporaryDirectory() as folder:
        sensor = Path(folder) / "sensor.json"
        identify_files(fitted, columns=NYLON_COLUMNS, train="100%", settings=settings).fit.artifact.write(sensor)
        judged = judge_files(sensor, others, columns=NYLON_COLUMNS, own_scales=True)
    return [comparison for each in judged for comparison in comparisons(each)]


def comparisons(judged: Judged) -> list[Comparison]:
    """Return the errors of the sensor on the judged stretch beside its targets, and those of a static cubic."""
    rows = judged.stretches()["judged"]
    name = judged.record.name.removesuffix(".csv")
    quantities = {
        "forward": (judged.forward(rows), judged.forward(rows, judged.cubic), TARGETS[0]),
        "recovered strain": (
            judged.strain(rows, judged.recovered["inverse"].strain),
            judged.strain(rows, judged.cubic_strain),
            TARGETS[1],
        ),
    }
    found = []
    for quantity, (own, cubic, target) in quantities.items():
        for what, value, wanted in (("own scales", own, target), ("cubic of its first half", cubic, None)):
            metric = Metric(what=f"two records -> {name}, {quantity}, {what}", unit="% of range", value=value, target=wanted)
            found.append(Comparison(what=metric.what, train=None, test=metric))
    return found

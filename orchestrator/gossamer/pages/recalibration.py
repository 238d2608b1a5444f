"""The page of sensors that were identified again in flight: how far each was off, and what was not identified."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from gossamer_files.charts import Chart, curve, section
from gossamer_files.tables import TableText
from gossamer_models.twin.recalibration import Recalibrated
from gossamer_orchestrator.pages import Page


def recalibration_page(
    name: str,
    step: float,
    sensors: Mapping[int, Recalibrated],
    sentence: str,
    doubts: Sequence[str],
    tables: Sequence[TableText],
) -> Page:
    """Describe sensors that were identified again.

    Parameters
    ----------
    name, step : str, float
        Of the record, and its step [s].
    sensors : mapping of int to Recalibrated
        By number, from 1.
    sentence, doubts, tables
        What was found, what was not, and the figures.
    """
    return Page(
        title=f"Sensors identified again from {name}",
        sentence=sentence,
        more=doubts,
        charts=[chart for k, each in sensors.items() for chart in section(f"Sensor {k}", _charts(each, step))],
        facts=tables,
        how="The strain is that of the twin that explains the record. The old sensor is as it was taken to be; what it "
        "misses beside an offset is how far it was off. Gain and offset are over what it would read, with deviations from "
        "stretches of the record that are left out.",
    )


def _charts(each: Recalibrated, step: float) -> list[Chart]:
    """Draw the loop of a sensor, and what both models miss of its record."""
    time, strain = step * np.arange(1, each.measured.size + 1), 100.0 * each.felt
    models = (("old sensor", each.by_old, "@1"), ("identified again", each.by_new, "@0"))
    loop = [curve("record", strain, each.measured, "@grey"), *(curve(name, strain, R, color) for name, R, color in models)]
    missed = [curve(name, time, each.measured - R, color) for name, R, color in models]
    return [
        Chart("Resistance over strain", "strain [%]", "resistance [ohm]", loop),
        Chart("What the models miss", "time [s]", "record less model [ohm]", missed, linked="time"),
    ]

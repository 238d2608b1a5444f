"""Whether a record lies where a sensor was identified: ranges of strain and resistance, side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Rows
from ..fitting.records import Record
from ..sensor import SensorArtifact

LEAST_OVERLAP = 0.25  # of the larger of two ranges

Range = tuple[float, float]


def fitted_ranges(records: Sequence[Record], train: Sequence[Rows]) -> dict[str, str]:
    """Return what the provenance of an artifact states of the samples that were fitted: strain [1] and resistance [ohm]."""
    found = {}
    for quantity in ("strain", "resistance"):
        values = np.concatenate([getattr(r, quantity)[rows] for r, rows in zip(records, train, strict=True)])
        found[f"fitted {quantity}"] = f"{float(values.min())!r} to {float(values.max())!r}"
    return found


def hardly_overlapping(
    record: Record, artifact: SensorArtifact, full_scale: float, *, own_scales: bool
) -> tuple[str, ...]:
    """Say where the range of a record hardly overlaps with that which a sensor was identified on.

    Parameters
    ----------
    record : Record
        What the sensor is judged on.
    artifact : SensorArtifact
        The sensor. If its provenance lacks ``fitted_ranges``, strain counts from 0 to full scale, and resistance does not.
    full_scale : float
        Strain [1] at the end of its range.
    own_scales : bool
        Whether scales of the record are fitted, so that its resistance may lie anywhere.
    """
    sentences = []
    strain = _stated(artifact, "strain") or (0.0, full_scale)
    here = float(record.strain.min()), float(record.strain.max())
    if _overlap(here, strain) < LEAST_OVERLAP:
        sentences.append(
            f"strain is {_text(here, 100.0, ' %')}, but the sensor was identified on {_text(strain, 100.0, ' %')}: the "
            "ranges hardly overlap. Check the unit (--strain-unit), or name a record of like strain"
        )
    resistance = None if own_scales else _stated(artifact, "resistance")
    here = float(record.resistance.min()), float(record.resistance.max())
    if resistance is not None and _overlap(here, resistance) < LEAST_OVERLAP:
        unit = " ohm" * (record.unit == "ohm")
        sentences.append(
            f"resistance is {_text(here, 1.0, unit)}, but the sensor was identified on {_text(resistance, 1.0, unit)}: the "
            "ranges hardly overlap. Check column and unit (--resistance, --resistance-unit), or give --fit-scales"
        )
    return tuple(f"{record.name}: {sentence}." for sentence in sentences)


def _stated(artifact: SensorArtifact, quantity: str) -> Range | None:
    try:
        low, high = map(float, artifact.provenance[f"fitted {quantity}"].split(" to "))
    except (KeyError, ValueError):
        return None
    return low, high


def _overlap(one: Range, other: Range) -> float:
    """Return what two ranges share, over the larger of them [1]."""
    shared = min(one[1], other[1]) - max(one[0], other[0])
    return max(shared, 0.0) / max(one[1] - one[0], other[1] - other[0])


def _text(ends: Range, factor: float, unit: str) -> str:
    return f"{factor * ends[0]:.5g} to {factor * ends[1]:.5g}{unit}"

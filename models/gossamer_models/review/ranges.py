"""Whether a record lies where a sensor was identified: ranges of strain and resistance."""

from __future__ import annotations

from gossamer_files.options import option

from ..fitting.records import Record

LEAST_OVERLAP = 0.25  # of one of two ranges

Range = tuple[float, float]


def hardly_overlapping(
    record: Record, offset: float, gain: float, full_scale: float, *, own_scales: bool
) -> tuple[str, ...]:
    """Say where a record fills little of the range of strain, or of resistance, that a sensor was identified on.

    Parameters
    ----------
    record : Record
        What the sensor is judged on.
    offset, gain : float
        Resistance of the sensor at rest, and its static rise to full scale [ohm].
    full_scale : float
        Strain [1] at the end of its range.
    own_scales : bool
        Whether scales of the record are fitted, so that its resistance may lie anywhere.

    Notes
    -----
    Strain lies in the range of the sensor: a record ends where it exceeds it. Resistance may exceed its range, since the
    sensor relaxes beyond its static rise; only where the two hardly overlap is it named.
    """
    sentences = []
    here = float(record.strain.min()), float(record.strain.max())
    if _size(here) < LEAST_OVERLAP * full_scale:
        sentences.append(
            f"strain is {100 * here[0]:.4g} to {100 * here[1]:.4g} %, a small part of the 0 to {100 * full_scale:.4g} % "
            f"that the sensor was identified on. Check the unit ({option('strain_unit')}), or name a record of like strain"
        )
    here = float(record.resistance.min()), float(record.resistance.max())
    known = min(offset, offset + gain), max(offset, offset + gain)
    if not own_scales and _shared(here, known) < LEAST_OVERLAP * min(_size(here), _size(known)):
        unit = " ohm" * (record.unit == "ohm")
        sentences.append(
            f"resistance is {here[0]:.5g} to {here[1]:.5g}{unit}, but the sensor was identified on {known[0]:.5g} to "
            f"{known[1]:.5g}{unit} between rest and full scale: the ranges hardly overlap. Check column and unit "
            f"({option('resistance')}, {option('resistance_unit')}), or give {option('fit_scales', True)}"
        )
    return tuple(f"{record.name}: {sentence}." for sentence in sentences)


def _size(ends: Range) -> float:
    return ends[1] - ends[0]


def _shared(one: Range, other: Range) -> float:
    return max(min(one[1], other[1]) - max(one[0], other[0]), 0.0)

r"""Bring records of one sensor to one scale: each has an offset and a gain of its own.

Symbols: ``R`` resistance of a record, ``y`` of the sensor in the units of the first record [ohm], ``o`` offset [ohm], ``g``
gain [1]: :math:`R = o + g\,y`; ``w`` weight of a record [1].

Re-mounting, temperature and drift change offset and gain of a sensor from record to record. A fit that shares them spends
its densities on the difference. Here the two are found in turns with the sensor: fit it to all records at their present
scales, then each record's scale to the sensor. A record's weight is the inverse of its noise, by the differences of
neighbouring errors: so a noisy one counts less, and one that the model follows badly does not. What was still relaxing
when a record began is its own anyway (``PreisachSettings.earlier``).
"""

from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Rows
from ...errors import DataError
from ...fitting.records import Record
from .preisach import fit_preisach
from .settings import PreisachSettings

MOST_TURNS = 6
SETTLED = 1e-3  # relative change of every gain below which they have settled
LEAST_GAIN, MOST_GAIN = 0.05, 20.0
MOST_WEIGHT = 10.0  # times the least one


@dataclass(frozen=True, slots=True, kw_only=True)
class RelativeScale:
    """Scale of one record relative to the first one.

    Attributes
    ----------
    offset : float
        o [ohm].
    gain : float
        g [1], positive.
    """

    offset: float = 0.0
    gain: float = 1.0

    def apply(self, record: Record) -> Record:
        """Return the record in the units of the first one."""
        return replace(record, resistance=(record.resistance - self.offset) / self.gain)


def align(
    records: tuple[Record, ...], train: tuple[Rows, ...], settings: PreisachSettings | None = None, *, full_scale: float
) -> tuple[tuple[Record, ...], tuple[RelativeScale, ...]]:
    """Return records at the scale of the first one, weighted by their noise, and the scale of each.

    Parameters
    ----------
    records, train : tuple of Record, tuple of ndarray of bool
        Records of one sensor and the samples to fit; a record without any keeps its scale.
    settings : PreisachSettings or None
        The sensor to align them with; None for hat functions with every drive and earlier relaxation.
    full_scale : float
        Strain [1] at the end of the range.

    Raises
    ------
    DataError
        A record does not follow the others: its gain is not positive, or out of all proportion.
    """
    settings = settings or PreisachSettings.of("preisach-hats", extension="reversing", earlier=True, ridge=3e-3, starts=1)
    settings = replace(settings, residual=0)
    own = [k for k, rows in enumerate(train) if rows.any()]
    scales = [
        _first_guess(record, records[own[0]], rows, train[own[0]]) for record, rows in zip(records, train, strict=True)
    ]
    weights = [record.weight for record in records]
    for _ in range(MOST_TURNS if len(own) > 1 else 0):
        present = tuple(replace(s.apply(r), weight=w) for s, r, w in zip(scales, records, weights, strict=True))
        fit = fit_preisach(present, train, settings, full_scale=full_scale, inverse=False)
        before, errors = [s.gain for s in scales], {}
        for k in own[1:]:
            predicted, measured = fit.predicted[k][train[k]], records[k].resistance[train[k]]
            gain = float(np.cov(predicted, measured)[0, 1] / np.var(predicted, ddof=1))
            if not LEAST_GAIN < gain < MOST_GAIN:
                advice = "Leave it out, or fit it alone."
                msg = f"{records[k].name} does not follow {records[own[0]].name}: its gain would be {gain:.3g}. {advice}"
                raise DataError(msg)
            scales[k] = RelativeScale(offset=float(measured.mean() - gain * predicted.mean()), gain=gain)
        for k in own:
            left = (fit.predicted[k] - present[k].resistance)[train[k]]
            errors[k] = 0.5 * float(np.mean(np.diff(left) ** 2))
        least = max(min(errors.values()), 1e-30)
        for k in own:
            weights[k] = records[k].weight * max(least / max(errors[k], 1e-30), 1.0 / MOST_WEIGHT)
        if all(abs(s.gain / g - 1.0) < SETTLED for s, g in zip(scales, before, strict=True)):
            break
    aligned = tuple(replace(s.apply(r), weight=w) for s, r, w in zip(scales, records, weights, strict=True))
    return aligned, tuple(scales)


def _first_guess(record: Record, first: Record, rows: Rows, first_rows: Rows) -> RelativeScale:
    """Return the scale that gives equal slopes over strain and equal levels; none without training samples."""
    if record is first or not rows.any():
        return RelativeScale()
    slopes, levels = [], []
    for r, k in ((record, rows), (first, first_rows)):
        slope, level = np.polyfit(r.strain[k], r.resistance[k], 1)
        slopes.append(float(slope))
        levels.append(float(level))
    if slopes[0] <= 0.0 or slopes[1] <= 0.0:
        return RelativeScale()
    gain = slopes[0] / slopes[1]
    return RelativeScale(offset=levels[0] - gain * levels[1], gain=gain)

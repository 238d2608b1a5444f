r"""Gain, offset and what was still relaxing of one record: what a sensor that was mounted again differs by.

Symbols: ``y`` normalised output of the sensor for the strain of the record [1], ``R`` measured resistance [ohm], ``t`` time
since the first sample [s], :math:`\tau` times of decays [s];

.. math:: R(t) = G(t)\,y(t) + O(t), \quad G = g_0 + \sum_j g_j e^{-t/\tau_j}, \quad O = o_0 + \sum_j o_j e^{-t/\tau_j}.

The sensor itself stays as it is. The strain of a record before its first sample is unknown: it leaves the resistance and
the gauge factor relaxing, hence the decays. All unknowns are linear, and one ridge on the decays is chosen by predicting the
later parts of the stretch from the earlier ones, by ``forward_cuts``.
"""

from dataclasses import dataclass

import numpy as np
from gossamer_files.options import option

from ..arrays import Matrix, Rows, Vector
from ..errors import DataError
from ..fitting.records import Record, forward_cuts

LEAST_OVERLAP = 0.25  # of one of two ranges
LEAST_SAMPLES = 20
SHORTEST_DECAY = 0.01  # of the stretch
OFFSET_DECAYS, GAIN_DECAYS = 4, 2
SHORTEST_GAIN_DECAY = 0.125  # of the stretch: a gain shows only over cycles
RIDGES = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0, 30.0)  # over the range of the stretch [1]


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
    if here[1] - here[0] < LEAST_OVERLAP * full_scale:
        sentences.append(
            f"strain is {100 * here[0]:.4g} to {100 * here[1]:.4g} %, a small part of the 0 to {100 * full_scale:.4g} % "
            f"that the sensor was identified on. Check the unit ({option('strain_unit')}), or name a record of like strain"
        )
    here = float(record.resistance.min()), float(record.resistance.max())
    known = min(offset, offset + gain), max(offset, offset + gain)
    shared = max(min(here[1], known[1]) - max(here[0], known[0]), 0.0)
    if not own_scales and shared < LEAST_OVERLAP * min(here[1] - here[0], known[1] - known[0]):
        unit = " ohm" * (record.unit == "ohm")
        sentences.append(
            f"resistance is {here[0]:.5g} to {here[1]:.5g}{unit}, but the sensor was identified on {known[0]:.5g} to "
            f"{known[1]:.5g}{unit} between rest and full scale: the ranges hardly overlap. Check column and unit "
            f"({option('resistance')}, {option('resistance_unit')}), or give {option('fit_scales', True)}"
        )
    return tuple(f"{record.name}: {sentence}." for sentence in sentences)


@dataclass(frozen=True, slots=True, kw_only=True)
class RelaxingScales:
    """Scales of one record, which relax with time.

    Attributes
    ----------
    gain, offset : ndarray, shape (m,)
        Resistance [ohm] = offset + gain * normalised output.
    last_gain, last_offset : float
        Their values once nothing relaxes any more [ohm].
    ridge : float
        The ridge that was chosen [1].
    """

    gain: Vector
    offset: Vector
    last_gain: float
    last_offset: float
    ridge: float


def fit_scales(output: Vector, record: Record, rows: Rows) -> RelaxingScales:
    """Fit the scales of a record to a stretch of it.

    Parameters
    ----------
    output : ndarray, shape (m,)
        Normalised output of the sensor for its strain [1].
    record : Record
        The record.
    rows : ndarray of bool, shape (m,)
        The stretch.

    Returns
    -------
    RelaxingScales
        At all samples of the record.

    Raises
    ------
    DataError
        The stretch is too short, the sensor gives the same output throughout it, or the gain is not positive.
    """
    where = f"{record.name}, lines {record.lines[rows][0]} to {record.lines[rows][-1]}" if rows.any() else record.name
    if rows.sum() < LEAST_SAMPLES or not np.ptp(output[rows]) > 0.0:
        advice = f"Name a stretch with loading ({option('stretch')})."
        msg = f"{where}: no scales can be fitted to {int(rows.sum())} samples. {advice}"
        raise DataError(msg)
    t, span = record.time - record.time[0], float(np.ptp(record.time[rows]))
    before = np.exp(-t[:, None] / (span * np.geomspace(SHORTEST_DECAY, 1.0, OFFSET_DECAYS)))
    growing = np.exp(-t[:, None] / (span * np.geomspace(SHORTEST_GAIN_DECAY, 1.0, GAIN_DECAYS)))
    A = np.column_stack([output, np.ones(t.size), before, output[:, None] * growing])
    unit = float(np.ptp(record.resistance[rows]))
    b = record.resistance / unit
    ridge = min(RIDGES, key=lambda each: _forward_error(A, b, rows, each))
    c = unit * _solve(A[rows], b[rows], ridge)
    gain = c[0] + growing @ c[-GAIN_DECAYS:]
    if not gain.min() > 0.0:
        msg = (
            f"{where}: the fitted gain falls to {gain.min():.3g}: this record does not follow the sensor. Check its "
            f"columns and units, or name a longer stretch ({option('stretch')})."
        )
        raise DataError(msg)
    return RelaxingScales(
        gain=gain,
        offset=c[1] + before @ c[2 : 2 + OFFSET_DECAYS],
        last_gain=float(c[0]),
        last_offset=float(c[1]),
        ridge=ridge,
    )


def _forward_error(A: Matrix, b: Vector, rows: Rows, ridge: float) -> float:
    """Return the mean square error [1] of each later part of the stretch, predicted from all parts before it."""
    squares = [
        np.mean((A[held] @ _solve(A[fitted], b[fitted], ridge) - b[held]) ** 2)
        for (fitted,), (held,) in forward_cuts((rows,))
    ]
    return float(np.mean(squares))


def _solve(A: Matrix, b: Vector, ridge: float) -> Vector:
    """Return the coefficients of least squares, with a ridge on all but gain and offset."""
    pull = ridge * np.sqrt(b.size) * np.eye(A.shape[1])[2:]
    wanted = np.concatenate([b, np.zeros(len(pull))])
    return np.asarray(np.linalg.lstsq(np.vstack([A, pull]), wanted, rcond=None)[0], dtype=float)

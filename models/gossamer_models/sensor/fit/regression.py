r"""Responses of the operators to records of strain: the columns in which the resistance is linear.

Symbols: ``s`` strain over full scale [1], ``y`` resistance over the range that is fitted [1], ``N`` lines; ``U``, ``D``
length of every cell (i, k >= i) of ``hysteresis.py`` that has switched up and down so far [1]; ``Z`` responses of one mode
per drive and decay rate :math:`\lambda` [1/s]; ``V`` :math:`e^{-\lambda t}` of what relaxed before a record began. With the
weights ``mu``, ``nu = eta*mu`` of the cells, ``w`` and ``v`` of the modes and ``y0`` at rest, Eqs. (4.7) and (4.13) of the
thesis are ``Stretch.response``. Switching depends on strain alone, so all columns are known before anything is fitted.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...arrays import Matrix, Rows, Vector
from ...errors import DataError
from ...fitting.records import Record
from ...modes import StretchedKernels, responses
from ..drives import Drive
from .settings import PreisachSettings

LEAST_SAMPLES = 50
EARLIER_PER_DECADE = 2.0
LEAST_MOVE = 0.01  # of full scale
OPPOSED = 0.5  # correlation of strain and resistance below which, with a minus, they are of opposite sign


class Weights(NamedTuple):
    """Weights of the columns [1]: cells, shape (N (N + 1) / 2,) each, modes, earlier modes, rest."""

    mu: Vector
    nu: Vector
    w: Vector
    v: Vector
    y0: Vector


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A record made ready: normalised, with its columns and the samples to fit.

    Attributes
    ----------
    record : Record
        As read.
    strain, y : ndarray, shape (m,)
        Strain over full scale [1]; resistance over the range of what is fitted [1].
    U, D : ndarray, shape (m, N (N + 1) / 2)
        Lengths of the cells that have switched up and down [1], in the order of ``numpy.triu_indices``.
    Z : ndarray, shape (m, d R)
        Responses of R modes to each of d drives.
    V : ndarray, shape (m, F Q)
        Q decaying modes of each of F fitted records; zero but for its own.
    train : ndarray of bool, shape (m,)
        Samples to fit.
    """

    record: Record
    strain: Vector
    y: Vector
    U: Matrix
    D: Matrix
    Z: Matrix
    V: Matrix
    train: Rows

    @cached_property
    def columns(self) -> Matrix:
        """All columns, in the order of ``Weights``."""
        return np.hstack([self.U, -self.D, self.Z, self.V, np.ones((self.y.size, 1))])

    def response(self, c: Weights) -> Vector:
        """Return the modelled resistance over the range of what is fitted [1], shape (m,)."""
        return np.asarray(self.U @ c.mu - self.D @ c.nu + self.Z @ c.w + self.V @ c.v + c.y0)


@dataclass(frozen=True, kw_only=True)
class Regression:
    """Records of one sensor made ready to be fitted together.

    Attributes
    ----------
    unit : float
        Range of the fitted resistance [ohm].
    kernels : StretchedKernels
        Rates of the relaxation modes and what kernels weigh them with.
    fading : float
        Share of the modes that a unit of strain erases [1].
    stretches : tuple of Stretch
        One per record.
    """

    unit: float
    kernels: StretchedKernels
    fading: float
    stretches: tuple[Stretch, ...]

    @property
    def fitted(self) -> list[int]:
        """Numbers of the records of which samples are fitted."""
        return [k for k, s in enumerate(self.stretches) if s.train.any()]

    @property
    def seen(self) -> float:
        """Largest strain that is fitted, over full scale [1]."""
        return max(float(self.stretches[k].strain[self.stretches[k].train].max()) for k in self.fitted)

    @property
    def samples(self) -> int:
        """Number of samples that are fitted."""
        return sum(int(s.train.sum()) for s in self.stretches)


def prepare(
    records: tuple[Record, ...], train: tuple[Rows, ...], settings: PreisachSettings, full_scale: float
) -> Regression:
    """Make records ready.

    Raises
    ------
    DataError
        The training stretches are too short, or strain or output is constant in them, or they have opposite signs.
    """
    unit = _check(records, train, full_scale)
    shortest = min(float(np.median(np.diff(r.time))) for r in records)
    longest = max(float(np.ptp(r.time[rows])) for r, rows in zip(records, train, strict=True) if rows.any())
    kernels = StretchedKernels.between(shortest, longest)
    own = [k for k, rows in enumerate(train) if rows.any()]
    moved = sum(float(np.abs(np.diff(records[k].strain[train[k]])).sum()) for k in own) / full_scale
    fading = settings.forgetting / moved
    stretches = []
    for k, (r, rows) in enumerate(zip(records, train, strict=True)):
        s = np.clip(r.strain / full_scale, 0.0, 1.0)
        U, D = switched(s, settings.n_lines)
        Z = V = np.empty((s.size, 0))
        if settings.relaxations:
            Z = relaxed(r.time, s, kernels.rates, settings.drives, fading)
        if settings.earlier:
            decays = np.exp(-np.outer(r.time - r.time[0], earlier_rates(kernels)))
            V = np.hstack([decays * (k == j) for j in own])
        stretches.append(Stretch(record=r, strain=s, y=r.resistance / unit, U=U, D=D, Z=Z, V=V, train=rows))
    return Regression(unit=unit, kernels=kernels, fading=fading, stretches=tuple(stretches))


def switched(strain: Vector, n_lines: int) -> tuple[Matrix, Matrix]:
    """Return the lengths that have switched up and down until every sample.

    Parameters
    ----------
    strain : ndarray, shape (m,)
        Normalised strain [1] in 0..1; the record starts at rest at the first value.
    n_lines : int
        Number of lines N.

    Returns
    -------
    up, down : ndarray, shape (m, N (N + 1) / 2)
        Length of every cell (i, k >= i), in the order of ``numpy.triu_indices``, that has switched so far [1].
    """
    width = np.arange(n_lines) / n_lines
    i, k = np.triu_indices(n_lines)
    filled = np.clip(fronts(strain, width, np.maximum(width, strain[0]))[:, i] - k / n_lines, 0.0, 1.0 / n_lines)
    moved = np.diff(filled, axis=0)
    up = np.cumsum(np.vstack([filled[:1], np.maximum(moved, 0.0)]), axis=0)
    down = np.cumsum(np.vstack([0.0 * filled[:1], np.maximum(-moved, 0.0)]), axis=0)
    return up, down


def fronts(x: Matrix, widths: Vector, start: Vector) -> Matrix:
    """Return the fronts of play operators along histories, shape (..., m, lines): see ``hysteresis.move_fronts``.

    Parameters
    ----------
    x : ndarray, shape (..., m)
        Histories [1].
    widths : ndarray, shape (lines,)
        Widths of the operators [1].
    start : ndarray, shape (lines,) or (..., lines)
        Fronts before [1].
    """
    found, front = np.empty((*x.shape, len(widths))), start
    for t in range(x.shape[-1]):
        now = x[..., t, None]
        found[..., t, :] = front = np.maximum(now, np.minimum(now + widths, front))
    return found


def relaxed(time: Vector, strain: Vector, rates: Vector, drives: tuple[Drive, ...], fading: float = 0.0) -> Matrix:
    """Return the responses [1], shape (m, d R), of modes of unit weight to d drives, all rates of the first drive first.

    Parameters
    ----------
    time, strain : ndarray, shape (m,)
        Time [s], increasing, and normalised strain [1], linear between samples; no mode is excited before the first.
    rates : ndarray, shape (R,)
        Decay rates [1/s].
    drives : tuple of Drive
        What excites the modes.
    fading : float
        Share of the modes that a unit of strain erases [1].
    """
    change = np.diff(strain)
    excitations = [(drive.sizes(change), drive.power) for drive in drives]
    Z = responses(np.diff(time), strain, rates, excitations, fading=fading)
    gains = np.repeat([drive.gain for drive in drives], rates.size).astype(bool)
    return np.where(gains, strain[:, None] * Z, Z)


def moves(strain: Vector) -> bool:
    """Return whether a normalised strain [1] varies enough to fit a sensor."""
    return strain.size > 0 and bool(np.ptp(strain) > LEAST_MOVE)


def earlier_rates(kernels: StretchedKernels) -> Vector:
    """Return the decay rates [1/s] of relaxation that may still be under way when a record begins."""
    low, high = np.log10(kernels.rates[[0, -1]])
    low, high = low + 1.2, high - 0.7
    return np.logspace(low, high, max(2, round((high - low) * EARLIER_PER_DECADE) + 1))


def _check(records: tuple[Record, ...], train: tuple[Rows, ...], full_scale: float) -> float:
    """Return the range of the fitted output; refuse training stretches from which no sensor can be fitted."""
    pairs = [(r, rows) for r, rows in zip(records, train, strict=True) if rows.any()]
    where = ", ".join(f"{r.name}, lines {r.lines[rows][0]} to {r.lines[rows][-1]}" for r, rows in pairs)
    count = sum(int(rows.sum()) for _, rows in pairs)
    if count < LEAST_SAMPLES:
        msg = f"{where or 'nowhere'}: {count} samples to fit, need {LEAST_SAMPLES} or more. Name a longer training stretch."
        raise DataError(msg)
    if not any(moves(r.strain[rows] / full_scale) for r, rows in pairs):
        msg = (
            f"{where}: in the training stretch the strain moves by less than {100.0 * LEAST_MOVE:g} % of full scale. "
            "Name one with loading."
        )
        raise DataError(msg)
    unit = float(np.ptp(np.concatenate([r.resistance[rows] for r, rows in pairs])))
    if not unit > 0.0:
        msg = f"{where}: the output is constant throughout the training stretch. Name one in which it changes."
        raise DataError(msg)
    strain = np.concatenate([r.strain[rows] - r.strain[rows].mean() for r, rows in pairs])
    output = np.concatenate([r.resistance[rows] - r.resistance[rows].mean() for r, rows in pairs])
    strain, output = strain / np.abs(strain).max(), output / np.abs(output).max()  # squares of tiny numbers are zero
    correlation = float(strain @ output) / float(np.linalg.norm(strain) * np.linalg.norm(output))
    if correlation < -OPPOSED:
        msg = (
            f"{where}: the output falls as strain rises, their correlation is {correlation:.2f}; the model's output rises. "
            "Change the sign of the output."
        )
        raise DataError(msg)
    return unit

r"""What temperature does to gain and offset of a sensor, from records that hold temperature beside strain and resistance.

Symbols: ``R`` resistance [ohm], ``m`` that at the reference temperature [ohm]; ``dT`` temperature less the reference [K];
``a`` relative change of gain [1/K], ``b`` change of resistance [ohm/K] at the level ``l``, the mean in training [ohm].

.. math:: R = m + (a\,(m - l) + b)\,\Delta T.

Least squares in turns: a, b and ``c`` of :math:`m = A c` together, with the product :math:`\Delta T\,(m - l)` of the turn
before. ``A`` are columns of ``regression.py`` with one eta for all cells: a sensor that may climb as it likes climbs with
temperature. A ridge on c is the one by which stretches of time that are left out are predicted best. Deviations are those of
the jackknife over these stretches, whose errors, unlike those of samples, do not go together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Rows, Vector
from ...fitting.records import Record
from ..artifact import TemperatureEffect
from .regression import prepare
from .settings import PreisachSettings

TURNS = 4
BLOCKS = 10  # of the jackknife
LINES = 16  # of the sensor beside which temperature is fitted
RIDGES = np.geomspace(1e-9, 1e-2, 8)  # tried
CLEAR = 4.0  # standard deviations of a or b above which temperature is taken into account
LEAST_RANGE = 0.5  # [K] of temperature from which it is fitted


@dataclass(frozen=True, slots=True, kw_only=True)
class Warming:
    """How temperature changes the resistance of a sensor.

    Attributes
    ----------
    reference, level : float
        Temperature at which nothing is changed [K]; l [ohm].
    a, b : float
        Relative change of gain [1/K] and change of resistance at the level [ohm/K].
    deviations : tuple of float
        Standard deviations of both.
    """

    reference: float
    level: float
    a: float
    b: float
    deviations: tuple[float, float]

    @property
    def clear(self) -> bool:
        """Whether the record tells that either is not zero."""
        return max(abs(self.a) / self.deviations[0], abs(self.b) / self.deviations[1]) > CLEAR

    @property
    def sentence(self) -> str:
        """What temperature does, and whether it is taken into account."""
        gain = f"{100.0 * self.a:.3g} ± {100.0 * self.deviations[0]:.2g} %"
        level = f"{self.b:.3g} ± {self.deviations[1]:.2g} at {self.level:.5g}"
        text = f"A kelvin above {self.reference:.1f} K changes the gain by {gain} and the resistance by {level}"
        return f"{text}." if self.clear else f"{text}, which is not clear: temperature is not taken into account."

    def effect(self, rest_resistance: float, change: float) -> TemperatureEffect:
        """Return it as of an artifact, with resistance at rest and rise to full scale at the reference [ohm]."""
        offset = (self.b + self.a * (rest_resistance - self.level)) / change
        return TemperatureEffect(reference=self.reference, gain=self.a, offset=offset)

    def at_reference(self, record: Record) -> Record:
        """Return a record with the resistance that it would have at the reference temperature."""
        return replace(record, resistance=self.undone(record, record.resistance))

    def undone(self, record: Record, R: Vector) -> Vector:
        """Return resistance at the temperature of a record, shape (m,) [ohm], as it would be at the reference."""
        assert record.temperature is not None  # as ``fit_warming`` makes sure
        return self.effect(self.level, 1.0).undone(R, record.temperature, self.level, 1.0)

    def done(self, record: Record, m: Vector) -> Vector:
        """Return what ``undone`` takes."""
        assert record.temperature is not None
        return m + (self.a * (m - self.level) + self.b) * (record.temperature - self.reference)


def fit_warming(records: Sequence[Record], train: Sequence[Rows], full_scale: float) -> Warming | None:
    """Fit what temperature does to records of one sensor.

    Parameters
    ----------
    records, train : sequence of Record, sequence of ndarray of bool
        Records and the samples to fit.
    full_scale : float
        Strain [1] at the end of the range.

    Returns
    -------
    Warming or None
        None where a record has no temperature, or it hardly varies in what is fitted.

    Raises
    ------
    DataError
        As of a fit: the training stretches are too short, or strain or output is constant in them.
    """
    temperatures = [r.temperature[rows] for r, rows in zip(records, train, strict=True) if r.temperature is not None]
    if len(temperatures) < len(records) or np.ptp(np.concatenate(temperatures)) < LEAST_RANGE:
        return None
    reference = round(float(np.concatenate(temperatures).mean()), 1)
    settings = PreisachSettings(n_lines=LINES, earlier=True)
    ready = prepare(tuple(records), tuple(train), settings, full_scale)
    parts = [np.column_stack([s.U - s.D, s.D.sum(axis=1), s.Z, s.V, np.ones(s.y.size)])[s.train] for s in ready.stretches]
    A, y = np.vstack(parts), np.concatenate([s.y[s.train] for s in ready.stretches])
    A = A[:, np.ptp(A, axis=0) > 0.0]
    size, dT = A.std(axis=0), np.concatenate(temperatures) - reference
    A, m = np.column_stack([A / size, np.ones(y.size)]), y
    blocks = np.array_split(np.arange(y.size), BLOCKS)
    level, best = float(y.mean()), np.zeros(2)
    for _ in range(TURNS):
        B = np.column_stack([A, dT * (m - level), dT])
        products = [(B[rows].T @ B[rows], B[rows].T @ y[rows]) for rows in blocks]
        H, g = np.sum([each[0] for each in products], axis=0), np.sum([each[1] for each in products], axis=0)
        pull = np.diag([*np.ones(A.shape[1] - 1), 0.0, 0.0, 0.0]) * y.size
        tried = []
        for ridge in RIDGES:
            others = [np.linalg.solve(H - H_j + ridge * pull, g - g_j) for H_j, g_j in products]
            missed = sum(float(np.sum((y[rows] - B[rows] @ c) ** 2)) for rows, c in zip(blocks, others, strict=True))
            tried.append((missed, ridge, others))
        _, ridge, others = min(tried, key=lambda each: each[0])
        c = np.linalg.solve(H + ridge * pull, g)
        m, best = A @ c[:-2], c[-2:]
    unit = np.array([1.0, ready.unit])
    spread = np.sqrt((BLOCKS - 1.0) * np.mean((np.array([each[-2:] for each in others]) - best) ** 2, axis=0)) * unit
    a, b = (best * unit).tolist()
    return Warming(reference=reference, level=level * ready.unit, a=a, b=b, deviations=(float(spread[0]), float(spread[1])))

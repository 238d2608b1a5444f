r"""What the twin is fitted to: histories of strain or resistance.

Symbols: ``y`` values, one row per sensor; ``n`` samples; ``h`` step [s].
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..arrays import Matrix, Rows, Vector
from ..errors import DataError

LEAST_SAMPLES = 60  # per sensor: fewer cannot tell the damages
DIFFERENCES = 6  # order of the differences that show noise
DEAD = 1e-9  # spread over magnitude of a sensor that does not move
# Orders of the histories that no mirror turns into each other, and what to say of them; the first is as given.
ORDERS = {
    (1, 0, 2, 3): "1 and 2, or 3 and 4",
    (2, 1, 0, 3): "1 and 3, or 2 and 4",
    (3, 1, 2, 0): "1 and 4, or 2 and 3",
    (1, 2, 0, 3): "three of them",
    (2, 0, 1, 3): "three of them",
}


@dataclass(frozen=True, kw_only=True)
class ResponseRecord:
    """Histories of the sensors, from the moment that the load sets in.

    Attributes
    ----------
    step : float
        Time between samples [s]; the first sample lies one step after the membrane's rest.
    values : ndarray, shape (sensors, n)
        Strain [1] or resistance [ohm]; not a number in gaps and for sensors that are left out.
    kind : {"strain", "resistance"}
        What the values are.
    noise : float, ndarray of shape (sensors,), or None
        Standard deviation of the noise, in the unit of the values; None to estimate it.

    Raises
    ------
    DataError
        The values have another shape, are infinite or too few, or a number makes no sense.
    """

    step: float
    values: Matrix
    kind: Literal["strain", "resistance"] = "strain"
    noise: float | Vector | None = None

    def __post_init__(self) -> None:
        values = np.asarray(self.values, dtype=float)
        object.__setattr__(self, "values", values)
        if values.ndim != 2:
            msg = f"a record needs one row for each sensor, shape (sensors, n), not {values.shape}"
            raise DataError(msg)
        if self.kind not in ("strain", "resistance"):
            msg = f"a record holds 'strain' or 'resistance', not {self.kind!r}"
            raise DataError(msg)
        if not (math.isfinite(self.step) and self.step > 0.0):
            msg = f"the step of a record is a positive time [s], not {self.step!r}"
            raise DataError(msg)
        if np.isinf(values).any():
            sensor, sample = np.argwhere(np.isinf(values))[0]
            msg = f"sensor {sensor + 1} is infinite at sample {sample + 1}. Write NaN where a value is missing."
            raise DataError(msg)
        if self.samples < LEAST_SAMPLES:
            msg = f"the record has {self.samples} samples; the twin needs {LEAST_SAMPLES} or more. Record longer."
            raise DataError(msg)
        if self.noise is not None:
            noise = np.broadcast_to(np.asarray(self.noise, dtype=float), values.shape[:1])
            if not (np.isfinite(noise).all() and (noise > 0.0).all()):
                msg = f"the noise of a record is a positive deviation, not {self.noise!r}. Leave it out to estimate it."
                raise DataError(msg)

    @property
    def samples(self) -> int:
        """Samples of each sensor, gaps included."""
        return int(self.values.shape[1])

    @property
    def present(self) -> Rows:
        """Where there are values, shape (sensors, n)."""
        return np.asarray(np.isfinite(self.values))

    @property
    def sensors(self) -> list[int]:
        """Sensors with values, from 0."""
        return np.flatnonzero(self.present.any(axis=1)).tolist()

    def without(self, sensors: Sequence[int]) -> ResponseRecord:
        """Return the record without some sensors, from 0."""
        values = self.values.copy()
        values[list(sensors)] = np.nan
        return replace(self, values=values)

    def ordered(self, order: Sequence[int]) -> ResponseRecord:
        """Return the record with its rows in another order."""
        return replace(self, values=self.values[list(order)])

    def noise_deviation(self) -> Vector:
        r"""Return the standard deviation of the noise of each sensor, shape (sensors,), not a number for sensors left out.

        Notes
        -----
        Where it is not given, from differences of order m = 6: those of a smooth history vanish, those of white noise
        have the variance :math:`\binom{2m}{m} \sigma^2`. It is never smaller than what a history of this step leaves.
        """
        if self.noise is not None:
            given = np.broadcast_to(np.asarray(self.noise, dtype=float), self.values.shape[:1]).copy()
            given[~self.present.any(axis=1)] = np.nan
            return given
        found = np.full(len(self.values), np.nan)
        for k in self.sensors:
            d = np.diff(self.values[k], DIFFERENCES)
            d = d[np.isfinite(d)]
            if d.size < LEAST_SAMPLES // 2:
                msg = (
                    f"sensor {k + 1} has too many gaps to estimate its noise. Give the noise, or leave the sensor out."
                )
                raise DataError(msg)
            spread = float(np.nanmax(self.values[k]) - np.nanmin(self.values[k]))
            found[k] = max(math.sqrt(float(np.mean(d**2)) / math.comb(2 * DIFFERENCES, DIFFERENCES)), 1e-7 * spread)
        return found


def dead_sensors(record: ResponseRecord) -> list[int]:
    """List the sensors, from 0, that have values but do not move, or have too few of them."""
    dead = []
    for k in record.sensors:
        row = record.values[k][record.present[k]]
        if row.size < LEAST_SAMPLES or np.ptp(row) <= DEAD * max(1e-300, float(np.abs(row).max())):
            dead.append(k)
    return dead


@dataclass(frozen=True)
class Wiring:
    """Another reading of a record.

    Attributes
    ----------
    order : tuple of int
        Sensors, from 0, whose histories are taken for those of sensors 0 to 3.
    without : tuple of int
        Sensors that are left out.
    doubt : str
        What to say.
    """

    order: tuple[int, ...]
    without: tuple[int, ...]
    doubt: str

    @property
    def swaps(self) -> bool:
        """Whether it swaps sensors."""
        return self.order != tuple(range(len(self.order)))

    def applied(self, record: ResponseRecord) -> ResponseRecord:
        """Return the record read this way."""
        return record.ordered(self.order).without(self.without)


def other_wirings(record: ResponseRecord) -> list[Wiring]:
    """List what else a record of these sensors may be: swapped sensors, and one wrong sensor."""
    as_given, present = tuple(range(len(record.values))), record.sensors
    found = []
    for order, who in ORDERS.items():
        if len(present) == len(as_given) == len(order):
            doubt = f"the record fits with sensors swapped: {who}. Damage may be mirrored; check the wiring"
            found.append(Wiring(order, (), doubt))
    if len(present) > 2:
        found += [Wiring(as_given, (k,), f"sensor {k + 1} contradicts the others and is left out") for k in present]
    return found


def best_wiring(record: ResponseRecord, misfit: Callable[[ResponseRecord], float]) -> Wiring | None:
    """Return the reading with the smallest misfit, or None if none passes.

    Parameters
    ----------
    record : ResponseRecord
        Record that does not fit as it is.
    misfit : callable
        Takes a record and returns by how many standard deviations chi2 is above the expected one; above 3 is no fit.
    """
    wirings = other_wirings(record)
    misfits = np.array([misfit(wiring.applied(record)) for wiring in wirings])
    if misfits.size == 0 or not misfits.min() < 3.0:
        return None
    return wirings[int(misfits.argmin())]

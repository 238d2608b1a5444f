"""What a twin says of a record."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..arrays import Matrix, Rows, Vector
from .record import ResponseRecord

DETERMINED = 0.02  # deviation of a damage that is answered with a value
WIDTH = 1.96  # deviations to each side of the bounds, 95 %
OF_ZONES = ("damage", "deviation", "probability", "covariance", "bounds")


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Damage of all zones with its uncertainty, and whether the twin explains the record.

    Attributes
    ----------
    zones : tuple of str
        Names of the zones.
    damage, deviation : ndarray, shape (zones,)
        Lost fraction of Young's modulus [1] and its standard deviation, which counts in that other zones may explain the
        record as well; where ``damage`` is zero, the deviation that it would have if it were fitted.
    probability : ndarray, shape (zones,)
        How likely each zone is damaged [1].
    covariance : ndarray, shape (zones, zones)
        Covariance of the damages [1]; rows and columns of zones that were dropped are zero outside the diagonal, but for
        zones that may be damaged in place of others.
    nuisances : dict of tuple of float
        Value and standard deviation of each nuisance: a factor for load, damping, modulus and gain; phase [rad]; pressure
        [Pa]; offset [1], of strain or of the sensor's change at full scale.
    sensor_errors, sensor_offsets : tuple of float or None
        How far each sensor is off its identified model, as shares of the range of what it reads [1]: root mean square of its
        likeliest error beside an offset, and that offset; None of one without values. Empty for strain.
    chi2_per_sample, chi2_bound : float
        Mean square of the residuals in units of the expected ones, and the bound that a right model passes in 999 of
        1000 records.
    valid : bool
        Whether the answer can be used: chi2 is below its bound and no doubt forbids it.
    unresolved : tuple of int
        Zones, from 1, that this record cannot tell by themselves.
    together_with : tuple of tuple of str
        Of each zone the names of those that it was answered together with: all have their mean damage and its deviation.
    left_out : tuple of int
        Sensors, from 1, that were left out.
    order : tuple of int
        Sensors, from 1, whose histories were taken for those of the first, the second, ...
    doubts : tuple of str
        Sentences on what is wrong with the record or the answer.
    samples, simulations : int
        Values that were fitted, and cases that were simulated.
    record : ResponseRecord
        What was fitted: the samples that were compared, of the sensors in ``order`` that were not left out.
    predicted : ndarray, shape (sensors, n)
        What the sensors read by this answer, in the unit of the record, without the model error that is allowed for.
    """

    zones: tuple[str, ...]
    damage: Vector
    deviation: Vector
    probability: Vector
    covariance: Matrix
    nuisances: dict[str, tuple[float, float]]
    sensor_errors: tuple[float | None, ...] = ()
    sensor_offsets: tuple[float | None, ...] = ()
    chi2_per_sample: float
    chi2_bound: float
    valid: bool
    unresolved: tuple[int, ...] = ()
    together_with: tuple[tuple[str, ...], ...] = ()
    left_out: tuple[int, ...] = ()
    order: tuple[int, ...]
    doubts: tuple[str, ...] = field(default=())
    samples: int = 0
    simulations: int = 0
    record: ResponseRecord
    predicted: Matrix

    @property
    def determined(self) -> Rows:
        """Whether the damage of each zone is known to 2 percentage points, shape (zones,); others have bounds alone."""
        return np.asarray((self.deviation <= DETERMINED) & ~self._untold)

    @property
    def value(self) -> Vector:
        """Damage of each zone that is determined [1], shape (zones,); not a number of the others."""
        return np.where(self.determined, self.damage, np.nan)

    @property
    def bounds(self) -> Matrix:
        """Between which the damage of each zone lies in 95 of 100 records that the twin explains [1], shape (zones, 2)."""
        reach = np.where(self._untold, 1.0, WIDTH * self.deviation)
        return np.asarray(np.clip(self.damage[:, None] + reach[:, None] * [-1.0, 1.0], 0.0, 1.0))

    @property
    def _untold(self) -> Rows:
        """Which zones the record cannot tell by themselves, and that are not answered together with others."""
        together = np.array([bool(others) for others in self.together_with or [()] * len(self.zones)])
        return np.asarray(np.isin(np.arange(1, len(self.zones) + 1), self.unresolved or ()) & ~together)

    def as_json(self, *, show_invalid: bool = False) -> dict[str, Any]:
        """Return the answer without its histories as JSON values: null where a zone has no value.

        Parameters
        ----------
        show_invalid : bool
            Whether the zones of an answer that is not valid are shown.
        """
        shown = self.valid or show_invalid
        left_out = ("record", "predicted", *(() if shown else OF_ZONES))
        found = {
            name: value.tolist() if isinstance(value := getattr(self, name), np.ndarray) else value
            for name in (*self.__dataclass_fields__, "determined", "bounds")
            if name not in left_out
        }
        if not shown:
            return found | dict.fromkeys(OF_ZONES)
        return found | {"damage": [None if np.isnan(value) else value for value in self.value.tolist()]}

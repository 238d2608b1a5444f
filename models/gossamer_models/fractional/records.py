"""Records that fractional models are fitted to and judged on, and the measures of misfit."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..measures import e1, nrmse
from .artifact import FractionalArtifact
from .model import predict

Vector = NDArray[np.float64]
MOST_RESAMPLED = 4  # times as many samples as before


@dataclass(frozen=True, kw_only=True, eq=False)
class UniformRecord:
    """One measurement, sampled in equal steps.

    Attributes
    ----------
    strain : ndarray, shape (m,)
        Strain [1] from the first loading on.
    resistance : ndarray, shape (m,)
        Resistance [ohm].
    sampling_step : float
        Time between samples [s].
    rest_resistance : float or None
        Resistance [ohm] before the first loading; models and errors count from there. None to fit it.
    train : slice
        Samples that are fitted.
    weight : float
        Weight [1] of the squared errors of this record in a fit with others.
    name : str
        For tables and messages.
    """

    strain: Vector
    resistance: Vector
    sampling_step: float
    rest_resistance: float | None = None
    train: slice = field(default_factory=lambda: slice(None))
    weight: float = 1.0
    name: str = "record"

    @classmethod
    def resampled(
        cls,
        time: Vector,
        strain: Vector,
        resistance: Vector,
        *,
        train: tuple[float, float] = (-np.inf, np.inf),
        rest_resistance: float | None = None,
        weight: float = 1.0,
        name: str = "record",
    ) -> UniformRecord:
        """Bring samples at increasing times to equal steps, by linear interpolation.

        Parameters
        ----------
        time, strain, resistance : ndarray, shape (m,)
            Time [s], strain [1] and resistance [ohm].
        train : tuple of float
            First and last time [s] that is fitted.
        rest_resistance, weight, name
            As of the record.

        Notes
        -----
        The step is the median one, unless a few long ones (a hold that was not sampled) would multiply the samples by
        more than ``MOST_RESAMPLED``.
        """
        steps = np.diff(time)
        count = round(min((time[-1] - time[0]) / np.median(steps), MOST_RESAMPLED * steps.size))
        even = np.linspace(time[0], time[-1], count + 1)
        step = float(even[1] - even[0])
        first, last = np.searchsorted(even, (train[0] - 1e-6 * step, train[1] + 1e-6 * step))
        return cls(
            strain=np.interp(even, time, strain),
            resistance=np.interp(even, time, resistance),
            sampling_step=step,
            rest_resistance=rest_resistance,
            train=slice(int(first), int(last)),
            weight=weight,
            name=name,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """How far a model is from a stretch of a record.

    Attributes
    ----------
    e1 : float
        Of the change of resistance [%], see ``measures.e1``.
    nrmse : float
        Root mean square error [% of the range of the record].
    """

    e1: float
    nrmse: float


def misfit(artifact: FractionalArtifact, record: UniformRecord, stretch: slice = slice(None)) -> Misfit:
    """Compare a model, run through the whole record, with a stretch of it; not a number if that is empty."""
    predicted = predict(artifact, record.strain, record.sampling_step) - artifact.rest_resistance
    rest = artifact.rest_resistance if record.rest_resistance is None else record.rest_resistance
    change = record.resistance - rest
    return Misfit(
        e1=e1(change[stretch], predicted[stretch], rest=0.0),
        nrmse=nrmse(change[stretch], predicted[stretch], float(np.ptp(change))),
    )

"""What a filter of strain knows besides the sensor: how strain moves, and how far the sensor's model is off.

Strain is normalised by full scale, output by the rise of a virgin sensor to full scale.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ..errors import ParameterError


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorModel:
    """Error of a model as a random process: white noise plus a part that is slowly forgotten.

    Attributes
    ----------
    white, slow : float
        Standard deviations [1] of the two parts, positive.
    time : float
        Correlation time [s] of the slow part, positive.
    """

    white: float
    slow: float
    time: float

    def __post_init__(self) -> None:
        _positive(self, "white", "slow", "time")


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracking:
    """Numbers of a filter of strain.

    Attributes
    ----------
    output : ErrorModel
        Error of the output that the sensor's model predicts.
    inverse : ErrorModel or None
        Error of the strain that the direct inverse gives; None where the filter does not use it.
    rate : float
        Speed of strain [1/s] that it exceeds half of the time in which it moves.
    hold : float
        Share of the time [1] in which strain rests, below 1.
    turns : float
        Sudden changes of its rate per second [1/s].
    wander : float
        Change of its rate between them, standard deviation after one second [1/s].
    tail : float
        Degrees of freedom [1] of the errors' Student distribution: the smaller, the less a single sample counts.
    factor, floor : float
        Stated deviation = square root of (factor times that of the hypotheses) squared plus floor squared [1].
    """

    output: ErrorModel
    inverse: ErrorModel | None = None
    rate: float = 0.1
    hold: float = 0.1
    turns: float = 0.1
    wander: float = 0.03
    tail: float = 30.0
    factor: float = 1.0
    floor: float = 1e-3

    def __post_init__(self) -> None:
        _positive(self, "rate", "turns", "wander", "tail", "factor", "floor")
        if not 0.0 <= self.hold < 1.0:
            msg = (
                f"hold is {self.hold:g}; the share of time at rest is 0 or more and below 1. Identify the sensor again."
            )
            raise ParameterError(msg)

    @classmethod
    def of(cls, card: dict[str, Any]) -> Tracking:
        """Make it from JSON values."""
        errors = {name: card[name] and ErrorModel(**card[name]) for name in ("output", "inverse")}
        return cls(**{**{each.name: card[each.name] for each in fields(cls)}, **errors})


def _positive(owner: object, *names: str) -> None:
    for name in names:
        value = getattr(owner, name)
        if not (np.isfinite(value) and value > 0.0):
            msg = f"{name} is {value:g}; the numbers of a filter are positive. Identify the sensor again."
            raise ParameterError(msg)


DEFAULT_TRACKING = Tracking(output=ErrorModel(white=3e-3, slow=5e-3, time=10.0))

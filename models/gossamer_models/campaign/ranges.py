"""Ranges and distributions that a campaign draws from."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..mistakes import DescriptionError, Mistake, disordered, raise_any

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Vary:
    """Range that a quantity is drawn from; one of the two.

    Attributes
    ----------
    range : tuple of float or None
        In the unit of the quantity, uniform.
    factor : tuple of float or None
        Of the constant value; the logarithm is uniform, so that half and double are as likely.
    """

    range: Pair | None = None
    factor: Pair | None = None

    def __post_init__(self) -> None:
        if (self.range is None) == (self.factor is None):
            raise DescriptionError(Mistake((), "Write either range = [low, high] or factor = [low, high]."))
        for name, pair in (("range", self.range), ("factor", self.factor)):
            raise_any([*disordered(name, pair or (0.0, 0.0), -math.inf, math.inf)])
        if self.factor is not None and self.factor[0] <= 0.0:
            text = f"'factor' begins at {self.factor[0]:g}; factors are positive. Write a range in its place."
            raise DescriptionError(Mistake(("factor",), text))

    def limits(self, base: float) -> Pair:
        """Return the lowest and highest value, given the constant one."""
        if self.range is not None:
            return self.range
        low, high = sorted(base * f for f in self.factor or (1.0, 1.0))
        return low, high


@dataclass(frozen=True, slots=True, kw_only=True)
class Distribution:
    """Distribution of white noise; one of the two.

    Attributes
    ----------
    uniform : tuple of float or None
        Range.
    normal : float or None
        Standard deviation about zero.
    """

    uniform: Pair | None = None
    normal: float | None = None

    def __post_init__(self) -> None:
        if (self.uniform is None) == (self.normal is None):
            raise DescriptionError(Mistake((), "Write either uniform = [low, high] or normal = standard deviation."))
        raise_any([*disordered("uniform", self.uniform or (0.0, 0.0), -math.inf, math.inf)])
        if self.normal is not None and self.normal < 0.0:
            raise DescriptionError(
                Mistake(("normal",), f"'normal' is {self.normal:g}. Write a standard deviation, 0 or more.")
            )

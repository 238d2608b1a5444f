r"""A small network that corrects the sensor's output by what its memory shows.

Symbols: ``X`` features of a sensor's state over their trained range, -1 to 1 [1]; hidden units ``a`` [1]; ``r`` correction
of the normalised output [1],

.. math:: a = \tanh(W X + c), \qquad r = G\, B \tanh(w \cdot a / B), \qquad
   G = \max(0,\, 1 - \sum_i \max(|X_i| - 1, 0) / m).

The gate ``G`` is 1 within the range that the network was trained in, and 0 where the features together leave it by more
than the margin m of half of their range: there the physics stands alone. The bound ``B`` limits the correction.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import casadi as ca
import numpy as np

from ..errors import ParameterError
from .hysteresis import across

MARGIN = 0.5  # m [1]
FRONTS = (1, 2, 4, 8, 16)  # lines of 32 whose fronts are features; of N lines their multiples by N/32


@dataclass(frozen=True, slots=True, kw_only=True)
class Residual:
    """Weights of the network.

    Attributes
    ----------
    lowest, highest : tuple of float, length F
        Range of each feature in training [1].
    hidden : tuple of tuples of float, shape (H, F)
        W [1].
    bias, out : tuple of float, length H
        c and w [1].
    bound : float
        B [1], positive.

    Raises
    ------
    ParameterError
        The shapes do not fit together, or a number is not finite.
    """

    lowest: tuple[float, ...]
    highest: tuple[float, ...]
    hidden: tuple[tuple[float, ...], ...]
    bias: tuple[float, ...]
    out: tuple[float, ...]
    bound: float

    def __post_init__(self) -> None:
        F, H = len(self.lowest), len(self.hidden)
        sizes = [len(self.highest), *(len(row) for row in self.hidden)] == [F] * (H + 1) and len(self.bias) == H
        numbers = np.concatenate([np.ravel(getattr(self, each.name)) for each in fields(self)]) if sizes else [np.nan]
        if not sizes or len(self.out) != H or not np.isfinite(numbers).all() or self.bound <= 0.0:
            msg = f"the residual network of {F} features and {H} units is not complete. Identify the sensor again."
            raise ParameterError(msg)

    @classmethod
    def of(cls, card: dict[str, Any]) -> Residual:
        """Make it from JSON values."""
        rows = {name: tuple(map(float, card[name])) for name in ("lowest", "highest", "bias", "out")}
        return cls(**rows, hidden=tuple(tuple(map(float, row)) for row in card["hidden"]), bound=float(card["bound"]))

    def correction(self, features: ca.MX) -> ca.MX:
        """Return r [1], scalar or shape (1, P), from features [1], shape (F,) or (F, P)."""
        low, half = ca.DM(self.lowest), 0.5 * (ca.DM(self.highest) - ca.DM(self.lowest))
        X = (features - across(low, features)) / across(half, features) - 1.0
        a = ca.tanh(ca.mtimes(ca.DM(self.hidden), X) + across(ca.DM(self.bias), features))
        gate = ca.fmax(1.0 - ca.sum1(ca.fmax(ca.fabs(X) - 1.0, 0.0)) / MARGIN, 0.0)
        return gate * self.bound * ca.tanh(ca.mtimes(ca.DM(self.out).T, a) / self.bound)


def lines_of(n_lines: int) -> list[int]:
    """Return the lines whose fronts are features."""
    return sorted({max(1, line * n_lines // 32) for line in FRONTS if line * n_lines // 32 < n_lines})

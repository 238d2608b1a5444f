"""How to fit a fractional model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import ParameterError


@dataclass(frozen=True, slots=True, kw_only=True)
class FractionalSettings:
    """How to fit.

    Attributes
    ----------
    n_terms, n_fading : int
        Number of fractional terms, and of fading integrals (model-1 only): N and M - N of the thesis, 5 and 3 in
        Table 3.2.
    orders, rates, exponents : tuple of float
        Bounds of :math:`a_k` [1], :math:`p_l` [1/s] and :math:`q_l` [1].
    nonnegative : bool
        True: no coefficient is negative, which makes an integral model passive; False: as in the thesis.
    restraint : float
        Penalty [1] on terms that cancel each other: on how far their sizes, root mean squares, add up to more than the
        size of the measured change. Terms of nearby orders otherwise grow without end. A term that is split in two
        costs nothing, so more terms never fit worse; terms without use get a coefficient of zero.
    starts, seed : int
        Number of random starts, and what they are drawn from.
    most_evaluations : int
        Of the columns, per start.
    shortest, longest : float
        Range of times [s] of the memory.
    """

    n_terms: int = 5
    n_fading: int = 3
    orders: tuple[float, float] = (0.001, 0.999)
    rates: tuple[float, float] = (1e-4, 10.0)
    exponents: tuple[float, float] = (0.1, 4.0)
    nonnegative: bool = True
    restraint: float = 0.1
    starts: int = 12
    seed: int = 0
    most_evaluations: int = 60
    shortest: float = 1e-4
    longest: float = 1e5

    def __post_init__(self) -> None:
        for name, (low, high), least, most in (
            ("orders", self.orders, 0.0, 1.0),
            ("rates", self.rates, 0.0, np.inf),
            ("exponents", self.exponents, 0.0, np.inf),
        ):
            if not least < low < high < most:
                msg = f"bounds of {name} are {low:g} to {high:g}; they must increase within {least:g} to {most:g}"
                raise ParameterError(msg)
        if self.n_terms < 1 or self.n_fading < 0 or self.starts < 1 or self.restraint < 0.0:
            msg = "need one or more terms and starts, and neither fading integrals nor a restraint below zero"
            raise ParameterError(msg)

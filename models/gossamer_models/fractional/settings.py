"""Settings of a fit of a fractional model, with their checks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..arrays import Vector
from ..errors import ParameterError
from ..fitting.options import fit_option
from .artifact import MODELS, ModelName


@dataclass(frozen=True, kw_only=True)
class FractionalSettings:
    """How to fit.

    Attributes
    ----------
    model : {"model-1", "sub-model-1", "sub-model-2"}
        See ``FractionalArtifact``.
    terms, fading : int
        Number of fractional terms, and of fading integrals (model-1 only): N and M - N, 5 and 3 in
        Table 3.2 of the thesis.
    starts, seed : int
        Number of random starts, and the seed of the generator that draws them.
    orders, rates, exponents : tuple of float
        Bounds of :math:`a_k` [1], :math:`p_l` [1/s] and :math:`q_l` [1].
    nonnegative : bool
        True: no coefficient is negative, which makes an integral model passive; False: as in the thesis.
    restraint : float
        Penalty [1] on terms that cancel each other: on how far their sizes, root mean squares, add up to more than the
        size of the measured change. Terms of nearby orders otherwise grow without end. A term that is split in two
        costs nothing, so more terms never fit worse; terms without use get a coefficient of zero.
    most_evaluations : int
        Largest number of evaluations of the columns per start.
    shortest, longest : float
        Range of times [s] of the memory.
    """

    FAMILY: ClassVar[str] = "fractional"

    model: ModelName
    terms: int = fit_option(5)
    fading: int = fit_option(3, "fractional-model-1")
    starts: int = fit_option(12)
    seed: int = fit_option(0)

    orders: tuple[float, float] = (0.001, 0.999)
    rates: tuple[float, float] = (1e-4, 10.0)
    exponents: tuple[float, float] = (0.1, 4.0)
    nonnegative: bool = True
    restraint: float = 0.1
    most_evaluations: int = 60
    shortest: float = 1e-4
    longest: float = 1e5

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            msg = f"there is no fractional model {self.model!r}; it is one of {', '.join(MODELS)}"
            raise ParameterError(msg)
        for name, (low, high), least, most in (
            ("orders", self.orders, 0.0, 1.0),
            ("rates", self.rates, 0.0, np.inf),
            ("exponents", self.exponents, 0.0, np.inf),
        ):
            if not least < low < high < most:
                msg = f"bounds of {name} are {low:g} to {high:g}; they must increase within {least:g} to {most:g}"
                raise ParameterError(msg)
        if self.terms < 1 or self.fading < 0 or self.starts < 1 or self.restraint < 0.0:
            msg = "need one or more terms and starts, no negative number of fading integrals, and no negative restraint"
            raise ParameterError(msg)

    @property
    def box(self) -> tuple[Vector, Vector]:
        """Bounds of orders, rates and exponents, shape (N + 2 L,) each."""
        bounds = [self.orders] * self.terms + [self.rates] * self.n_fading + [self.exponents] * self.n_fading
        return np.array([low for low, _ in bounds]), np.array([high for _, high in bounds])

    @property
    def n_fading(self) -> int:
        """Number of fading integrals of the model."""
        return self.fading if self.model == "model-1" else 0

    @property
    def first_fading(self) -> int:
        """Place of the first fading integral among the columns."""
        return 1 + self.terms * (1 if self.model == "sub-model-1" else 2)

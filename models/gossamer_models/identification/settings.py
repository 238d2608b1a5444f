"""How to fit the modified Preisach model: everything that may be chosen, checked when it is chosen."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Literal

from ..errors import ParameterError
from .regressors import DRIVES


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    r"""How to fit.

    Attributes
    ----------
    density : {"modal", "hats"}
        Modal functions of Eqs. (4.16) and (4.17), or hat functions on a coarse grid of the triangle with an elastic line
        :math:`\alpha = \beta` of their own and one eta.
    modes, relaxations : int
        M modal functions each for mu and eta, and P kernels.
    n_lines, n_knots : int
        Lines and bins along a line of the finished tables; knots of the hat functions along each axis.
    elastic : bool
        Whether an elastic line with modes of its own is added to the modal density: operators of no width, which a smooth
        density cannot hold. The thesis' equations have none.
    drives : tuple of str
        What excites the relaxation: the thesis' rising strain, with amplitudes constant and proportional to strain, or
        falling strain too.
    signed : bool
        Whether amplitudes of relaxation may be negative.
    invertible : bool
        Whether the output must fall with falling strain in a step of any size, so that the exact inverse exists.
    direct_inverse : bool
        Whether to fit the way from output to strain too, which then replaces the exact inverse.
    earlier : bool
        Whether relaxation from before a record may still be under way when it begins; the sensor that is built knows nothing
        of it.
    eta : tuple of float
        Least and largest eta [1].
    fit_kernels : bool
        False fixes all kernels: exponentials with times evenly spaced in the logarithm from a sample to the record.
    least_spring, least_weight : float
        Lower bounds of mu on the elastic line and on all others, in units of the output's range.
    smoothness, ridge, eta_stiffness, kernel_stiffness, relaxation_ridge : float
        Pulls towards a flat and a small density mu, eta = 1, the first kernels and small relaxation, relative to noise of
        the size of the output's range. A density of the elastic line is free: hysteresis has to be earned, and so does
        drift.
    auto_ridge : bool
        Whether ``ridge`` and ``relaxation_ridge`` are chosen by predicting the later parts of the training stretch.
    tau : tuple of float or None
        Times [s] of the kernels; None to fit them.
    exponents : tuple of float or None
        Exponents c [1] of the kernels, in (0, 1]; None to fit them.
    starts, seed : int
        How many starts, and the seed of all but the first.
    most_iterations : int
        Most iterations per start.
    """

    density: Literal["modal", "hats"] = "modal"
    modes: int = 7
    relaxations: int = 7
    n_lines: int = 32
    n_knots: int = 6
    elastic: bool = True
    drives: tuple[str, ...] = DRIVES[:2]
    signed: bool = False
    invertible: bool = True
    direct_inverse: bool = False
    earlier: bool = False
    eta: tuple[float, float] = (0.5, 1.2)
    least_spring: float = 0.02
    least_weight: float = 1e-4
    smoothness: float = 3e-2
    ridge: float = 0.1
    eta_stiffness: float = 1.0
    kernel_stiffness: float = 1e-3
    relaxation_ridge: float = 1e-3
    auto_ridge: bool = False
    tau: tuple[float, ...] | None = None
    exponents: tuple[float, ...] | None = None
    fit_kernels: bool = True
    starts: int = 2
    seed: int = 0
    most_iterations: int = 60

    def __post_init__(self) -> None:
        if self.modes < 1 or self.relaxations < 0 or self.starts < 1 or self.n_lines < 4:
            msg = (
                f"cannot fit {self.modes} modes, {self.relaxations} relaxations, {self.n_lines} lines from {self.starts} "
                "starts: take at least 1 mode, 0 relaxations, 4 lines and 1 start"
            )
            raise ParameterError(msg)
        if not all(0.0 <= ridge < inf for ridge in (self.ridge, self.relaxation_ridge)):
            msg = (
                f"the ridge is {self.ridge:g}, {self.relaxation_ridge:g} for relaxation: take a finite one of 0 or more"
            )
            raise ParameterError(msg)
        if self.seed < 0:
            msg = f"the seed is {self.seed}: it must not be negative"
            raise ParameterError(msg)
        for name in ("tau", "exponents"):
            values = getattr(self, name)
            if values is not None and len(values) != self.relaxations:
                msg = f"need one of {name} per relaxation: {len(values)} != {self.relaxations}"
                raise ParameterError(msg)
        if not all(0.0 < t < inf for t in self.tau or ()) or not all(0.0 < c <= 1.0 for c in self.exponents or ()):
            msg = f"kernels need times above 0 s and exponents in (0, 1], not {self.tau} and {self.exponents}"
            raise ParameterError(msg)
        if not 0.0 < self.least_spring < 1.0:
            msg = f"the least slope is {self.least_spring:g} of the output's range: take one between 0 and 1"
            raise ParameterError(msg)
        if self.density == "hats" and not 2 <= self.n_knots < self.n_lines:
            msg = f"cannot lay {self.n_knots} knots over {self.n_lines} lines: take 2 or more and fewer than lines"
            raise ParameterError(msg)

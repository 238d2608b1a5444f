r"""Terms of the relaxation of a sensor, what excites them, and the named sets of excitations that a fit may choose.

Symbols: ``s`` normalised strain [1]; a mode is driven at the rate :math:`a s^d |\dot s|`, d = 0 or 1, while strain rises,
as in Eq. (4.13) and Section 4.2 of the thesis, or while it falls, and decays as :math:`e^{-b t^c}`, Eq. (4.12). A gain is a
mode that is multiplied by the present strain.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Vector
from ..errors import require

DIRECTIONS = {"rising": 1.0, "falling": -1.0}
# of a sensor whose output may move against the strain: no exact inverse, so one fit of each kind of operator
DIRECT = {
    "invertible": False,
    "eta": (1.0, 1.0),
    "fit_kernels": False,
    "density_ridge": 3e-3,
    "relaxation_ridge": 3e-3,
    "starts": 1,
    "forgetting": 0.1,
}
OF_EITHER_SIGN = {**DIRECT, "signed": True, "knots": 6, "smoothness": 5e-5, "density_ridge": 5e-5, "relaxation_ridge": 5e-5}


@dataclass(frozen=True, slots=True)
class Drive:
    """One way in which strain excites modes.

    Attributes
    ----------
    strain : {"rising", "falling"}
        The strain that excites.
    power : {0, 1}
        :math:`d` [1]: the drive of a mode is then a polynomial in time for strain linear over a step, so a step is exact.
    gain : bool
        Whether the modes are multiplied by the present strain.
    """

    strain: str = "rising"
    power: int = 0
    gain: bool = False

    def __post_init__(self) -> None:
        known = ", ".join(DIRECTIONS)
        require(self.strain in DIRECTIONS, f"a relaxation term is driven by {self.strain!r} strain; choose one of {known}")
        require(
            self.power in (0, 1),
            f"a relaxation power is {self.power!r}; 0 and 1 are supported. Identify it with one of them.",
        )

    @property
    def symbol(self) -> str:
        """Name of its amplitudes in a fit: ``g``, ``k``, ``g_falling``, ``gain``."""
        return ("gain" if self.gain else "gk"[self.power]) + ("_falling" if self.strain == "falling" else "")

    @property
    def sign(self) -> float:
        """Sign of the change of strain that excites."""
        return DIRECTIONS[self.strain]

    def sizes(self, change: Vector) -> Vector:
        """Return the sizes of the excitation by changes of strain [1]."""
        return np.maximum(self.sign * change, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class RelaxationTerm:
    r"""One term :math:`A(\zeta) e^{-b t^c}`, :math:`A = a \zeta^d`, of the dynamic operators.

    Attributes
    ----------
    amplitude : float
        :math:`a` [1], not negative.
    power : int
        :math:`d` [1], 0 or 1, see ``Drive``.
    rate : float
        :math:`b` [s**-c], positive.
    exponent : float
        :math:`c` [1], 0 < c <= 1.
    decay_rates : tuple of float, length n
        Rates [1/s] of the exponentials whose sum is :math:`e^{-b t^c}`, positive.
    weights : tuple of float, length n
        Their weights [1], positive; the sum is close to 1.
    drive : {"rising", "falling"}
        The strain that excites the term: rising, as in the thesis, or falling (extension).
    signed : bool
        Whether the amplitude may be negative (extension). The output may then move against the strain, which the exact
        inverse cannot undo; such a sensor needs a direct inverse.
    gain : bool
        Whether the term is multiplied by the present strain (extension): loading then changes the gauge factor, not the
        resistance itself. Such a sensor needs a direct inverse too.
    """

    amplitude: float
    power: int
    rate: float
    exponent: float
    decay_rates: tuple[float, ...]
    weights: tuple[float, ...]
    drive: str = "rising"
    signed: bool = False
    gain: bool = False

    def __post_init__(self) -> None:
        numbers = (self.amplitude, self.rate, self.exponent, *self.decay_rates, *self.weights)
        require(np.isfinite(numbers).all(), "a relaxation term holds a number that is not finite. Identify it again.")
        _ = self.excitation  # refuses an unknown drive or power
        require(
            self.amplitude >= 0.0 or self.signed,
            f"a relaxation amplitude is {self.amplitude:g}; it must not be negative: the inverse needs a rising output",
        )
        require(
            self.rate > 0.0 and 0.0 < self.exponent <= 1.0,
            f"relaxation exp(-b t**c) needs b > 0 and 0 < c <= 1, not b = {self.rate:g}, c = {self.exponent:g}",
        )
        require(
            0 < len(self.decay_rates) == len(self.weights),
            f"need one weight per decay rate: {len(self.weights)} != {len(self.decay_rates)}, and at least one",
        )
        require(
            min(self.decay_rates) > 0.0 and min(self.weights) >= 0.0,
            "decay rates must be positive and their weights not negative. Fit the exponentials again.",
        )

    @property
    def excitation(self) -> Drive:
        """What excites the term."""
        return Drive(self.drive, self.power, self.gain)


class Extension(NamedTuple):
    """A named set of drives, and how a fit has to be set for it.

    Attributes
    ----------
    drives : tuple of Drive
        What excites the relaxation.
    text : str
        What it adds, for the help of the command.
    settings : mapping of str to object
        Fields of ``PreisachSettings`` that differ from their defaults.
    """

    drives: tuple[Drive, ...]
    text: str
    settings: Mapping[str, Any] = MappingProxyType({})


THESIS = (Drive(), Drive(power=1))
FALLING = (Drive("falling"), Drive("falling", power=1))
GAIN = Drive(gain=True)


EXTENSIONS = {
    "none": Extension(THESIS, "the thesis' relaxation"),
    "falling": Extension((*THESIS, *FALLING), "falling strain excites relaxation too"),
    "gain": Extension((*THESIS, GAIN), "loading changes the gauge factor", DIRECT),
    "reversing": Extension((*THESIS, *FALLING, GAIN), "both, with either sign: carbon black", OF_EITHER_SIGN),
}

r"""Excitation of the relaxation of a sensor, and the named sets of excitations that a fit may choose.

Symbols: ``s`` normalised strain [1]; a mode is driven at the rate :math:`a s^d |\dot s|`, d = 0 or 1, while strain rises,
as in Eq. (4.13) and Section 4.2 of the thesis, or while it falls. A gain is a mode that is multiplied by the present
strain.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Vector
from ..errors import ParameterError

DIRECTIONS = {"rising": 1.0, "falling": -1.0}


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
        if self.strain not in DIRECTIONS:
            msg = f"a relaxation term is driven by {self.strain!r} strain; choose one of {', '.join(DIRECTIONS)}"
            raise ParameterError(msg)
        if self.power not in (0, 1):
            msg = f"a relaxation power is {self.power!r}; 0 and 1 are supported. Identify it with one of them."
            raise ParameterError(msg)

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

# of a sensor whose output may move against the strain: no exact inverse, so one fit of each kind of operator
DIRECT = {
    "invertible": False,
    "eta": (1.0, 1.0),
    "fit_kernels": False,
    "density_ridge": 3e-3,
    "relaxation_ridge": 3e-3,
    "starts": 1,
}
OF_EITHER_SIGN = {
    **DIRECT,
    "signed": True,
    "knots": 6,
    "smoothness": 5e-5,
    "density_ridge": 5e-5,
    "relaxation_ridge": 5e-5,
}

EXTENSIONS = {
    "none": Extension(THESIS, "the thesis' relaxation"),
    "falling": Extension((*THESIS, *FALLING), "falling strain excites relaxation too"),
    "gain": Extension((*THESIS, GAIN), "loading changes the gauge factor", DIRECT),
    "reversing": Extension((*THESIS, *FALLING, GAIN), "both, with either sign: carbon black", OF_EITHER_SIGN),
}

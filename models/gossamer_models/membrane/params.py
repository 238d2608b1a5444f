"""What a membrane is made of, how it is mounted and what shakes it.

Symbols: ``p`` the parameters as one vector, in the order of ``MembraneParams``.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, fields

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gossamer_models.errors import ParameterError

N_PARAMETERS = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class MembraneParams:
    """Parameters of a square membrane; the defaults are the thesis' membrane with the damping this project states.

    Attributes
    ----------
    side_length : float
        Unstretched side [m].
    thickness : float
        Unstretched thickness [m].
    youngs_modulus, poisson_ratio : float
        Elasticity of the undamaged material [Pa], [1].
    density : float
        Unstretched density [kg/m3].
    edge_displacement : float
        How far every edge is moved outward and then held [m].
    mass_damping : float
        Damping force per mass and velocity relative to the base [1/s]. The default, 8 % of critical at the first
        frequency, is a choice: the thesis states none, but without any the response depends on step and mesh after 0.1 s
        (it is weakly chaotic), so that no two programs, and no damaged and healthy run, can be compared.
    pressure_amplitude, pressure_frequency, pressure_phase : float
        Built-in follower pressure, amplitude * sin(2 pi frequency t + phase) [Pa], [Hz], [rad].
    """

    side_length: float = 0.588
    thickness: float = 0.001
    youngs_modulus: float = 1e7
    poisson_ratio: float = 0.33
    density: float = 1100.0
    edge_displacement: float = 0.006
    mass_damping: float = 20.0
    pressure_amplitude: float = 1e4
    pressure_frequency: float = 7.9
    pressure_phase: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not math.isfinite(value):
                msg = f"membrane parameter {field.name!r} is {value!r}; it must be a finite number"
                raise ParameterError(msg)
        for name in ("side_length", "thickness", "youngs_modulus", "density"):
            if getattr(self, name) <= 0.0:
                msg = f"membrane parameter {name!r} is {getattr(self, name):g}; it must be positive"
                raise ParameterError(msg)
        if not -1.0 < self.poisson_ratio < 1.0:
            msg = f"poisson_ratio is {self.poisson_ratio:g}; plane stress needs more than -1 and less than 1"
            raise ParameterError(msg)

    def vector(self) -> NDArray[np.float64]:
        """Return all values in the order of the attributes, shape (10,)."""
        return np.array(astuple(self), dtype=np.float64)

    @property
    def stretch(self) -> float:
        """Stretch [1] of the undamaged, unloaded membrane in every direction of its plane."""
        return 1.0 + 2.0 * self.edge_displacement / self.side_length

    def pressure(self, time: float) -> float:
        """Evaluate the built-in pressure [Pa] at a time [s]."""
        return self.pressure_amplitude * math.sin(math.tau * self.pressure_frequency * time + self.pressure_phase)


def named(p: ca.MX) -> dict[str, ca.MX]:
    """Split a symbolic parameter vector, shape (10,), by attribute name."""
    return {field.name: p[i] for i, field in enumerate(fields(MembraneParams))}

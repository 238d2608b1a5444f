"""What a membrane is made of, how it is mounted and what shakes it: one table.

A parameter is added by one line of ``MembraneParams``. Models take it by its name, ``p.density``.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, field, fields
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..arrays import Vector
from ..errors import ParameterError
from ..variables import parameter


def _row(start: float, unit: str, description: str, minimum: float, maximum: float) -> Any:  # noqa: ANN401
    """Make a field that holds one row of the table."""
    row = {"start": start, "unit": unit, "description": description, "minimum": minimum, "maximum": maximum}
    return field(default=start, metadata=row)


@dataclass(frozen=True, slots=True, kw_only=True)
class MembraneParams:
    """Parameters of a square membrane; the defaults are those of Section 7.3 of the thesis and a mass damping.

    Each field is a row: default, unit, description, smallest and largest value.

    Raises
    ------
    ParameterError
        A value is not finite or out of its range.

    Notes
    -----
    The default of ``mass_damping``, 8 % of critical at the first frequency, is a choice: the thesis states none, but without
    any the response depends on step and mesh after 0.1 s (it is weakly chaotic), so that no two programs, and no damaged and
    healthy run, can be compared. The built-in pressure is amplitude * sin(2 pi frequency t + phase).
    """

    side_length: float = _row(0.588, "m", "Side of the unstretched square", 1e-3, 1e3)
    thickness: float = _row(0.001, "m", "Unstretched thickness", 1e-7, 1.0)
    youngs_modulus: float = _row(1e7, "Pa", "Young's modulus of the undamaged material", 1.0, 1e13)
    poisson_ratio: float = _row(0.33, "1", "Poisson's ratio", -0.9, 0.499)
    density: float = _row(1100.0, "kg/m3", "Density of the unstretched material", 1e-3, 1e5)
    edge_displacement: float = _row(0.006, "m", "Outward displacement of every edge before it is held", 0.0, 1e3)
    mass_damping: float = _row(20.0, "1/s", "Damping force per mass and velocity relative to the base", 0.0, 1e4)
    pressure_amplitude: float = _row(1e4, "Pa", "Amplitude of the built-in follower pressure", 0.0, 1e6)
    pressure_frequency: float = _row(7.9, "Hz", "Frequency of the built-in follower pressure", 0.0, 1e4)
    pressure_phase: float = _row(0.0, "rad", "Phase of the built-in follower pressure when the run begins", -1e3, 1e3)

    def __post_init__(self) -> None:
        for row in fields(self):
            value, low, high = getattr(self, row.name), row.metadata["minimum"], row.metadata["maximum"]
            if not low <= value <= high:
                msg = f"membrane parameter {row.name!r} is {value:g}; it must be a number from {low:g} to {high:g}"
                raise ParameterError(msg)

    def vector(self) -> Vector:
        """Return all values in the order of the table, shape (n,)."""
        return np.array(astuple(self), dtype=np.float64)

    def pressure(self, time: float) -> float:
        """Evaluate the built-in pressure [Pa] at a time [s]."""
        return self.pressure_amplitude * math.sin(math.tau * self.pressure_frequency * time + self.pressure_phase)


PARAMETERS = tuple(parameter(row.name, **row.metadata) for row in fields(MembraneParams))


def stretch(p: MembraneParams | SimpleNamespace) -> Any:  # noqa: ANN401
    """Return the stretch [1] of the undamaged, unloaded membrane in its plane, Section 7.2 of the thesis."""
    return 1.0 + 2.0 * p.edge_displacement / p.side_length

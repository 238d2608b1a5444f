r"""Strain of a material line along y, which the sensors read.

Symbols: ``x`` node positions in units of two element sizes [1], ``F`` deformation gradient [1]; its second column
:math:`\partial x/\partial Y` is what a unit line along y has become. The points are those of
Section 7.5 of the thesis, where the normal strain along y is measured.
"""

from __future__ import annotations

import casadi as ca

from .element import MODES, modes
from .mesh import SquareMesh, dofs

# fractions of the side along x and y; (0.2, 0.2), (0.4, 0.2), (0.2, 0.4), (0.4, 0.4) m of the prestressed 0.6 m square
SENSOR_POINTS = ((1 / 3, 1 / 3), (2 / 3, 1 / 3), (1 / 3, 2 / 3), (2 / 3, 2 / 3))


def deformation_gradient_expression(mesh: SquareMesh, x: ca.MX, point: tuple[float, float]) -> ca.MX:
    """Write the deformation gradient [1], shape (3, 2), at a material point given by fractions of the side."""
    element, (s, t) = mesh.locate(point)
    _, dH = modes(s, t)
    return ca.reshape(x[dofs(mesh.elements[element]).tolist()], 3, 4) @ ca.DM(MODES @ dH)


def sensor_strains_expression(mesh: SquareMesh, x: ca.MX) -> ca.MX:
    r"""Write the nominal strains :math:`|\partial x/\partial Y| - 1` [1] that strain gauges along y read, shape (4,)."""
    lines = [deformation_gradient_expression(mesh, x, point)[:, 1] for point in SENSOR_POINTS]
    return ca.vertcat(*(ca.sqrt(ca.dot(line, line)) for line in lines)) - 1.0

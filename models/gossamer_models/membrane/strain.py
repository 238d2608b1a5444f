r"""Strain of a material line along y, which the sensors read.

Symbol: ``g`` the vector :math:`\partial x/\partial Y` [1] that a unit line along y has become.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from .element import shape_functions
from .equations import MembraneEquations

# fractions of the side along x and y; (0.2, 0.2), (0.4, 0.2), (0.2, 0.4), (0.4, 0.4) m of the prestressed 0.6 m square
SENSOR_POINTS = ((1 / 3, 1 / 3), (2 / 3, 1 / 3), (1 / 3, 2 / 3), (2 / 3, 2 / 3))


def deformation_gradient_expression(
    equations: MembraneEquations, q: ca.MX, p: ca.MX, point: tuple[float, float]
) -> ca.MX:
    """Write the deformation gradient [1], shape (3, 2), at a material point given by fractions of the side."""
    mesh = equations.mesh
    element, (s, t) = mesh.locate(point)
    dofs = (3 * mesh.elements[element][:, None] + np.arange(3)).reshape(-1)
    x = ca.reshape(equations.positions(q, p)[dofs.tolist()], 3, 4)
    gradient = shape_functions(s, t)[1] * 4.0  # an element is half a length unit, its parent square two
    return x @ ca.DM(gradient)


def nominal_strain_expression(equations: MembraneEquations, q: ca.MX, p: ca.MX, point: tuple[float, float]) -> ca.MX:
    r"""Write the nominal strain :math:`|\partial x/\partial Y| - 1` [1] of a line along y: what a strain gauge reads."""
    g = deformation_gradient_expression(equations, q, p, point)[:, 1]
    return ca.sqrt(ca.dot(g, g)) - 1.0

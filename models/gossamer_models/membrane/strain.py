r"""Strain of a material line along y, which the sensors read.

Symbols: ``q`` displacements [m] of the interior nodes from the homogeneous stretch; ``x`` node positions in units of the
size of an element [1], ``F`` deformation gradient [1]; its second column :math:`\partial x/\partial Y` is what a unit line
along y has become. The points are those of Section 7.5 of the thesis, where the normal strain along y is measured.
"""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca

from .mesh import SquareMesh
from .params import stretch

# fractions of the side along x and y; (0.2, 0.2), (0.4, 0.2), (0.2, 0.4), (0.4, 0.4) m of the prestressed 0.6 m square
SENSOR_POINTS = ((1 / 3, 1 / 3), (2 / 3, 1 / 3), (1 / 3, 2 / 3), (2 / 3, 2 / 3))


def deformation_gradient_expression(mesh: SquareMesh, x: ca.MX, point: tuple[float, float]) -> ca.MX:
    """Write the deformation gradient [1], shape (3, 2), at a material point given by fractions of the side."""
    slopes = ca.vertcat(*(mesh.interpolation([point], axis) for axis in "xy"))
    return ca.mtimes(ca.reshape(x, 3, -1), slopes.T)


def sensor_strains_expression(mesh: SquareMesh, q: ca.MX, p: SimpleNamespace) -> ca.MX:
    r"""Write the nominal strains :math:`|\partial x/\partial Y| - 1` [1] that strain gauges along y read, shape (4,)."""
    slopes = mesh.interpolation(SENSOR_POINTS, "y")[:, mesh.interior.tolist()] * mesh.elements_per_side
    lines = ca.mtimes(ca.reshape(q, 3, -1), slopes.T) / p.side_length
    lines[1, :] += stretch(p)
    return ca.sqrt(ca.sum1(lines**2)).T - 1.0

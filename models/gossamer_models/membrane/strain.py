r"""Strain of a material line along y, in three measures.

Symbols: ``g`` the vector :math:`\partial x/\partial Y` [1] that a unit line along y has become, ``F`` deformation gradient.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .element import shape_functions
from .equations import MembraneEquations
from .params import N_PARAMETERS, MembraneParams

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


def deformation_gradients(
    equations: MembraneEquations,
    params: MembraneParams,
    q: NDArray[np.float64],
    point: tuple[float, float],
) -> NDArray[np.float64]:
    """Evaluate the deformation gradient [1] at a material point for many displacements.

    Parameters
    ----------
    equations : MembraneEquations
        The mesh.
    params : MembraneParams
        The membrane.
    q : ndarray, shape (n, n_q)
        Displacements [m] of the interior nodes from the homogeneous stretch.
    point : tuple of float
        Fractions [1] of the side along x and y.

    Returns
    -------
    ndarray, shape (n, 3, 2)
    """
    x, p = ca.MX.sym("q", equations.n_q), ca.MX.sym("p", N_PARAMETERS)
    F = ca.Function("F", [x, p], [ca.vec(deformation_gradient_expression(equations, x, p, point))])
    columns = np.asarray(F(q.T, params.vector()))
    return np.ascontiguousarray(columns.T.reshape(-1, 2, 3).swapaxes(1, 2))


def nominal_strain(F: NDArray[np.float64]) -> NDArray[np.float64]:
    """Evaluate the nominal strain [1] of a line along y from deformation gradients, shape (..., 3, 2)."""
    return np.asarray(np.linalg.norm(F[..., 1], axis=-1) - 1.0)


def green_lagrange_strain(F: NDArray[np.float64]) -> NDArray[np.float64]:
    """Evaluate the Green-Lagrange strain [1], component yy of (F^T F - 1)/2, shape (..., 3, 2) -> (...)."""
    return np.asarray(((F[..., 1] ** 2).sum(axis=-1) - 1.0) / 2.0)


def logarithmic_strain(F: NDArray[np.float64]) -> NDArray[np.float64]:
    """Evaluate the logarithmic (Hencky) strain [1], component yy of ln(F^T F)/2, shape (..., 3, 2) -> (...)."""
    values, vectors = np.linalg.eigh(np.swapaxes(F, -1, -2) @ F)
    return np.asarray((np.log(values) / 2.0 * vectors[..., 1, :] ** 2).sum(axis=-1))

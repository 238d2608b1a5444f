"""Strain of a material line along y from deformation gradients, in three measures.

Symbols: ``F`` deformation gradient, shape (3, 2) for each state.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from gossamer_models.membrane import MembraneEquations, MembraneParams
from gossamer_models.membrane.params import PARAMETERS
from gossamer_models.membrane.strain import deformation_gradient_expression
from gossamer_models.variables import by_name
from numpy.typing import NDArray


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
    motion, p = ca.MX.sym("q", equations.n_q), ca.MX.sym("p", len(PARAMETERS))
    x = equations.positions(motion, by_name(PARAMETERS, p))
    F = ca.Function("F", [motion, p], [ca.vec(deformation_gradient_expression(equations.mesh, x, point))])
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

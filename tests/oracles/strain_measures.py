"""Strain of a material line along y from deformation gradients, in three measures.

Symbols: ``F`` deformation gradient, shape (3, 2) for each state.
"""

from __future__ import annotations

import numpy as np
from gossamer_models.membrane.gauges import gauge
from numpy.typing import NDArray


def deformation_gradients(equations, q, point):
    """Evaluate the deformation gradient [1], shape (n, 3, 2), at fractions [1] of the side, for n displacements [m]."""
    mesh = equations.structure.mesh
    at = mesh.size * np.array([*point, 0.0])
    lines = np.concatenate([gauge(mesh, at, axis, 0.0).lines.toarray() for axis in np.eye(3)[:2]])
    return np.stack([(lines @ equations.places(each)).T for each in q])


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

r"""The largest step that explicit integration may take.

Symbols: ``a`` element size [m], ``c`` wave speed [m/s], both in the unstretched membrane; ``K``, ``M`` stiffness and mass of
a line of elements in units of element size and wave speed.
"""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import casadi as ca
import numpy as np

from .mesh import SquareMesh
from .quadrature import derivative_matrix, lobatto_points

STEP_FRACTION = {"bilinear": 0.42, "spectral": 0.6}  # of the stable step
STEPS_PER_CYCLE = 20.0  # of the built-in pressure, at least


def max_step_expression(mesh: SquareMesh, wave: ca.MX, p: SimpleNamespace) -> ca.MX:
    r"""Write the largest internal step [s] from the largest :math:`\rho c^2` [Pa] of the stretched membrane.

    Notes
    -----
    The highest frequency of waves along one side, on an unbounded mesh, is :math:`\omega_1 = 2c/(\kappa a)`, with
    :math:`\kappa` = 1 for bilinear elements with lumped mass and 2 x 2 integration, which have no higher one. On spectral
    elements, motion along x that varies along both sides is the stiffest:
    :math:`\omega_{max}^2 = \omega_1^2 (1 + \tfrac{1-\nu}2)`, stretch and shear. The stable step is
    :math:`2/\omega_{max}`, with the largest :math:`c` of any point.

    For bilinear elements :math:`a/c` was 0.73 to 0.99 of the true limit, from the highest eigenvalue of the assembled mesh,
    and never above it: 4, 8 and 16 elements per side, static states up to 100 kPa and 0.5 m deflection, damage up to 95 %,
    and the states of undamped and damped runs of 0.18 s. ``STEP_FRACTION`` is therefore a margin for the change of :math:`c`
    within a step, and for accuracy. Where the built-in pressure is fast, its cycle limits the step.
    """
    size = p.side_length / mesh.elements_per_side
    kappa = 2.0 / np.sqrt(_largest_eigenvalue(mesh.order))
    if mesh.order == 1:
        stable = STEP_FRACTION["bilinear"] * kappa * size
    else:
        stable = STEP_FRACTION["spectral"] * kappa * size / ca.sqrt(1.0 + (1.0 - p.poisson_ratio) / 2.0)
    cycle = 1.0 / ca.fmax(p.pressure_frequency, 1e-300)
    return ca.fmin(stable * ca.sqrt(p.density / wave), cycle / STEPS_PER_CYCLE)


@cache
def _largest_eigenvalue(order: int) -> float:
    """Return the largest eigenvalue of K - lambda M on a periodic line of two elements."""
    nodes, weights = lobatto_points(order + 1)
    slope = derivative_matrix(nodes, nodes)
    places = [np.arange(order + 1), np.arange(order, 2 * order + 1) % (2 * order)]
    K, M = np.zeros((2 * order, 2 * order)), np.zeros(2 * order)
    for place in places:
        K[np.ix_(place, place)] += slope.T @ np.diag(weights) @ slope
        M[place] += weights
    return float(np.linalg.eigvalsh(K / np.sqrt(np.outer(M, M)))[-1])

r"""An alternative to spectral elements: bilinear ones whose errors of second order are taken out.

Gauss points at :math:`\pm\sqrt{2/3}` in place of :math:`\pm\sqrt{1/3}`, and one pass from the lumped mass m towards the
consistent mass M: :math:`a = (I + (I - M/m)/2)\,f/m`. Both cancel the dispersion of second order: with
:math:`k h` the phase along an element, stiffness is :math:`k^2 (1 - k^2 h^2/12)` and the inverse mass
:math:`1 + k^2 h^2/12`.

Symbols: ``q`` displacements [m], ``v`` velocities [m/s], ``f`` forces [N], ``m`` lumped masses [kg], ``M`` consistent mass
matrix [kg], ``c`` mass damping [1/s], ``h`` step [s].
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
from gossamer_models.membrane import MembraneParams, Structure, membrane_model, square_structure
from gossamer_models.membrane.element import derivative_matrix, value_matrix
from numpy.typing import NDArray

from .square import SquareEquations

Vector = NDArray[np.float64]

SIDES, POINTS = np.array([-0.5, 0.5]), np.sqrt(2.0 / 3.0) * np.array([-0.5, 0.5])
LARGEST_STEP = 1.5e-4  # [s] on 8 elements per side


def corrected_bilinear(n: int, damage: Vector, steps: int, h: float, finer: int = 1) -> Vector:
    """Integrate the default membrane from rest by the explicit step of ``membrane_model``.

    Parameters
    ----------
    n : int
        Elements per side.
    damage : ndarray, shape (cases, 16)
        Lost fraction [1] of each zone's modulus.
    steps : int
        Number of communication steps.
    h : float
        Communication step [s].
    finer : int
        Divide every step into as many.

    Returns
    -------
    ndarray, shape (cases, 4, steps)
        Change of the strains [1] of the sensors since the start.
    """
    structure, params = corrected_structure(n), MembraneParams()
    equations, model, p, c = SquareEquations(structure), membrane_model(structure), params.vector(), params.mass_damping
    m, M = (
        equations.node_mass(params),
        SquareEquations(square_structure(n, 1)).consistent_mass(params),
    )  # of the exact rule
    parts = finer * int(np.ceil(h / finer / (LARGEST_STEP * 8 / n) - 1e-9))
    part = h / parts
    results = np.empty((len(damage), 4, steps))
    for case, lost in enumerate(damage):
        start, _ = model.init(ca.vertcat(0.0, 0.0, lost), p)
        q, v = np.asarray(start).ravel()[: equations.n_q], np.zeros(equations.n_q)
        before = equations.strain(q)
        for k in range(steps * parts):
            q = q + part / 2.0 * v
            f = np.asarray(equations.force(q, lost, params.pressure((k + 0.5) * part), p)).ravel()
            a = 1.5 * f / m - M @ (f / m) / (2.0 * m)
            v = ((1.0 - c * part / 2.0) * v + part * a) / (1.0 + c * part / 2.0)
            q = q + part / 2.0 * v
            if (k + 1) % parts == 0:
                results[case, :, k // parts] = equations.strain(q) - before
    return results


def corrected_structure(n: int) -> Structure:
    """Make a square of bilinear elements with other quadrature points."""
    structure = square_structure(n, 1)
    (block,) = structure.elements
    value, slope = value_matrix(SIDES, POINTS), derivative_matrix(SIDES, POINTS)
    element = replace(
        block.element,
        N=(ca.DM(np.kron(value, value)),),
        D_s=(ca.DM(np.kron(value, slope)),),
        D_t=(ca.DM(np.kron(slope, value)),),
    )
    return replace(structure, elements=(replace(block, element=element),))

r"""The bilinear membrane element: the one place where its forces are written.

Symbols: ``X`` reference and ``x`` current node positions, ``s``, ``t`` parent coordinates [1], ``H`` the four bilinear modes
1, s, t, st at the nodes, ``J`` Jacobian of the reference map, ``F`` deformation gradient (3 x 2), ``e`` Green-Lagrange
strain, ``S`` second Piola-Kirchhoff stress [Pa], ``f`` nodal forces, ``E`` Young's modulus [Pa], ``nu`` Poisson's ratio [1].
Lengths are in any one unit in which the element is of order one; forces are per thickness. Explicit steps, statics, implicit
steps and frequencies all evaluate these expressions or their ``ca.jacobian``.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
GAUSS = 1.0 / np.sqrt(3.0)

_H = np.column_stack([np.ones(4), CORNERS, CORNERS.prod(axis=1)])

# keeps the derivative of the larger principal stretch finite where both are equal; 1e-12 relative to a stretch
_TINY = 1e-24


@dataclass(frozen=True, eq=False)
class GaussPoint:
    """What a Gauss point knows of the reference element.

    Attributes
    ----------
    s, t : float
        Signs [1] of its parent coordinates, which are this times ``GAUSS``.
    J_inverse : ndarray, shape (2, 2)
        Derivative of parent by reference coordinates [1/length].
    dA : float
        Reference area [length^2] it stands for: the determinant of ``J``, as the weights of the 2 x 2 rule are 1.
    """

    s: float
    t: float
    J_inverse: NDArray[np.float64]
    dA: float


def shape_functions(s: float, t: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Evaluate the bilinear shape functions and their parent gradients, shapes (4,) and (4, 2)."""
    a, b = 1.0 + CORNERS[:, 0] * s, 1.0 + CORNERS[:, 1] * t
    return a * b / 4.0, np.column_stack([CORNERS[:, 0] * b, CORNERS[:, 1] * a]) / 4.0


def gauss_points(X: NDArray[np.float64]) -> list[GaussPoint]:
    """Describe the 2 x 2 Gauss points of an element with reference node positions ``X``, shape (4, 2) [length]."""
    points = []
    for s, t in CORNERS:
        J = X.T @ shape_functions(s * GAUSS, t * GAUSS)[1]
        J = np.round(J, 14)  # zeros and ones in place of round-off: CasADi leaves out multiplications by them
        points.append(GaussPoint(float(s), float(t), np.asarray(np.linalg.inv(J)), float(np.linalg.det(J))))
    return points


def element_force(
    x: ca.SX, points: list[GaussPoint], modulus: ca.SX, poisson_ratio: ca.SX, pressure_over_thickness: ca.SX
) -> tuple[ca.SX, ca.SX]:
    r"""Write the force of pressure and stress on the nodes of one element.

    Parameters
    ----------
    x : casadi.SX, shape (3, 4)
        Current node positions [length].
    points : list of GaussPoint
        Gauss points.
    modulus, poisson_ratio : casadi.SX, scalar
        Young's modulus [Pa] and Poisson's ratio [1].
    pressure_over_thickness : casadi.SX, scalar
        Pressure over thickness [Pa/length], positive along :math:`x_{,s} \times x_{,t}`.

    Returns
    -------
    casadi.SX, shape (3, 4)
        Force per thickness [Pa length] on each node: pressure minus internal force.
    casadi.SX, scalar
        Largest :math:`\rho c^2` [Pa] of a plane wave along the larger principal stretch, over the points.

    Notes
    -----
    With :math:`F = \sum_a x_a \otimes \nabla N_a`, :math:`e = (F^T F - 1)/2` and St Venant-Kirchhoff's law in plane stress,
    :math:`S = E/(1-\nu^2)\,[(1-\nu)\,e + \nu\,\mathrm{tr}(e)\,1]`, the force on node :math:`a` is

    .. math:: f_a = \int N_a\,p\; x_{,s} \times x_{,t}\,\mathrm{d}s\,\mathrm{d}t - \int F S\,\nabla N_a\,\mathrm{d}A,

    the total Lagrangian form of [1]_ with the consistent follower load of [2]_, both by the 2 x 2 Gauss rule (exact for the
    load of a plane element). Positions and forces are split into the four modes 1, s, t, st, since
    :math:`N_a = \tfrac14 (1 + s_a s)(1 + t_a t)`; this halves the operations. Compression is carried: no wrinkling.

    A longitudinal wave along the principal stretch :math:`\lambda` has :math:`\rho_0 c_0^2 = \lambda^2 E/(1-\nu^2) + S`,
    :math:`c_0` in reference lengths; a transverse one has :math:`S` alone.

    References
    ----------
    .. [1] T. Belytschko, W. K. Liu, B. Moran, K. Elkhodary, Nonlinear Finite Elements for Continua and Structures,
       2nd ed., Wiley, 2014, Section 4.9.
    .. [2] K. Schweizerhof, E. Ramm, Computers & Structures 18(6), 1099-1114, 1984, doi:10.1016/0045-7949(84)90154-8.
    """
    nu, D = poisson_ratio, modulus / (1.0 - poisson_ratio**2)
    a = x @ ca.DM(_H)
    load, load_s, load_t, load_st, Q_1, Q_2, Q_12 = (ca.SX.zeros(3) for _ in range(7))
    wave = ca.SX(0.0)
    for point in points:
        s, t = point.s, point.t
        x_s, x_t, F1, F2 = _tangents(a, point)
        c11, c22, c12 = _twice_strain(F1, F2)
        S11, S22, S12 = _stress(c11, c22, c12, point.dA * D, nu)
        Q = ca.horzcat(F1 * S11 + F2 * S12, F1 * S12 + F2 * S22) @ ca.DM(point.J_inverse.T / 4.0)
        Q_1, Q_2, Q_12 = Q_1 + Q[:, 0], Q_2 + Q[:, 1], Q_12 + t * Q[:, 0] + s * Q[:, 1]
        n = ca.cross(x_s, x_t)
        load, load_s, load_t, load_st = load + n, load_s + s * n, load_t + t * n, load_st + s * t * n
        wave = ca.fmax(wave, _wave_number(c11, c22, c12, nu))
    p = pressure_over_thickness / 64.0
    modes = p * load, p * GAUSS * load_s - Q_1, p * GAUSS * load_t - Q_2, GAUSS * (p * GAUSS * load_st - Q_12)
    return ca.horzcat(*modes) @ ca.DM(_H.T), D * (1.0 + wave)


def element_energy(x: ca.SX, points: list[GaussPoint], modulus: ca.SX, poisson_ratio: ca.SX) -> ca.SX:
    """Write the strain energy per thickness [Pa length^2] of one element; its gradient is the internal force.

    Parameters are those of ``element_force``.
    """
    nu, D = poisson_ratio, modulus / (1.0 - poisson_ratio**2)
    a = x @ ca.DM(_H)
    energy = ca.SX(0.0)
    for point in points:
        _, _, F1, F2 = _tangents(a, point)
        c11, c22, c12 = _twice_strain(F1, F2)
        S11, S22, S12 = _stress(c11, c22, c12, D, nu)
        energy += point.dA * (S11 * c11 + S22 * c22 + 2.0 * S12 * c12) / 4.0
    return energy


def _tangents(a: ca.SX, point: GaussPoint) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return 4 x_,s and 4 x_,t, then the columns of F, from four times the modes of the position."""
    twist = GAUSS * a[:, 3]
    x_s, x_t = a[:, 1] + point.t * twist, a[:, 2] + point.s * twist
    F = ca.horzcat(x_s, x_t) @ ca.DM(point.J_inverse / 4.0)
    return x_s, x_t, F[:, 0], F[:, 1]


def _twice_strain(F1: ca.SX, F2: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Components 11, 22, 12 of 2 e = F^T F - 1."""
    return ca.dot(F1, F1) - 1.0, ca.dot(F2, F2) - 1.0, ca.dot(F1, F2)


def _stress(c11: ca.SX, c22: ca.SX, c12: ca.SX, D: ca.SX, nu: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Components 11, 22, 12 of the second Piola-Kirchhoff stress [Pa] from twice the strain."""
    half = D / 2.0
    return half * (c11 + nu * c22), half * (c22 + nu * c11), half * (1.0 - nu) * c12


def _wave_number(c11: ca.SX, c22: ca.SX, c12: ca.SX, nu: ca.SX) -> ca.SX:
    """Evaluate rho c^2 / D - 1 of the longitudinal wave along the larger principal stretch, from twice the strain."""
    total = c11 + c22
    spread = ca.sqrt((c11 - c22) ** 2 + 4.0 * c12**2 + _TINY)
    return (3.0 + nu) / 4.0 * total + (3.0 - nu) / 4.0 * spread

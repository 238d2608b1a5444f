r"""The bilinear membrane element: the one place where its forces are written.

Symbols: ``X`` reference and ``x`` current node positions, ``s``, ``t`` parent coordinates [1], ``H`` the four bilinear modes
1, s, t, st at the nodes, ``J`` Jacobian of the reference map, ``F`` deformation gradient (3 x 2), ``e`` Green-Lagrange
strain, ``S`` second Piola-Kirchhoff stress [Pa], ``f`` nodal forces, ``E`` Young's modulus [Pa], ``nu`` Poisson's ratio [1].
Lengths are in any one unit in which the element is of order one; forces are per thickness. Explicit steps, statics, implicit
steps and frequencies all evaluate these expressions or their ``ca.jacobian``.

Every quantity is a column with an entry per element, and a vector is a list of three columns. So the same lines serve one
element (SX) and, at a fraction of the cost in CasADi's virtual machine, all elements of a mesh at once (MX).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
GAUSS = 1.0 / np.sqrt(3.0)

_MODES = np.column_stack([CORNERS, CORNERS.prod(axis=1)])  # modes s, t, st at the nodes; forces have the fourth one too

Column: TypeAlias = ca.MX  # or ca.SX
Vector: TypeAlias = list[Column]

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
    x: Column, points: list[GaussPoint], modulus: Column, poisson_ratio: Column, pressure_over_thickness: Column
) -> tuple[Column, Column]:
    r"""Write the forces of pressure and stress on the nodes of n elements.

    Parameters
    ----------
    x : casadi.SX or MX, shape (n, 12)
        Current node positions [length], node by node as (x, y, z).
    points : list of GaussPoint
        Gauss points, the same for all elements.
    modulus, poisson_ratio : casadi.SX or MX, shape (n, 1) or scalar
        Young's modulus [Pa] and Poisson's ratio [1].
    pressure_over_thickness : casadi.SX or MX, shape (n, 1) or scalar
        Pressure over thickness [Pa/length], positive along :math:`x_{,s} \times x_{,t}`.

    Returns
    -------
    casadi.SX or MX, shape (n, 12)
        Force per thickness [Pa length] on each node: pressure minus internal force.
    casadi.SX or MX, shape (n, 1)
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
    a = _position_modes(x)
    zero = [0.0, 0.0, 0.0]
    load, load_s, load_t, load_st, Q_1, Q_2, Q_12 = (zero for _ in range(7))
    wave = -1.0
    for point in points:
        s, t = point.s, point.t
        x_s, x_t, F1, F2 = _tangents(a, point)
        c11, c22, c12 = _twice_strain(F1, F2)
        S11, S22, S12 = _stress(c11, c22, c12, point.dA * D, nu)
        P1, P2 = _combine(S11, F1, S12, F2), _combine(S12, F1, S22, F2)
        J = point.J_inverse / 4.0
        Q1, Q2 = _combine(J[0, 0], P1, J[0, 1], P2), _combine(J[1, 0], P1, J[1, 1], P2)
        Q_1, Q_2, Q_12 = _add(Q_1, Q1), _add(Q_2, Q2), _add(Q_12, _combine(t, Q1, s, Q2))
        n = _cross(x_s, x_t)
        load, load_s = _add(load, n), _combine(1.0, load_s, s, n)
        load_t, load_st = _combine(1.0, load_t, t, n), _combine(1.0, load_st, s * t, n)
        wave = ca.fmax(wave, _wave_number(c11, c22, c12, nu))
    p = pressure_over_thickness / 64.0
    f_s, f_t = _combine(p * GAUSS, load_s, -1.0, Q_1), _combine(p * GAUSS, load_t, -1.0, Q_2)
    f_st = _combine(p * GAUSS**2, load_st, -GAUSS, Q_12)
    f = []
    for s, t, st in _MODES:
        f += _add(_combine(p, load, s, f_s), _combine(t, f_t, st, f_st))
    return ca.horzcat(*f), D * (1.0 + wave)


def element_energy(x: Column, points: list[GaussPoint], modulus: Column, poisson_ratio: Column) -> Column:
    """Write the strain energy per thickness [Pa length^2] of each element; its gradient is the internal force.

    Parameters are those of ``element_force``.
    """
    nu, D = poisson_ratio, modulus / (1.0 - poisson_ratio**2)
    a = _position_modes(x)
    energy = 0.0
    for point in points:
        _, _, F1, F2 = _tangents(a, point)
        c11, c22, c12 = _twice_strain(F1, F2)
        S11, S22, S12 = _stress(c11, c22, c12, D, nu)
        energy += point.dA * (S11 * c11 + S22 * c22 + 2.0 * S12 * c12) / 4.0
    return energy


def _position_modes(x: Column) -> list[Vector]:
    """Return four times the modes s, t, st of the position."""
    nodes = ca.horzsplit(x)
    modes = []
    for signs in _MODES.T:
        first, second = (
            _combine(signs[0], nodes[0:3], signs[1], nodes[3:6]),
            _combine(signs[2], nodes[6:9], signs[3], nodes[9:12]),
        )
        modes.append(_add(first, second))
    return modes


def _tangents(a: list[Vector], point: GaussPoint) -> tuple[Vector, Vector, Vector, Vector]:
    """Return 4 x_,s and 4 x_,t, then the columns of F, from four times the modes of the position."""
    x_s, x_t = _combine(1.0, a[0], point.t * GAUSS, a[2]), _combine(1.0, a[1], point.s * GAUSS, a[2])
    J = point.J_inverse / 4.0
    return x_s, x_t, _combine(J[0, 0], x_s, J[1, 0], x_t), _combine(J[0, 1], x_s, J[1, 1], x_t)


def _twice_strain(F1: Vector, F2: Vector) -> tuple[Column, Column, Column]:
    """Components 11, 22, 12 of 2 e = F^T F - 1."""
    return _dot(F1, F1) - 1.0, _dot(F2, F2) - 1.0, _dot(F1, F2)


def _stress(c11: Column, c22: Column, c12: Column, D: Column, nu: Column) -> tuple[Column, Column, Column]:
    """Components 11, 22, 12 of the second Piola-Kirchhoff stress [Pa] from twice the strain."""
    half = D / 2.0
    return half * (c11 + nu * c22), half * (c22 + nu * c11), half * (1.0 - nu) * c12


def _wave_number(c11: Column, c22: Column, c12: Column, nu: Column) -> Column:
    """Evaluate rho c^2 / D - 1 of the longitudinal wave along the larger principal stretch, from twice the strain."""
    total = c11 + c22
    spread = ca.sqrt((c11 - c22) ** 2 + 4.0 * c12**2 + _TINY)
    return (3.0 + nu) / 4.0 * total + (3.0 - nu) / 4.0 * spread


def _combine(a: Column | float, u: Vector, b: Column | float, v: Vector) -> Vector:
    """Return a u + b v; CasADi leaves out factors of zero and one."""
    return [a * u_i + b * v_i for u_i, v_i in zip(u, v, strict=True)]


def _add(u: Vector, v: Vector) -> Vector:
    return _combine(1.0, u, 1.0, v)


def _dot(u: Vector, v: Vector) -> Column:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _cross(u: Vector, v: Vector) -> Vector:
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]

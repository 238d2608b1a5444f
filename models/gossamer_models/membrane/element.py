r"""The bilinear membrane element: the one place where its forces are written.

Symbols: ``X``, ``x`` reference and current node positions, ``N`` bilinear shape functions [1], ``a`` four times the modes
of the positions, ``s``, ``t`` parent coordinates [1], ``H`` the four bilinear modes 1, s, t, st and ``dH`` their parent
derivatives, ``J`` Jacobian of the reference map, ``F`` deformation gradient (3 x 2), ``e`` twice the Green-Lagrange strain,
``S`` second Piola-Kirchhoff stress [Pa], ``f`` nodal forces, ``E`` Young's modulus [Pa], ``nu`` Poisson's ratio [1], ``D``
= E/(1 - nu^2). Lengths are in any one unit; forces are per thickness. Explicit steps, statics, implicit steps and
frequencies all evaluate these expressions or their ``ca.jacobian``.

Matrices are NumPy arrays whose entries are CasADi columns with a row per element. So the same lines serve one element (SX)
and, at a fraction of the cost in CasADi's virtual machine, all elements of a mesh at once (MX). CasADi leaves out
multiplications by one and zero and additions of zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector

Column: TypeAlias = ca.MX  # or ca.SX
Matrix: TypeAlias = NDArray[np.object_]  # of columns

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
MODES = np.column_stack([np.ones(4), CORNERS, CORNERS.prod(axis=1)])  # 1, s, t, st at the nodes

# at the Gauss points, modes and their derivatives are signs times these
_GAUSS = 1.0 / np.sqrt(3.0)
_VALUE = np.array([1.0, _GAUSS, _GAUSS, _GAUSS**2])
_SLOPE = np.array([1.0, 1.0, 1.0, _GAUSS])

# keeps the derivative of the larger principal strain finite where both are equal; 1e-12 relative to a stretch
_TINY = 1e-24


@dataclass(frozen=True, eq=False)
class GaussPoint:
    """What a Gauss point knows of the reference element.

    Attributes
    ----------
    H : ndarray, shape (4,)
        Signs of the modes [1].
    dH : ndarray, shape (4, 2)
        Signs of their parent derivatives [1].
    J_inverse : ndarray, shape (2, 2)
        Derivative of a quarter of the parent coordinates by reference coordinates [1/length].
    dA : float
        Reference area [length^2] that it stands for: the determinant of J, since the weights of the 2 x 2 rule are 1.
    """

    H: Vector
    dH: Vector
    J_inverse: Vector
    dA: float


def modes(s: float, t: float) -> tuple[Vector, Vector]:
    """Evaluate the modes 1, s, t, st and their parent derivatives, shapes (4,) and (4, 2)."""
    return np.array([1.0, s, t, s * t]), np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [t, s]])


def gauss_points(X: Vector) -> list[GaussPoint]:
    """Describe the 2 x 2 Gauss points of an element with reference node positions ``X``, shape (4, 2) [length]."""
    points = []
    for s, t in CORNERS:
        H, dH = modes(s, t)
        J = np.round(X.T @ MODES * _SLOPE @ dH, 14)  # four times J, and zeros and ones in place of round-off
        points.append(GaussPoint(H, dH, np.asarray(np.linalg.inv(J)), float(np.linalg.det(J)) / 16.0))
    return points


def element_mass(points: list[GaussPoint]) -> Vector:
    """Integrate the consistent mass matrix per density and thickness [length^2], shape (12, 12)."""
    N = np.array([point.H for point in points]) * _VALUE @ MODES.T / 4.0
    return np.kron(N.T @ np.diag([point.dA for point in points]) @ N, np.eye(3))


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
    With :math:`F = \sum_I x_I \otimes \nabla N_I`, :math:`e = F^T F - 1` and St Venant-Kirchhoff's law in plane stress,
    :math:`S = \tfrac12 D\,[(1-\nu)\,e + \nu\,\mathrm{tr}(e)\,1]`, the force on node :math:`I` is

    .. math:: f_I = \int N_I\,p\; x_{,s} \times x_{,t}\,\mathrm{d}s\,\mathrm{d}t - \int F S\,\nabla N_I\,\mathrm{d}A,

    the total Lagrangian form of [1]_ with the consistent follower load of [2]_, both by the 2 x 2 Gauss rule (exact for the
    load of a plane element). Positions and forces are split into the four modes 1, s, t, st, since
    :math:`N_I = \tfrac14 (1 + s_I s)(1 + t_I t)`; this halves the operations. Compression is carried: no wrinkling.

    References
    ----------
    .. [1] T. Belytschko, W. K. Liu, B. Moran, K. Elkhodary, Nonlinear Finite Elements for Continua and Structures,
       2nd ed., Wiley, 2014, Section 4.9.
    .. [2] K. Schweizerhof, E. Ramm, Computers & Structures 18(6), 1099-1114, 1984, doi:10.1016/0045-7949(84)90154-8.
    """
    nu, D = poisson_ratio, modulus / (1.0 - poisson_ratio**2)
    columns = ca.horzsplit(x)
    a = _matrix([columns[i::3] for i in range(3)]) @ MODES * _SLOPE  # four times the modes of the position
    load, stress, wave = np.zeros((3, 4)), np.zeros((3, 4)), 0.0
    for point in points:
        tangents = a @ point.dH  # four times x_,s and x_,t
        F = tangents @ point.J_inverse
        e = F.T @ F - np.eye(2)
        S = _stress(e, point.dA * D, nu)
        load = load + np.outer(np.cross(tangents[:, 0], tangents[:, 1]), point.H)
        stress = stress + F @ S @ (point.dH @ point.J_inverse).T
        wave = ca.fmax(wave, _wave_modulus(e, D, nu))
    p = pressure_over_thickness / 64.0
    f = (load * _matrix([[p * value for value in _VALUE]]) - stress * _SLOPE) @ MODES.T
    return ca.horzcat(*f.T.flat), wave


def _matrix(rows: list[list[Column]]) -> Matrix:
    """Make a matrix of columns; NumPy by itself would look into them."""
    matrix = np.empty((len(rows), len(rows[0])), dtype=object)
    for place in np.ndindex(matrix.shape):
        matrix[place] = rows[place[0]][place[1]]
    return matrix


def _stress(e: Matrix, D: Column, nu: Column) -> Matrix:
    """Return the second Piola-Kirchhoff stress [Pa], St Venant-Kirchhoff's law in plane stress."""
    shear = D / 2.0 * (1.0 - nu) * e[0, 1]
    return _matrix([[D / 2.0 * (e[0, 0] + nu * e[1, 1]), shear], [shear, D / 2.0 * (e[1, 1] + nu * e[0, 0])]])


def _wave_modulus(e: Matrix, D: Column, nu: Column) -> Column:
    r"""Return :math:`\rho_0 c_0^2` [Pa] of the longitudinal wave along the larger principal stretch.

    Notes
    -----
    Along the principal stretch :math:`\lambda` it is :math:`\lambda^2 D + S`, :math:`c_0` in reference lengths; a transverse
    wave has :math:`S` alone. The principal values of e are half of trace plus and minus spread.
    """
    trace = e[0, 0] + e[1, 1]
    spread = ca.sqrt((e[0, 0] - e[1, 1]) ** 2 + 4.0 * e[0, 1] ** 2 + _TINY)
    return D * (1.0 + (3.0 + nu) / 4.0 * trace + (3.0 - nu) / 4.0 * spread)

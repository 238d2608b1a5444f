r"""The membrane element: the one place where its forces are written.

Symbols: ``x`` current node positions, ``s``, ``t`` parent coordinates [1] from -1/2 to 1/2, ``N`` shape functions [1] and
``D_s``, ``D_t`` their parent derivatives at the quadrature points, ``w`` weights of the points [1], ``J`` determinant of the
reference map, ``F`` deformation gradient (3 x 2), ``e`` twice the Green-Lagrange strain, ``S`` second and ``P`` first
Piola-Kirchhoff stress [Pa], ``f`` nodal forces, ``E`` Young's modulus [Pa], ``nu`` Poisson's ratio [1], ``D`` =
E/(1 - nu^2). Lengths are in any one unit; forces are per thickness. Explicit steps, statics, implicit steps and frequencies
all evaluate these expressions or their derivatives.

Matrices of small size, such as F, are NumPy arrays whose entries are CasADi matrices with a row per quadrature point and a
column per element. So the same lines serve one element (SX) and, at a fraction of the cost in CasADi's virtual machine, all
elements of a mesh at once (MX). CasADi leaves out multiplications by one and zero and additions of zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from ..arrays import Vector
from .law import Entry, Law, Matrix, matrix, principal, st_venant_kirchhoff
from .quadrature import derivative_matrix, gauss_points, lobatto_points, value_matrix

Operator: TypeAlias = tuple[ca.DM, ...]  # factors, the first one acts first


@dataclass(frozen=True, eq=False)
class Element:
    """Shape functions and quadrature of one element.

    Attributes
    ----------
    order : int
        Polynomial order of the shape functions along a side; 0 for the triangle of constant strain.
    nodes : ndarray, shape (m, 2)
        Parent coordinates of the nodes [1], s fastest.
    N, D_s, D_t : tuple of casadi.DM
        Factors of the matrices, points x nodes, of the shape functions and their parent derivatives.
    w : ndarray, shape (points,)
        Weights of the quadrature in the parent element [1].
    J : float, casadi.DM, SX or MX
        Determinant of the reference map [length^2], one number, one for every point, or a column of these per element.
    J_inverse : ndarray of objects like J, shape (2, 2)
        Derivative of the parent coordinates by the reference coordinates [1/length], likewise.
    law : callable
        Stress of the material, one of ``law.LAWS``.
    """

    order: int
    nodes: Vector
    N: Operator
    D_s: Operator
    D_t: Operator
    w: Vector
    J: Any
    J_inverse: Matrix
    law: Law


@dataclass(frozen=True, slots=True, kw_only=True)
class Extras:
    """What only a membrane from a mesh file knows; each may be missing.

    Attributes
    ----------
    eigenstrain : ndarray of entries, shape (2, 2), optional
        Twice the strain [1] that the stress is of beside the geometric one: of a prestress, or minus that of heat.
    light : sequence of entries, length 3, optional
        Direction in which light travels [1].
    absorbed, mirrored : entries
        Pressure of light over thickness [Pa/length]: of the share that is absorbed, and of the share that is mirrored.
    """

    eigenstrain: Matrix | None = None
    light: Sequence[Entry] | None = None
    absorbed: Entry = 0.0
    mirrored: Entry = 0.0


@dataclass(frozen=True, slots=True)
class Points:
    """What the points of an element give.

    Attributes
    ----------
    P : ndarray of entries, shape (3, 2)
        Stress by parent derivatives of the shape functions, weighted.
    load : list of entries, length 3
        Load by shape functions, weighted.
    wave : entry
        rho c^2 over D [1] of a plane wave along the larger principal stretch.
    strain : entry
        Twice the larger principal Green-Lagrange strain [1].
    compressed : entry
        Reference area of the point where the smaller principal stress of Hooke's law is below zero, else 0 [length^2].
    """

    P: Matrix
    load: list[Entry]
    wave: Entry
    strain: Entry
    compressed: Entry


def make_element(order: int, X: Vector | None = None, law: Law = st_venant_kirchhoff) -> Element:
    r"""Make the bilinear element (order 1) or a spectral element of higher order.

    Parameters
    ----------
    order : int
        1: four nodes and the 2 x 2 Gauss rule, the membrane element of finite element programs. 2 and more: Lagrange shape
        functions through Gauss-Lobatto-Legendre nodes, which are the quadrature points too [1]_, so that the mass matrix
        is diagonal without lumping. 0: the triangle of three nodes and constant strain.
    X : ndarray, shape ((order + 1)^2, 2), optional
        Reference positions of the nodes, s fastest [length]; by default the parent square itself.
    law : callable
        Stress of the material, one of ``law.LAWS``.

    Returns
    -------
    Element

    References
    ----------
    .. [1] D. Komatitsch, J. Tromp, Geophysical Journal International 139(3), 806-822, 1999,
       doi:10.1046/j.1365-246x.1999.00967.x.
    """
    if order == 0:
        return _triangle(law)
    nodes, weights = lobatto_points(order + 1)
    points, weights = gauss_points(2) if order == 1 else (nodes, weights)
    value, slope = value_matrix(nodes, points), derivative_matrix(nodes, points)
    grid = np.column_stack([np.tile(nodes, order + 1), np.repeat(nodes, order + 1)])
    N, D_s, D_t = _operator(value, value), _operator(slope, value), _operator(value, slope)
    J, J_inverse = (1.0, matrix([[1.0, 0.0], [0.0, 1.0]])) if X is None else _reference_map(X, D_s, D_t)
    return Element(order, grid, N, D_s, D_t, np.outer(weights, weights).ravel(), J, J_inverse, law)


def element_mass(element: Element) -> Vector:
    """Integrate the consistent mass matrix per density and thickness [length^2], shape (3 m, 3 m)."""
    N = np.asarray(_dense(element.N, len(element.nodes)))
    dA = element.w * np.asarray(element.J).ravel()
    return np.kron(N.T @ (dA[:, None] * N), np.eye(3))


def _triangle(law: Law) -> Element:
    """Make the triangle with the corners (0, 0), (1, 0), (0, 1) and one point in its middle."""
    third = ca.DM.ones(1, 3) / 3.0
    slopes = [ca.DM([[-1.0, 1.0, 0.0]]), ca.DM([[-1.0, 0.0, 1.0]])]
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    unit = matrix([[1.0, 0.0], [0.0, 1.0]])
    return Element(0, corners, (third,), (slopes[0],), (slopes[1],), np.array([0.5]), 1.0, unit, law)


def element_force(
    x: Sequence[Entry], element: Element, modulus: Entry, poisson_ratio: Entry, pressure_over_thickness: Entry
) -> tuple[Entry, Entry, Entry]:
    r"""Write the forces of pressure and stress on the nodes of n elements.

    Parameters
    ----------
    x : sequence of casadi.SX or MX, shape (m, n)
        Current node positions [length] along x, y and z.
    element : Element
        Shape functions and quadrature, the same for all elements.
    modulus : casadi.SX or MX, shape (1, n)
        Young's modulus [Pa].
    poisson_ratio, pressure_over_thickness : casadi.SX or MX, scalar
        Poisson's ratio [1]; pressure over thickness [Pa/length], positive along :math:`x_{,s} \times x_{,t}`.

    Returns
    -------
    casadi.SX or MX, shape (3 m, n)
        Force per thickness [Pa length] on each node along x, then y, then z: pressure minus internal force.
    casadi.SX or MX, shape (points, n)
        :math:`\rho c^2` [Pa] of a plane wave along the larger principal stretch.
    casadi.SX or MX, shape (points, n)
        Twice the larger principal Green-Lagrange strain [1].

    Notes
    -----
    With :math:`F = \sum_I x_I \otimes \nabla N_I`, :math:`e = F^T F - 1` and the stress :math:`S(e)` of the element's law,
    the force on node :math:`I` is

    .. math:: f_I = \int N_I\,p\; x_{,s} \times x_{,t}\,\mathrm{d}s\,\mathrm{d}t - \int F S\,\nabla N_I\,\mathrm{d}A,

    the total Lagrangian form of [1]_ with the consistent follower load of [2]_, both by the quadrature of the element.

    References
    ----------
    .. [1] T. Belytschko, W. K. Liu, B. Moran, K. Elkhodary, Nonlinear Finite Elements for Continua and Structures,
       2nd ed., Wiley, 2014, Section 4.9.
    .. [2] K. Schweizerhof, E. Ramm, Computers & Structures 18(6), 1099-1114, 1984, doi:10.1016/0045-7949(84)90154-8.
    """
    n = x[0].shape[1]
    w, D = ca.repmat(ca.DM(element.w), 1, n), ca.repmat(modulus / (1.0 - poisson_ratio**2), len(element.w), 1)
    at = element_points(tangents(x, element), element, w, D, poisson_ratio, pressure_over_thickness)
    return balance(at.P, at.load, element), D * at.wave, at.strain


def element_force_function(element: Element) -> ca.Function:
    """Make ``f(x, E, nu, load) -> (f, wave, strain)`` for one element, as ``element_force``, in a form for compilation.

    Three functions without branches, of which the middle one is a loop over the points: twice as fast as one expression,
    which would hold the stresses of all points at once.
    """
    m, points = len(element.nodes), len(element.w)
    x = ca.SX.sym("x", 3 * m)
    at_points = ca.Function("tangents", [x], [ca.horzcat(*tangents(ca.vertsplit(x, m), element).flat).T])
    law = _law_function(element)
    P, load = ca.SX.sym("P", 6, points), ca.SX.sym("load", 3, points)
    rows = matrix([[P[2 * i + a, :].T for a in range(2)] for i in range(3)])
    on_nodes = ca.Function("balance", [P, load], [balance(rows, [load[i, :].T for i in range(3)], element)])
    positions, E, nu, pressure = symbols = [ca.MX.sym("x", 3 * m), ca.MX.sym("E"), ca.MX.sym("nu"), ca.MX.sym("load")]
    all_points = law.map(points, [False, False, True, True, True])
    D = E / (1.0 - nu**2)
    P, load, wave, strain = all_points(at_points(positions), ca.DM(element.w).T, D, nu, pressure)
    return ca.Function("element_force", symbols, [on_nodes(P, load), D * ca.mmax(wave), ca.mmax(strain)])


def element_tangent_function(element: Element, axes: int) -> ca.Function:
    """Make ``K(x, E, nu, load)``, the derivative of the force by the node positions, both along the first ``axes`` axes.

    The chain rule: derivatives of stress and load at the points, between the operators of the element.
    """
    m, points = len(element.nodes), len(element.w)
    law = _law_function(element)
    inputs = law.sx_in()
    P, load, *_ = law(*inputs)
    by_tangents = ca.Function("law_derivative", inputs, [ca.densify(ca.jacobian(ca.vertcat(P, load), inputs[0]))])
    N, *slopes = (_dense(operator, m) for operator in (element.N, element.D_s, element.D_t))
    x, E, nu, pressure = symbols = [ca.MX.sym("x", 3 * m), ca.MX.sym("E"), ca.MX.sym("nu"), ca.MX.sym("load")]
    T = tangents(ca.vertsplit(x, m), element)
    derivatives = by_tangents.map(points, [False, False, True, True, True])
    D = E / (1.0 - nu**2)
    A = ca.reshape(derivatives(ca.horzcat(*T.flat).T, ca.DM(element.w).T, D, nu, pressure), 9, -1)  # 6 columns a point

    def at_points(row: int, k: int, b: int) -> ca.MX:
        return ca.diag(A[row, 2 * k + b :: 6].T)

    def block(i: int, k: int) -> ca.MX:
        sides = (
            ca.mtimes(N.T, at_points(6 + i, k, b))
            - sum(ca.mtimes(slope.T, at_points(2 * i + a, k, b)) for a, slope in enumerate(slopes))
            for b in range(2)
        )
        return sum(ca.mtimes(side, slope) for side, slope in zip(sides, slopes, strict=True))

    K = ca.vertcat(*(ca.horzcat(*(block(i, k) for k in range(axes))) for i in range(axes)))
    return ca.Function("element_tangent", symbols, [ca.densify(K)])


def tangents(x: Sequence[Entry], element: Element) -> Matrix:
    """Return the tangents x,s and x,t at the points, shape (3, 2)."""
    return matrix([[_apply(operator, column) for operator in (element.D_s, element.D_t)] for column in x])


def element_points(
    tangents: Matrix, element: Element, w: Entry, D: Entry, nu: Entry, pressure: Entry, extras: Extras = Extras()
) -> Points:
    r"""Write what the points of elements give: their share of the forces, and what limits step and validity.

    Parameters
    ----------
    tangents : ndarray of entries, shape (3, 2)
        :math:`x_{,s}` and :math:`x_{,t}` at the points.
    element : Element
        Shape functions, quadrature, reference map and law.
    w, D, nu, pressure : entries
        Weights [1], E/(1 - nu^2) [Pa], Poisson's ratio [1] and pressure over thickness [Pa/length], each a number or one
        of every point.
    extras : Extras
        Eigenstrain and light.

    Notes
    -----
    Light that travels along u exerts, per current area and with the normal N of its length, :math:`|u \cdot N|` of the
    absorbed pressure along u and twice that of the mirrored one along the normal, Section 2.6 of [1]_.

    References
    ----------
    .. [1] C. R. McInnes, Solar Sailing, Springer, 1999, doi:10.1007/978-1-4471-3992-8.
    """
    F = tangents @ element.J_inverse
    e = F.T @ F - np.eye(2)
    stressed = e if extras.eigenstrain is None else e + extras.eigenstrain
    P = F @ element.law(stressed, w * element.J * D, nu) @ element.J_inverse.T
    normal = np.cross(tangents[:, 0], tangents[:, 1])
    load = [w * pressure * component for component in normal]
    if extras.light is not None and extras.absorbed is not None and extras.mirrored is not None:
        across = sum(u * component for u, component in zip(extras.light, normal, strict=True))
        area = ca.fabs(across) * w
        along = 2.0 * extras.mirrored * across / sum(component**2 for component in normal)
        pairs = zip(extras.light, normal, strict=True)
        load = [f + area * (extras.absorbed * u + along * c) for f, (u, c) in zip(load, pairs, strict=True)]
    trace, spread = principal(e)
    strain = (trace + spread) / 2.0
    if extras.eigenstrain is None:
        wave = 1.0 + (3.0 + nu) / 4.0 * trace + (3.0 - nu) / 4.0 * spread
    else:
        trace, spread = principal(stressed)
        wave = 1.0 + strain + (1.0 + nu) / 4.0 * trace + (1.0 - nu) / 4.0 * spread
    compressed = w * element.J * ((1.0 + nu) * trace < (1.0 - nu) * spread - 1e-9)
    return Points(P, load, wave, strain, compressed)


def balance(P: Matrix, load: Sequence[Entry], element: Element) -> Entry:
    """Gather load minus stress on the nodes, shape (3 m, n)."""
    return ca.vertcat(
        *(
            _apply_transposed(element.N, load[i])
            - _apply_transposed(element.D_s, P[i, 0])
            - _apply_transposed(element.D_t, P[i, 1])
            for i in range(3)
        )
    )


def _law_function(element: Element) -> ca.Function:
    """Make ``law(tangents, w, D, nu, load) -> (P, load, wave, strain)`` of one point, row by row; equal points only."""
    T, w, D, nu, pressure = symbols = [
        ca.SX.sym(name, size) for name, size in zip("TwDnp", (6, 1, 1, 1, 1), strict=True)
    ]
    rows = matrix([[T[2 * i + a] for a in range(2)] for i in range(3)])
    at = element_points(rows, element, w, D, nu, pressure)
    return ca.Function("law", symbols, ca.cse([ca.vertcat(*at.P.flat), ca.vertcat(*at.load), at.wave, at.strain]))


def _operator(along_s: Vector, along_t: Vector) -> Operator:
    """Make an operator from one along each side, shapes (points, nodes), leaving out a factor that changes nothing."""
    I = np.eye(len(along_s))
    factors = np.kron(I, along_s), np.kron(along_t, I)
    return tuple(ca.sparsify(ca.DM(factor)) for factor in factors if not np.array_equal(factor, np.eye(len(factor))))


def _reference_map(X: Vector, D_s: Operator, D_t: Operator) -> tuple[ca.DM, Matrix]:
    """Return the determinant of the reference map at every point, and the inverse of its Jacobian."""
    J = np.stack([np.asarray(_apply(operator, ca.DM(X))) for operator in (D_s, D_t)], axis=-1)
    inverse = np.linalg.inv(J)
    return ca.DM(np.linalg.det(J)), matrix([[ca.DM(inverse[:, a, b]) for b in range(2)] for a in range(2)])


def _dense(operator: Operator, nodes: int) -> ca.DM:
    """Multiply the factors of an operator, shape (points, nodes)."""
    return _apply(operator, ca.DM.eye(nodes))


def _apply(operator: Operator, x: Any) -> Any:  # noqa: ANN401
    return reduce(lambda value, factor: ca.mtimes(factor, value), operator, x)


def _apply_transposed(operator: Operator, x: Any) -> Any:  # noqa: ANN401
    return reduce(lambda value, factor: ca.mtimes(factor.T, value), reversed(operator), x)

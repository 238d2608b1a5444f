r"""The membrane element: the one place where its forces are written.

Symbols: ``x`` current node positions, ``s``, ``t`` parent coordinates [1] from -1/2 to 1/2, ``N`` shape functions [1] and
``D_s``, ``D_t`` their parent derivatives at the quadrature points, ``w`` weights of the points [1], ``J`` determinant of the
reference map, ``F`` deformation gradient (3 x 2), ``e`` twice the Green-Lagrange strain, ``S`` second and ``P`` first
Piola-Kirchhoff stress [Pa], ``f`` nodal forces, ``E`` Young's modulus [Pa], ``nu`` Poisson's ratio [1], ``D`` =
E/(1 - nu^2), or all of them times the thickness. Lengths are in any one unit. Steps, equilibrium and frequencies all
evaluate these expressions or their derivatives.

Nodes, weights and Lagrange polynomials are those on [-1/2, 1/2], the side of a parent element of size one.

Matrices of small size, such as F, are NumPy arrays whose entries are CasADi matrices with a row per quadrature point and a
column per element. So the same lines serve one element (SX) and, at a fraction of the cost in CasADi's virtual machine, all
elements of a mesh at once (MX). CasADi leaves out multiplications by one and zero and additions of zero.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, reduce
from typing import Any, TypeAlias

import casadi as ca
import numpy as np
from numpy.polynomial import Legendre, legendre
from numpy.typing import NDArray

from ..arrays import Vector
from .law import LAWS, Entry, Matrix, Stress, matrix, principal, torn

Operator: TypeAlias = tuple[ca.DM, ...]  # factors, the first one acts first
COMPRESSION = 4e-7  # of four times the smaller principal stress over E/(1 - nu^2): a strain of 1e-7 matters to no membrane
_UNIT = matrix([[1.0, 0.0], [0.0, 1.0]])
_ZERO = 1e-13  # what the derivatives at a node in the middle of others are but for round-off


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
    stress : callable
        Stress of the material, as of ``law.Law``.
    """

    order: int
    nodes: Vector
    N: Operator
    D_s: Operator
    D_t: Operator
    w: Vector
    J: Any
    J_inverse: Matrix
    stress: Stress


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


def make_element(order: int, law: str = "st_venant_kirchhoff") -> Element:
    r"""Make the bilinear element (order 1) or a spectral element of higher order.

    Parameters
    ----------
    order : int
        1: four nodes and the 2 x 2 Gauss rule, the membrane element of finite element programs. 2 and more: Lagrange shape
        functions through Gauss-Lobatto-Legendre nodes, which are the quadrature points too [1]_, so that the mass matrix
        is diagonal without lumping. 0: the triangle of constant strain with the corners (0, 0), (1, 0), (0, 1).
    law : str
        Law of the material, one of ``law.LAWS``.

    Returns
    -------
    Element

    References
    ----------
    .. [1] D. Komatitsch, J. Tromp, Geophysical Journal International 139(3), 806-822, 1999,
       doi:10.1046/j.1365-246x.1999.00967.x.
    """
    if order == 0:  # one point, in the middle
        grid, w = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.array([0.5])
        N, D_s, D_t = (ca.DM.ones(1, 3) / 3.0,), (ca.DM([[-1.0, 1.0, 0.0]]),), (ca.DM([[-1.0, 0.0, 1.0]]),)
    else:
        nodes, weights = lobatto_points(order + 1)
        points, weights = gauss_points(2) if order == 1 else (nodes, weights)
        value, slope = value_matrix(nodes, points), derivative_matrix(nodes, points)
        grid = np.column_stack([np.tile(nodes, order + 1), np.repeat(nodes, order + 1)])
        N, D_s, D_t = _operator(value, value), _operator(slope, value), _operator(value, slope)
        w = np.outer(weights, weights).ravel()
    return Element(order, grid, N, D_s, D_t, w, 1.0, _UNIT, LAWS[law].stress)


def by_axis(rows: Entry) -> Matrix:
    """Return six rows, of x,s and x,t along x, then y, then z, as entries, shape (3, 2)."""
    return matrix([[rows[2 * i + a, :].T for a in range(2)] for i in range(3)])


def tangents(x: Sequence[Entry], element: Element) -> Matrix:
    """Return the tangents x,s and x,t at the points, shape (3, 2)."""
    return matrix([[apply(operator, column) for operator in (element.D_s, element.D_t)] for column in x])


def element_points(tangents: Matrix, element: Element, w: Entry, shared: Mapping[str, Entry]) -> Points:
    r"""Write what the points of elements give: their share of the forces, and what limits step and validity.

    Parameters
    ----------
    tangents : ndarray of entries, shape (3, 2)
        :math:`x_{,s}` and :math:`x_{,t}` at the points.
    element : Element
        Shape functions, quadrature, reference map and law.
    w : entry
        Weights [1].
    shared : mapping of str to entry
        Each a number or one of every point: ``D``, E/(1 - nu^2) [Pa]; ``nu``; ``pressure`` over thickness [Pa/length]. Of
        some membranes twice the strain [1] that the stress is of beside the geometric one, ``along``, ``across`` and
        ``shear``: of a prestress, or minus that of heat. Shares of the stiffness [1] ``left_along`` and ``left_across``, see
        ``law.torn``. And lights, a number behind each name: direction [1] ``light_x_0``, ``light_y_0``, ``light_z_0``;
        pressures over thickness [Pa/length], ``onward_0`` along the light and ``mirrored_0``, of some also ``scattered_0``
        and ``emitted_0``, see ``light``.

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
    nu, F = shared["nu"], tangents @ element.J_inverse
    e = F.T @ F - np.eye(2)
    stressed = e
    if "along" in shared:
        stressed = e + matrix([[shared["along"], shared["shear"]], [shared["shear"], shared["across"]]])
    S = element.stress(stressed, w * element.J * shared["D"], nu)
    if "left_along" in shared:
        S = torn(S, shared["left_along"], shared["left_across"], nu)
    P = F @ S @ element.J_inverse.T
    normal = np.cross(tangents[:, 0], tangents[:, 1])
    load = [w * shared["pressure"] * component for component in normal]
    for k in range(sum(name.startswith("onward_") for name in shared)):
        load = [f + pushed for f, pushed in zip(load, light(normal, k, w, shared), strict=True)]
    trace, spread = principal(e)
    strain = (trace + spread) / 2.0
    if stressed is e:
        wave = 1.0 + (3.0 + nu) / 4.0 * trace + (3.0 - nu) / 4.0 * spread
    else:
        trace, spread = principal(stressed)
        wave = 1.0 + strain + (1.0 + nu) / 4.0 * trace + (1.0 - nu) / 4.0 * spread
    compressed = w * element.J * ((1.0 + nu) * trace < (1.0 - nu) * spread - COMPRESSION)
    return Points(P, load, wave, strain, compressed)


def light(normal: Matrix, k: int, w: Entry, shared: Mapping[str, Entry]) -> list[Entry]:
    r"""Write the load of light k on the points of elements, three components; arguments are those of ``element_points``.

    Notes
    -----
    Light of pressure p that travels along u exerts per current area, with the normal N of unit length,

    .. math::

        p\,|u \cdot N|\,\{(1 - \rho)\,u + [2 \rho\,(u \cdot N) + \tfrac23 d\,\mathrm{sgn}(u \cdot N) - \tfrac23
        (1 - \rho - d)\,(\epsilon_+ - \epsilon_-) / (\epsilon_+ + \epsilon_-)]\,N\},

    where the shares :math:`\rho` are mirrored and d scattered, and the heat of the rest leaves by the emissivities
    :math:`\epsilon_+` of the side of N and :math:`\epsilon_-` of the other: Section 2.6 of [1]_ with sides that radiate by
    Lambert's law, B = 2/3.

    References
    ----------
    .. [1] C. R. McInnes, Solar Sailing, Springer, 1999, doi:10.1007/978-1-4471-3992-8.
    """
    u = [shared[f"light_{axis}_{k}"] for axis in "xyz"]
    across = sum(a * component for a, component in zip(u, normal, strict=True))
    area, square = ca.fabs(across) * w, sum(component**2 for component in normal)
    along = 2.0 * shared[f"mirrored_{k}"] * across / square
    load = [area * (shared[f"onward_{k}"] * a + along * component) for a, component in zip(u, normal, strict=True)]
    if f"scattered_{k}" in shared:
        around = (shared[f"scattered_{k}"] * across * w - shared[f"emitted_{k}"] * area) / ca.sqrt(square)
        load = [f + around * component for f, component in zip(load, normal, strict=True)]
    return load


def balance(P: Matrix, load: Sequence[Entry], element: Element) -> Entry:
    """Gather load minus stress on the nodes, shape (3 m, n)."""
    return ca.vertcat(
        *(
            apply_transposed(element.N, load[i])
            - apply_transposed(element.D_s, P[i, 0])
            - apply_transposed(element.D_t, P[i, 1])
            for i in range(3)
        )
    )


def _operator(along_s: Vector, along_t: Vector) -> Operator:
    """Make an operator from one along each side, shapes (points, nodes), leaving out a factor that changes nothing."""
    I = np.eye(len(along_s))
    factors = np.kron(I, along_s), np.kron(along_t, I)
    return tuple(ca.sparsify(ca.DM(factor), _ZERO) for factor in factors if not np.array_equal(factor, np.eye(len(factor))))


def dense(operator: Operator, nodes: int) -> ca.DM:
    """Multiply the factors of an operator, shape (points, nodes)."""
    return apply(operator, ca.DM.eye(nodes))


def apply(operator: Operator, x: Any) -> Any:  # noqa: ANN401
    """Multiply by an operator."""
    return reduce(lambda value, factor: ca.mtimes(factor, value), operator, x)


def apply_transposed(operator: Operator, x: Any) -> Any:  # noqa: ANN401
    """Multiply by the transpose of an operator."""
    return reduce(lambda value, factor: ca.mtimes(factor.T, value), reversed(operator), x)


def gauss_points(n: int) -> tuple[Vector, Vector]:
    """Return nodes and weights of the Gauss-Legendre rule [1], shapes (n,); exact to degree 2 n - 1."""
    points, weights = legendre.leggauss(n)
    return np.asarray(points / 2.0, dtype=np.float64), np.asarray(weights / 2.0, dtype=np.float64)


@cache
def lobatto_points(n: int) -> tuple[Vector, Vector]:
    r"""Return nodes and weights of the Gauss-Lobatto-Legendre rule [1], shapes (n,); exact to degree 2 n - 3.

    Notes
    -----
    The ends and the roots of :math:`P_{n-1}'`, with weights :math:`2/(n (n-1) P_{n-1}(x)^2)`, Eq. (25.4.32) of [1]_, on an
    interval of length 2; here both are halved.

    References
    ----------
    .. [1] M. Abramowitz, I. A. Stegun, Handbook of Mathematical Functions, National Bureau of Standards, 1964.
    """
    P = Legendre.basis(n - 1)
    inner = np.sort(np.real(P.deriv().roots()))  # real; NumPy 2.5 returns them as complex numbers
    points = np.concatenate([[-1.0], (inner - inner[::-1]) / 2.0, [1.0]])  # symmetric to the last bit
    found = points / 2.0, 1.0 / (n * (n - 1) * P(points) ** 2)
    for array in found:
        array.flags.writeable = False  # all callers have the same
    return found


def value_matrix(nodes: Vector, points: Vector) -> Vector:
    """Evaluate the Lagrange polynomials through ``nodes``, shape (points, nodes); exact ones and zeros at the nodes."""
    return np.asarray(np.prod(_ratios(nodes, points), axis=0))


def derivative_matrix(nodes: Vector, points: Vector) -> Vector:
    """Evaluate the derivatives of the Lagrange polynomials through ``nodes``, shape (points, nodes)."""
    n, ratios = len(nodes), _ratios(nodes, points)
    found = np.zeros((len(points), n))
    for j in range(n):
        without = np.prod(np.delete(ratios, j, axis=0), axis=0)
        others = np.arange(n) != j
        found[:, others] += without[:, others] / (nodes[others] - nodes[j])
    return found


def _ratios(nodes: Vector, points: Vector) -> Vector:
    """Return the factors of the Lagrange polynomials, shape (nodes, points, nodes): 1 where the nodes are the same."""
    away = nodes - nodes[:, None]
    np.fill_diagonal(away, 1.0)
    found = (points[:, None] - nodes[:, None, None]) / away[:, None]
    found[np.arange(len(nodes)), :, np.arange(len(nodes))] = 1.0
    return found


def sum_at(places: NDArray[np.int64], values: ca.MX, size: int) -> ca.MX:
    """Sum values at their places, shape (size,): the transpose of indexing."""
    x = ca.MX.sym("x", size)
    return ca.jtimes(ca.vec(x[places.tolist()]), x, values, True)  # of a number CasADi would take a row

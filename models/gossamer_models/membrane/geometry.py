r"""Elements on the reference surface: their maps, masses, normals, and the stiffest motion of each.

Symbols: ``X`` reference positions [m], ``T`` their derivatives by the parent coordinates, ``e1``, ``e2`` local axes in the
tangent plane, ``R`` = [e1 e2]^T T the reference map, ``J`` its determinant [m2], ``B`` strain by displacements [1/m],
``lambda`` largest eigenvalue of stiffness over mass of one element [1/m2].
"""

from dataclasses import dataclass, replace
from functools import cache, cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector
from .element import Element, Operator, dense, derivative_matrix, lobatto_points, make_element
from .law import matrix

_BILINEAR = (0.6 / 0.42) ** 2 - 1.0
_MEMORY = 2**22  # numbers of one batch of matrices


@dataclass(frozen=True, eq=False)
class Geometry:
    """Reference maps of n elements with m nodes.

    Attributes
    ----------
    element : Element
        Parent element.
    T : ndarray, shape (n, points, 3, 2)
        Tangents at the quadrature points [m].
    e1, normal : ndarray, shape (n, points, 3)
        First local axis and unit normal.
    J : ndarray, shape (n, points)
        Determinant of the reference map [m2].
    J_inverse : ndarray, shape (n, points, 2, 2)
        Derivative of the parent coordinates by the local ones [1/m].
    """

    element: Element
    T: Vector
    e1: Vector
    normal: Vector
    J: Vector
    J_inverse: Vector

    @property
    def areas(self) -> Vector:
        """Reference area of each element [m2]."""
        return np.asarray(self.J @ self.element.w)

    @property
    def node_areas(self) -> Vector:
        """Share of each node in its element's area [m2], shape (n, m)."""
        return np.asarray((self.J * self.element.w) @ values(self.element))

    @property
    def node_normals(self) -> Vector:
        """Area of each node along its normal [m2], shape (n, m, 3)."""
        weighted = (self.J * self.element.w)[..., None] * self.normal
        return np.asarray(np.einsum("npi,pm->nmi", weighted, values(self.element)))

    def tilts(self, normals: Vector) -> Vector:
        """Return the largest squared sine between the normals of each element and those of its nodes [1], shape (n,).

        Those of the nodes are unit vectors, shape (n, m, 3).
        """
        across = self.node_normals / np.linalg.norm(self.node_normals, axis=2, keepdims=True)
        return np.asarray(np.max(1.0 - np.sum(across * normals, axis=2) ** 2, axis=1).clip(0.0))

    @cached_property
    def side(self) -> float | None:
        """Side of the elements [m] if all are the same square, else None."""
        side = float(np.sqrt(np.abs(self.J[0, 0])))
        squares = self.element.order > 0 and np.allclose(self.J_inverse * side, np.eye(2), rtol=0.0, atol=1e-11)
        return side if squares else None

    def placed(self) -> Element:
        """Return the element with its own map in every column, one per element; of equal squares, in units of their side."""
        if self.side is not None:
            return self.element
        maps = matrix([[ca.DM(self.J_inverse[..., a, b].T) for b in range(2)] for a in range(2)])
        return replace(self.element, J=ca.DM(self.J.T), J_inverse=maps)


def geometry(X: Vector, order: int, law: str, axes: Vector) -> Geometry:
    """Measure elements.

    Parameters
    ----------
    X : ndarray, shape (n, m, 3)
        Reference positions of the nodes [m].
    order : int
        0 for triangles.
    law : str
        Law of the material.
    axes : ndarray, shape (n, 3)
        Direction whose projection on the surface is the first local axis.

    Returns
    -------
    Geometry
        With J of 0 where an element has no area.
    """
    element = make_element(order, law)
    T = np.einsum("apm,nmi->npia", slopes(element), X)
    across = np.cross(T[..., 0], T[..., 1])
    area = np.linalg.norm(across, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        normal = across / area[..., None]
    e1 = _projected(axes[:, None, :], normal)
    local = np.stack([e1, np.cross(normal, e1)], axis=-2)  # (n, points, 2, 3)
    R = np.nan_to_num(local @ T)
    J = np.linalg.det(R)
    R[J == 0.0] = np.eye(2)
    return Geometry(element, T, e1, normal, J, np.linalg.inv(R))


def stiffest(geometry: Geometry, poisson_ratio: Vector) -> Vector:
    r"""Return the largest eigenvalue of stiffness over lumped mass of each element [1/m2], at a wave speed of one.

    Notes
    -----
    Plane stress with E/(1 - nu^2) and the density one. The highest frequency of the assembled mesh is below the largest of
    all elements: Section 7.3.2 of T. J. R. Hughes, The Finite Element Method, Prentice-Hall, 1987. Of equal squares it is
    known, a fifth below that bound: that of waves along a line of elements, of higher order times :math:`1 + \tfrac{1-\nu}2`
    for motion along x that varies along both sides, stretch and shear. Bilinear ones have no such motion; what they get in
    its place is a margin for the accuracy of their steps.
    """
    if geometry.side is not None:
        shear = (1.0 - poisson_ratio) / 2.0 if geometry.element.order > 1 else _BILINEAR + 0.0 * poisson_ratio
        return np.asarray(_of_a_line(geometry.element.order) / geometry.side**2 * (1.0 + shear))
    element, found = geometry.element, []
    gradients = np.einsum("apm,npab->nbpm", slopes(element), geometry.J_inverse)  # by local axes
    size = 2 * len(element.nodes)
    for batch in np.array_split(np.arange(len(geometry.J)), 1 + len(geometry.J) * size**2 // _MEMORY):
        g, w = gradients[batch], geometry.J[batch] * element.w
        nu = poisson_ratio[batch][:, None]
        B = np.zeros((len(batch), 3, g.shape[2], size))
        B[:, 0, :, : size // 2] = B[:, 2, :, size // 2 :] = g[:, 0]
        B[:, 1, :, size // 2 :] = B[:, 2, :, : size // 2] = g[:, 1]
        stress = np.stack([B[:, 0] + nu[..., None] * B[:, 1], B[:, 1] + nu[..., None] * B[:, 0]], axis=1)
        stress = np.concatenate([stress, ((1.0 - nu[..., None]) / 2.0 * B[:, 2])[:, None]], axis=1)
        K = np.einsum("ncpi,np,ncpj->nij", stress, w, B, optimize=True)
        root = np.sqrt(np.tile(geometry.node_areas[batch], 2))
        found.append(np.linalg.eigvalsh(K / (root[:, :, None] * root[:, None, :]))[:, -1])
    return np.concatenate(found)


def values(element: Element) -> Vector:
    """Return the shape functions at the points, shape (points, m)."""
    return _array(element.N, element)


def slopes(element: Element) -> Vector:
    """Return the parent derivatives of the shape functions, shape (2, points, m)."""
    return np.stack([_array(operator, element) for operator in (element.D_s, element.D_t)])


def _array(operator: Operator, element: Element) -> Vector:
    return np.asarray(ca.densify(dense(operator, len(element.nodes))))


@cache
def _of_a_line(order: int) -> float:
    """Return the largest eigenvalue of K - lambda M on a periodic line of two elements of size one."""
    nodes, weights = lobatto_points(order + 1)
    slope = derivative_matrix(nodes, nodes)
    places = [np.arange(order + 1), np.arange(order, 2 * order + 1) % (2 * order)]
    K, M = np.zeros((2 * order, 2 * order)), np.zeros(2 * order)
    for place in places:
        K[np.ix_(place, place)] += slope.T @ np.diag(weights) @ slope
        M[place] += weights
    return float(np.linalg.eigvalsh(K / np.sqrt(np.outer(M, M)))[-1])


def _projected(direction: Vector, normal: Vector) -> Vector:
    """Project directions on tangent planes, unit length; along a normal they give way to another axis."""
    found = direction - np.sum(direction * normal, axis=-1, keepdims=True) * normal
    length = np.linalg.norm(found, axis=-1, keepdims=True)
    lost = length < 1e-6 * np.linalg.norm(direction, axis=-1, keepdims=True)
    if np.any(lost):
        other = np.broadcast_to(np.roll(direction, 1, axis=-1), found.shape)
        instead = other - np.sum(other * normal, axis=-1, keepdims=True) * normal
        found = np.where(lost, instead, found)
        length = np.linalg.norm(found, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        projected: NDArray[np.float64] = found / length
    return projected

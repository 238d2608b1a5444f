"""A square of square elements, in units of its side.

Symbols: ``n`` elements per side, ``m`` nodes of an element, ``i``, ``j`` nodes or elements along x and y, ``s``, ``t``
parent coordinates in an element [1]. Nodes, elements and the nodes of an element are numbered row by row from the corner
nearest to the origin, x fastest, as are the damage zones of Section 7.1 of the thesis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector
from ..errors import ParameterError
from .quadrature import derivative_matrix, lobatto_points, value_matrix

ZONES_PER_SIDE = 4
N_ZONES = ZONES_PER_SIDE**2
MAX_ORDER = 12


@dataclass(frozen=True, eq=False)
class SquareMesh:
    """Nodes, elements and zones of a membrane whose four edges are held.

    Attributes
    ----------
    elements_per_side : int
        Multiple of 4, so that every damage zone is a whole number of elements.
    order : int
        Polynomial order of the elements along their sides.
    nodes : ndarray, shape ((n order + 1)**2, 2)
        Reference coordinates [1], in units of the side.
    elements : ndarray of int, shape (n**2, m)
        Nodes of each element.
    zone : ndarray of int, shape (n**2,)
        Damage zone of each element, 0 to 15.
    interior : ndarray of int, shape ((n order - 1)**2,)
        Nodes that can move; all others lie on the edges.
    """

    elements_per_side: int
    order: int
    nodes: Vector
    elements: NDArray[np.int64]
    zone: NDArray[np.int64]
    interior: NDArray[np.int64]

    @property
    def centre(self) -> int:
        """Place in ``interior`` of the node in the middle of the square."""
        return len(self.interior) // 2

    def locate(self, point: tuple[float, float]) -> tuple[int, tuple[float, float]]:
        r"""Find the element that holds a material point of the mesh.

        Parameters
        ----------
        point : tuple of float
            Reference coordinates [1], 0 to 1.

        Returns
        -------
        int
            Element; the one farther from the origin on a common edge.
        tuple of float
            Parent coordinates :math:`s, t` [1] in the element, -1/2 to 1/2.
        """
        n = self.elements_per_side
        i, j = (min(int(c * n), n - 1) for c in point)
        return i + n * j, (point[0] * n - i - 0.5, point[1] * n - j - 0.5)

    def interpolation(self, points: Sequence[tuple[float, float]], along: str = "") -> ca.DM:
        """Make the matrix that evaluates a nodal field, or its slope, at material points.

        Parameters
        ----------
        points : sequence of tuple of float
            Reference coordinates [1], 0 to 1.
        along : {"", "x", "y"}
            The derivative along this axis, per size of an element; by default the value.

        Returns
        -------
        casadi.DM, sparse, shape (points, nodes)
        """
        nodes, _ = lobatto_points(self.order + 1)
        matrix = np.zeros((len(points), len(self.nodes)))
        for row, point in zip(matrix, points, strict=True):
            element, (s, t) = self.locate(point)
            along_x = (derivative_matrix if along == "x" else value_matrix)(nodes, np.array([s]))
            along_y = (derivative_matrix if along == "y" else value_matrix)(nodes, np.array([t]))
            row[self.elements[element]] = np.kron(along_y, along_x)[0]
        return ca.sparsify(ca.DM(matrix))


def dofs(nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the places of x, y, z of some nodes in a vector that runs node by node, shape (3 nodes,)."""
    return (3 * nodes.reshape(-1, 1) + np.arange(3)).reshape(-1)


def square_mesh(elements_per_side: int = ZONES_PER_SIDE, order: int = 4) -> SquareMesh:
    """Divide the unit square into equal square elements.

    Parameters
    ----------
    elements_per_side : int
        Multiple of 4, at least 4.
    order : int
        Polynomial order of the elements: 1 for bilinear ones, 2 to 12 for spectral ones.

    Returns
    -------
    SquareMesh

    Raises
    ------
    ParameterError
        The number does not fit the 4 x 4 damage zones, or the order is out of range.
    """
    n = elements_per_side
    if not isinstance(n, int) or isinstance(n, bool) or n < ZONES_PER_SIDE or n % ZONES_PER_SIDE:
        msg = f"elements_per_side is {n!r}; the 4 x 4 damage zones need a multiple of 4. Use 4, 8, 12, 16, ..."
        raise ParameterError(msg)
    if not isinstance(order, int) or isinstance(order, bool) or not 1 <= order <= MAX_ORDER:
        msg = f"order is {order!r}; it is 1 for bilinear elements, or 2 to {MAX_ORDER} for spectral ones"
        raise ParameterError(msg)
    per_side = n * order + 1
    j, i = np.divmod(np.arange(per_side**2), per_side)
    row, column = np.divmod(np.arange(n * n), n)
    within = (np.arange(order + 1) + per_side * np.arange(order + 1)[:, None]).reshape(-1)
    parent, _ = lobatto_points(order + 1)
    line = np.append(((np.arange(n)[:, None] + parent[:-1] + 0.5) / n).reshape(-1), 1.0)
    per_zone = n // ZONES_PER_SIDE
    return SquareMesh(
        elements_per_side=n,
        order=order,
        nodes=np.column_stack([line[i], line[j]]),
        elements=order * (column + per_side * row)[:, None] + within,
        zone=column // per_zone + ZONES_PER_SIDE * (row // per_zone),
        interior=np.flatnonzero((i > 0) & (i < per_side - 1) & (j > 0) & (j < per_side - 1)),
    )

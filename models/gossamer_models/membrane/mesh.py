"""A square of four-node elements, in units of its side.

Symbols: ``n`` elements per side, ``i``, ``j`` nodes or elements along x and y, ``s``, ``t`` parent coordinates in an element
[1]. Nodes and elements are numbered row by row from the corner at the origin, x fastest, as are the damage zones of
Section 7.1 of the thesis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector
from ..errors import ParameterError

ZONES_PER_SIDE = 4
N_ZONES = ZONES_PER_SIDE**2


@dataclass(frozen=True, eq=False)
class SquareMesh:
    """Nodes, elements and zones of a membrane whose four edges are held.

    Attributes
    ----------
    elements_per_side : int
        Multiple of 4, so that every damage zone is a whole number of elements.
    nodes : ndarray, shape ((n+1)**2, 2)
        Reference coordinates [1], in units of the side.
    elements : ndarray of int, shape (n**2, 4)
        Nodes of each element, counterclockwise from its corner nearest to the origin.
    zone : ndarray of int, shape (n**2,)
        Damage zone of each element, 0 to 15.
    interior : ndarray of int, shape ((n-1)**2,)
        Nodes that can move; all others lie on the edges.
    """

    elements_per_side: int
    nodes: Vector
    elements: NDArray[np.int64]
    zone: NDArray[np.int64]
    interior: NDArray[np.int64]

    @property
    def centre(self) -> int:
        """Node in the middle of the square."""
        n = self.elements_per_side
        return (n // 2) * (n + 1) + n // 2

    @property
    def interior_grid(self) -> NDArray[np.int64]:
        """Place in ``interior`` of node (i, j), i along x and j along y, shape (n-1, n-1)."""
        n = self.elements_per_side
        return np.arange((n - 1) ** 2).reshape(n - 1, n - 1).T

    def locate(self, point: tuple[float, float]) -> tuple[int, tuple[float, float]]:
        r"""Find the element that holds a material point of the regular mesh.

        Parameters
        ----------
        point : tuple of float
            Reference coordinates [1], 0 to 1.

        Returns
        -------
        int
            Element; the one farther from the origin on a common edge.
        tuple of float
            Parent coordinates :math:`s, t` [1] in the element, -1 to 1.
        """
        n = self.elements_per_side
        i, j = (min(int(c * n), n - 1) for c in point)
        return i + n * j, (2.0 * (point[0] * n - i) - 1.0, 2.0 * (point[1] * n - j) - 1.0)


def dofs(nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the places of x, y, z of some nodes in a vector that runs node by node, shape (3 nodes,)."""
    return (3 * nodes.reshape(-1, 1) + np.arange(3)).reshape(-1)


def square_mesh(elements_per_side: int) -> SquareMesh:
    """Divide the unit square into equal square elements.

    Parameters
    ----------
    elements_per_side : int
        Multiple of 4, at least 4.

    Returns
    -------
    SquareMesh

    Raises
    ------
    ParameterError
        The number does not fit the 4 x 4 damage zones.
    """
    n = elements_per_side
    if not isinstance(n, int) or isinstance(n, bool) or n < ZONES_PER_SIDE or n % ZONES_PER_SIDE:
        msg = f"elements_per_side is {n!r}; the 4 x 4 damage zones need a multiple of 4. Use 4, 8, 12, 16, ..."
        raise ParameterError(msg)
    j, i = np.divmod(np.arange((n + 1) ** 2), n + 1)
    row, column = np.divmod(np.arange(n * n), n)
    corner = column + (n + 1) * row
    per_zone = n // ZONES_PER_SIDE
    return SquareMesh(
        elements_per_side=n,
        nodes=np.column_stack([i, j]) / n,
        elements=np.column_stack([corner, corner + 1, corner + n + 2, corner + n + 1]),
        zone=column // per_zone + ZONES_PER_SIDE * (row // per_zone),
        interior=np.flatnonzero((i > 0) & (i < n) & (j > 0) & (j < n)),
    )

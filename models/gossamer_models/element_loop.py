"""A sum over the elements of a mesh, as compiled code takes it: one element's function, and tables of all elements.

CasADi would write such a sum with every index as text. Instead a function of the same signature stands in for it, whose
body the writer of C replaces by a loop: over blocks of elements in SIMD lanes, see ``fmus/gossamer_fmus/native/loop.h``, or
over elements where a lane is a case, see ``batch/loop.h``.
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from .arrays import Vector

LANES = 4  # elements at once


@dataclass(frozen=True, eq=False)
class ElementLoop:
    """A sum over the n elements of one kind.

    Attributes
    ----------
    name : str
        Of the function that stands in the expression.
    function : casadi.Function
        ``function(x, d, g) -> (f, r, ...)`` of one element: positions of its m nodes, shape (3 m,), all x first; what it
        shares with others, shape (K,); what it has alone, shape (L,); forces on its nodes like x, or none; numbers.
    forces : int
        On how many of its nodes, the first ones, the first result is forces; 0: there is no such result.
    reductions : tuple of str
        What becomes of each number: its ``largest`` or its ``sum`` over all elements.
    n_nodes, columns : int
        Numbers of all nodes, N, and of columns of shared numbers, G.
    nodes : ndarray of int, shape (n, m)
        Nodes of each element.
    shared : ndarray of int, shape (n,)
        Column of the shared numbers of each element.
    own : ndarray, shape (n, L)
        What each element has alone.
    """

    name: str
    function: ca.Function
    forces: int
    reductions: tuple[str, ...]
    n_nodes: int
    columns: int
    nodes: NDArray[np.int64]
    shared: NDArray[np.int64]
    own: Vector

    @cached_property
    def stand_in(self) -> ca.Function:
        """``stand_in(x, d) -> (f, r, ...)`` for the loop: positions of all nodes, shape (3 N,), shared numbers, (K G,)."""
        x, d = ca.MX.sym("x", 3 * self.n_nodes), ca.MX.sym("d", self.function.nnz_in(1) * self.columns)
        # each result depends on each input, or CasADi would leave it out; where the loop does not run, none is a number
        value = (x[0] + d[0]) * np.nan
        outputs = [x[: 3 * self.n_forces] * value] if self.forces else []
        outputs += [value * (i + 1) for i in range(len(self.reductions))]
        return ca.Function(self.name, [x, d], outputs, {"never_inline": True})

    @property
    def n_forces(self) -> int:
        """Number of all nodes that forces act on, the first ones."""
        return self.n_nodes * self.forces // int(self.nodes.shape[1])

    @property
    def batches(self) -> int:
        """Number of blocks of ``LANES`` elements; the last one repeats its last element."""
        return -(-len(self.nodes) // LANES)

    def numbers(self) -> Vector:
        """Return ``own`` block by block, a lane per element."""
        return np.asarray(self._in_lanes(self.own), dtype=np.float64)

    def places(self) -> NDArray[np.int32]:
        """Return the first place of every node in x, then of the shared numbers, block by block."""
        columns = np.column_stack([3 * self.nodes, self.shared * self.function.nnz_in(1)])
        return np.asarray(self._in_lanes(columns), dtype=np.int32)

    def _in_lanes(self, rows: NDArray[np.generic]) -> NDArray[np.generic]:
        padded = rows[np.minimum(np.arange(self.batches * LANES), len(rows) - 1)]
        return padded.reshape(self.batches, LANES, -1).transpose(0, 2, 1).ravel()


@dataclass(frozen=True, eq=False)
class Tables:
    """Arrays that compiled code of a model reads from a file, in place of constants in its text.

    Attributes
    ----------
    numbers : ndarray, shape (n,)
        What the last input of ``init`` and ``step`` holds.
    loops : tuple of ElementLoop
        The loops in them.
    """

    numbers: Vector
    loops: tuple[ElementLoop, ...]

    def content(self) -> bytes:
        """Return all as bytes, little-endian: ``numbers``, those of the loops, then their places as 32-bit integers."""
        numbers = np.concatenate([self.numbers, *(loop.numbers() for loop in self.loops)])
        places = np.concatenate([np.zeros(0, dtype=np.int32), *(loop.places() for loop in self.loops)])
        return numbers.astype("<f8").tobytes() + places.astype("<i4").tobytes()

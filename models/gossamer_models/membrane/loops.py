r"""What one element gives, at its points, and as a function for a loop over all elements of a kind.

Symbols: those of ``element`` and ``assembly``; ``T`` tangents of the stretched element, ``g`` what an element has alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector
from ..element_loop import LANES, ElementLoop
from .element import Element, apply, balance, by_axis, dense, element_points, tangents
from .geometry import stiffest
from .law import Entry, matrix
from .setup import Setup
from .structure import Elements, Structure
from .surface import Integers

Columns: TypeAlias = list[Entry]  # along x, y and z


def at_points(
    setup: Setup, T: NDArray[np.object_], element: Element, w: Entry, shared: dict[str, Entry], limit: Entry, tilt: Entry
) -> tuple[Any, list[Entry], Entry, Entry, Entry]:
    """Return what points add: stress, load, bound of the squared frequency [1/s2], twice the strain, area compressed."""
    at = element_points(T, element, w, {"nu": setup.regions[0].poisson_ratio} | shared)
    k = setup.inplane_mass
    lighter = tilt + (1.0 - tilt) / k  # one over the factor on the inertia that stress along the surface moves
    wave = at.wave if k == 1.0 else ca.fmax(at.wave * lighter, at.wave - 1.0 - at.strain)
    return at.P, at.load, limit * shared["D"] * wave, at.strain, at.compressed


def force_loop(structure: Structure, rank: Integers, number: int, names: Sequence[str], *, compressed: bool) -> ElementLoop:
    """Write the forces of one element of a kind as a function, for all of them in a loop.

    Parameters
    ----------
    structure : Structure
        The membrane.
    rank : ndarray of int, shape (N,)
        Place of each node in the order of the model.
    number : int
        Of the kind.
    names : sequence of str
        What elements share.
    compressed : bool
        Whether the area under compression is a result.
    """
    block = structure.elements[number]
    element, points = block.element, len(block.element.w)
    point, maps = _point(structure, number, names, compressed=compressed)

    x = ca.SX.sym("x", 3 * block.nodes.shape[1])
    columns = tangents(ca.vertsplit(x, block.nodes.shape[1]), element)
    stretches = ca.Function("stretches", [x], [ca.horzcat(*columns.flat).T])
    P, load = ca.SX.sym("P", 6, points), ca.SX.sym("load", 3, points)
    on_nodes = ca.Function("on_nodes", [P, load], [balance(by_axis(P), [load[i, :].T for i in range(3)], element)])
    row = ca.SX.sym("row", 1, points)
    largest = ca.Function("largest", [row], [reduce(ca.fmax, ca.horzsplit(row))])

    x, d, g = symbols = [ca.MX.sym("x", x.numel()), ca.MX.sym("d", len(names)), ca.MX.sym("g", maps + 2)]
    all_points = point.map(points, [False, False, False, True, True, True])
    each = ca.reshape(g[:-2], maps // points, points)
    P, load, rate, strain, *area = all_points(stretches(x), each, ca.DM(element.w).T, d, g[-2], g[-1])
    sums = [on_nodes(P, load), largest(rate), largest(strain), *(ca.sum2(part) for part in area)]
    function = ca.Function(f"element_{number}", symbols, sums)
    return ElementLoop(
        f"forces_{number}",
        function.expand() if element.order <= 1 else function,
        block.nodes.shape[1],
        ("largest", "largest", "sum")[: len(sums) - 1],
        len(rank),
        len(structure.region),
        rank[block.nodes],
        block.combination,
        own_numbers(structure, block),
    )


def element_tangent(structure: Structure, number: int, names: Sequence[str], axes: int = 3) -> ca.Function:
    """Write ``K(x, d, g)``, the derivative of the forces on one element's nodes by their positions, along the first axes.

    The chain rule: derivatives of stress and load at the points, between the operators of the element. Arguments are those
    of ``force_loop``; the shape is (axes m, axes m).
    """
    element = structure.elements[number].element
    m, points = len(element.nodes), len(element.w)
    point, maps = _point(structure, number, names, compressed=False)
    inputs = [ca.SX.sym("i", point.sparsity_in(i)) for i in range(point.n_in())]
    P, load, *_ = point.call(inputs, True, False)
    derivative = ca.jacobian(ca.vertcat(P, load), inputs[0])
    by_tangents = ca.Function("law_derivative", inputs[:4], [ca.densify(derivative)])
    N, *slopes = (dense(operator, m) for operator in (element.N, element.D_s, element.D_t))
    x, d, g = symbols = [ca.MX.sym("x", 3 * m), ca.MX.sym("d", len(names)), ca.MX.sym("g", maps + 2)]
    T = tangents(ca.vertsplit(x, m), element)
    each = ca.reshape(g[:-2], maps // points, points)
    derivatives = by_tangents.map(points, [False, False, False, True])
    A = ca.reshape(derivatives(ca.horzcat(*T.flat).T, each, ca.DM(element.w).T, d), 9, -1)  # 6 columns a point

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


def _point(structure: Structure, number: int, names: Sequence[str], *, compressed: bool) -> tuple[ca.Function, int]:
    """Write ``point(T, g, w, d, limit, tilt)``, what a point of an element adds; return the size of its maps, too."""
    block = structure.elements[number]
    element, points = block.element, len(block.element.w)
    maps = 0 if block.geometry.side is not None else 5 * points
    T, g, w = ca.SX.sym("T", 6), ca.SX.sym("g", maps // points), ca.SX.sym("w")
    d, limit, tilt = ca.SX.sym("d", len(names)), ca.SX.sym("limit"), ca.SX.sym("tilt")
    placed = replace(element, J=g[0], J_inverse=matrix([[g[1], g[2]], [g[3], g[4]]])) if maps else element
    shared = {name: d[i] for i, name in enumerate(names)}
    P, load, *rest = at_points(structure.setup, by_axis(T), placed, w, shared, limit, tilt)
    results = ca.cse([ca.vertcat(*P.flat), ca.vertcat(*load), *rest[: 2 + compressed]])
    return ca.Function("point", [T, g, w, d, limit, tilt], results), maps


def own_numbers(structure: Structure, block: Elements) -> Vector:
    """Return what each element has alone, shape (n, L): maps of its points, limit of its frequency, tilt of its nodes."""
    n = len(block.nodes)
    own = [np.broadcast_to(each(structure, block), n) for each in (limits, tilts)]
    maps = np.zeros((n, 0)) if block.geometry.side is not None else _maps(block.element, n)
    return np.column_stack([maps, *own])


def volume_loop(structure: Structure, rank: Integers, number: int, names: Sequence[str]) -> ElementLoop:
    """Write the volume that one element bounds as a function, for all of a block in a loop."""
    block = structure.elements[number]
    m = block.nodes.shape[1]
    x, d, g = ca.SX.sym("x", 3 * m), ca.SX.sym("d", len(names)), ca.SX.sym("g")
    volume = g * ca.sum1(swept(block.element, ca.vertsplit(x, m)))
    function = ca.Function(f"swept_{number}", [x, d, g], [volume])
    own, nodes = encloses(structure, block)[:, None], rank[block.nodes]
    sizes = len(rank), len(structure.region)
    return ElementLoop(f"volume_{number}", function, 0, ("sum",), *sizes, nodes, block.combination, own)


@dataclass(frozen=True, eq=False)
class NodeLoop:
    """An expression that is the same at each of n nodes: for all of them at once, or in a loop for compiled code.

    Attributes
    ----------
    name : str
        Of the loop.
    write : callable
        ``write(vectors, d, own) -> (vectors, numbers)``: columns of the vectors of a node or of all, before and after; a
        column that all share; what each has alone; numbers that are summed.
    vectors, shared : int
        How many vectors a node has, and the length of ``d``.
    own : ndarray, shape (n,)
        What each has alone.
    """

    name: str
    write: Callable[[list[Columns], ca.MX, Entry], tuple[list[Columns], list[Entry]]]
    vectors: int
    shared: int
    own: Vector

    @cached_property
    def loop(self) -> ElementLoop:
        """The sum over nodes: an element has the vectors of a node as its nodes."""
        k, n = self.vectors, len(self.own)
        x, d, own = ca.SX.sym("x", 3 * k), ca.SX.sym("d", self.shared), ca.SX.sym("own")
        found, numbers = self.write([ca.vertsplit(x[i::k]) for i in range(k)], d, own)
        moved = [ca.vertcat(*(f[axis] for axis in range(3) for f in found), ca.SX(0, 1))] if found else []
        function = ca.Function(f"{self.name}_node", [x, d, own], ca.cse([*moved, *numbers]))
        places, sums = np.arange(n)[:, None] + n * np.arange(k), ("sum",) * len(numbers)
        one = np.zeros(n, dtype=np.int64)
        return ElementLoop(self.name, function, len(found), sums, k * n, 1, places, one, self.own[:, None])

    def __call__(self, vectors: Sequence[ca.MX], d: ca.MX, *, compiled: bool) -> tuple[list[ca.MX], ca.MX]:
        """Return the vectors, shape (3 n,), and the sums, shape (numbers,)."""
        if not compiled:
            found, numbers = self.write([[v[axis::3] for axis in range(3)] for v in vectors], d, ca.DM(self.own))
            return [ca.vec(ca.horzcat(*columns).T) for columns in found], _total(
                numbers, len(self.own)
            ) if numbers else ca.MX.zeros(0)
        results = self.loop.stand_in.call([ca.vertcat(*vectors), d])
        moved = ca.vertsplit(results[0], 3 * len(self.own)) if self.loop.forces else []
        return moved, ca.vertcat(*results[bool(self.loop.forces) :])


def _total(columns: list[ca.MX], n: int) -> ca.MX:
    """Sum each of K columns, shape (n,), in the order of the loop: every lane by itself, then the lanes."""
    blocks = -(-n // LANES)
    rows = ca.vertcat(ca.horzcat(*columns), ca.DM.zeros(blocks * LANES - n, len(columns)))
    of_column = ca.kron(ca.DM.eye(len(columns)), ca.DM.ones(blocks, 1))
    return ca.sum1(ca.mtimes(ca.reshape(rows, LANES, -1), of_column)).T


def swept(element: Element, positions: list[Entry]) -> Entry:
    """Return the volume between the origin and each point's share of the surface."""
    T = tangents(positions, element)
    at = [apply(element.N, column) for column in positions]
    w = ca.repmat(ca.DM(element.w), 1, positions[0].shape[1])
    return w * sum(a * b for a, b in zip(at, np.cross(T[:, 0], T[:, 1]), strict=True)) / 3.0


def limits(structure: Structure, block: Elements) -> Vector | float:
    """Return the squared frequency [1/s2] of the stiffest motion of each element, at a stiffness of 1 N/m."""
    regions, of = structure.setup.regions, structure.region[block.combination]
    nu = np.array([r.poisson_ratio for r in regions])[of]
    return _number(stiffest(block.geometry, nu) / np.array([r.density * r.thickness for r in regions])[of])


def tilts(structure: Structure, block: Elements) -> Vector | float:
    """Return the largest squared sine [1] between the normals of each element and those of its nodes."""
    if structure.setup.inplane_mass == 1.0:
        return 0.0
    return _number(block.geometry.tilts(structure.normals[block.nodes]))


def _number(values: Vector) -> Vector | float:
    """Return one number for all where they are equal but for rounding."""
    return float(values.max()) if np.ptp(values) <= 1e-11 * abs(values.max()) else np.asarray(values)


def encloses(structure: Structure, block: Elements) -> Vector:
    """Return 1 for each element that encloses the gas, else 0."""
    return np.asarray(structure.enclosing[block.combination], dtype=np.float64)


def _maps(element: Element, n: int) -> Vector:
    """Return J and the inverse of the reference map of every point of each element, shape (n, 5 points)."""
    parts = [element.J, *element.J_inverse.flat]
    return np.stack([np.asarray(ca.densify(part)).T for part in parts], axis=-1).reshape(n, -1)

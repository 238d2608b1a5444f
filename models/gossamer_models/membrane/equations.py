r"""The forces of a membrane on a mesh.

Symbols: ``x`` node positions [m], node by node as (x, y, z), shape (3 N,); ``f`` nodal forces [N]; ``D`` = E h/(1 - nu^2)
stiffness [N/m]; ``d`` what the elements of each of the G combinations share, a row of ``rows`` by a column of each, shape
(K, G); ``V`` volume of gas [m3]. All elements of a kind are one expression with a column per element; see
``membrane.element``. For compiled code they are loops over one element's function instead; see ``element_loop``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector
from ..element_loop import ElementLoop
from .assembly import sum_at
from .element import Element, Extras, balance, element_points, tangents
from .law import Entry, matrix
from .setup import Setup
from .structure import Elements, Structure


@dataclass(frozen=True, slots=True)
class Forces:
    """What all elements give.

    Attributes
    ----------
    f : casadi.MX, shape (3 N,)
        Load less stress [N].
    rate : casadi.MX, scalar
        Bound of the square of the highest angular frequency [1/s2].
    strain : casadi.MX, scalar
        Twice the largest principal Green-Lagrange strain [1].
    compressed : casadi.MX, scalar
        Share of the area where the smaller principal stress of Hooke's law is below zero [1].
    """

    f: ca.MX
    rate: ca.MX
    strain: ca.MX
    compressed: ca.MX


def rows(setup: Setup) -> tuple[str, ...]:
    """Name what elements share: always stiffness [N/m] and pressure [Pa], and what else this setup has.

    Twice the eigenstrain [1] along the first local axis, along the second and across; pressure of light [Pa], the share
    that is absorbed and the share that is mirrored, and its direction [1].
    """
    found = ["D", "pressure"]
    if np.ptp([r.poisson_ratio for r in setup.regions]) > 0.0:
        found.append("nu")
    if any(any(r.prestress) or r.thermal_expansion for r in setup.regions):
        found += ["along", "across", "shear"]
    if any(load.kind == "light" for load in setup.loads):
        found += ["absorbed", "mirrored", "light_x", "light_y", "light_z"]
    return tuple(found)


class MeshForces:
    """The forces and the gas volume of a structure as expressions.

    Parameters
    ----------
    structure : Structure
        The membrane.
    compiled : bool
        True: write sums over elements as loops for compiled code. False: as expressions for CasADi's virtual machine.

    """

    def __init__(self, structure: Structure, *, compiled: bool = False) -> None:
        self._structure, self._compiled = structure, compiled
        self._rows = rows(structure.setup)
        blocks = structure.elements if compiled else ()
        self._force_loops = [_force_loop(structure, block, i) for i, block in enumerate(blocks)]
        enclosing = blocks if structure.setup.gas is not None else ()
        self._volume_loops = [_volume_loop(structure, block, i) for i, block in enumerate(enclosing)]

    @property
    def loops(self) -> tuple[ElementLoop, ...]:
        """All loops, in the order in which their tables are stored."""
        return (*self._force_loops, *self._volume_loops)

    def forces(self, x: ca.MX, d: ca.MX) -> Forces:
        r"""Write the nodal forces of stress, follower pressure and light.

        Notes
        -----
        The bound of the frequency is that of the element whose own is highest: ``geometry.stiffest`` times the square of
        the wave speed at its fastest point. With inertia along the surface scaled by k, waves along it are slower by
        sqrt(k), and transverse ones, whose speed is :math:`\sqrt{S/\rho}`, are not. Where an element is tilted against
        the normal of a node, that share of its stress moves the node's own inertia. The bound takes the tilt of the
        reference shape: a surface that turns by more than sqrt(1.8/k) rad against it is beyond the margin of the step.
        """
        if self._compiled:
            calls = [loop.stand_in.call([x, ca.vec(d)]) for loop in self._force_loops]
            parts = [Forces(f, rate, strain, compressed) for f, rate, strain, compressed in calls]
        else:
            parts = [self._block(block, x, d) for block in self._structure.elements]
        found = parts[0]
        for part in parts[1:]:
            rate, strain = ca.fmax(found.rate, part.rate), ca.fmax(found.strain, part.strain)
            found = Forces(found.f + part.f, rate, strain, found.compressed + part.compressed)
        return replace(found, compressed=found.compressed / float(self._structure.areas.sum()))

    def volume(self, x: ca.MX) -> ca.MX:
        r"""Write the volume [m3] that the enclosing faces bound: :math:`\tfrac13 \oint x \cdot n\,\mathrm{d}A`.

        Notes
        -----
        Of an open surface whose edge stays, its change is that of the volume behind it.
        """
        if self._compiled:
            d = ca.MX.zeros(len(self._rows) * len(self._structure.region))  # of which the volume knows nothing
            return sum(loop.stand_in(x, d) for loop in self._volume_loops)
        total = ca.MX(0.0)
        for block in self._structure.elements:
            flags = ca.repmat(ca.DM(_encloses(self._structure, block)).T, len(block.element.w), 1)
            total += ca.sum1(ca.sum2(flags * _swept(block.element, _positions(block, x))))
        return total

    def _block(self, block: Elements, x: ca.MX, d: ca.MX) -> Forces:
        n, points = len(block.nodes), len(block.element.w)
        columns = d[:, block.combination.tolist()]
        shared = {name: ca.repmat(columns[i, :], points, 1) for i, name in enumerate(self._rows)}
        w = ca.repmat(ca.DM(block.element.w), 1, n)
        limit = ca.repmat(ca.DM(_limits(self._structure, block)).T, points, 1)
        tilt = ca.repmat(ca.DM(_tilts(self._structure, block)).T, points, 1)
        positions = _positions(block, x)
        T = tangents(positions, block.element)
        P, load, rate, strain, compressed = _points(self._structure.setup, T, block.element, w, shared, limit, tilt)
        f, rate, strain, compressed = ca.cse([balance(P, load, block.element), rate, strain, compressed])
        f = sum_at(_places(block).reshape(-1), ca.vec(f), 3 * len(self._structure.mesh.nodes))
        return Forces(f, ca.mmax(rate), ca.mmax(strain), ca.sum1(ca.sum2(compressed)))


def _points(
    setup: Setup,
    T: NDArray[np.object_],
    element: Element,
    w: Entry,
    shared: Mapping[str, Entry],
    limit: Entry,
    tilt: Entry,
) -> tuple[Any, list[Entry], Entry, Entry, Entry]:
    """Return what points add: stress, load, bound of the squared frequency [1/s2], twice the strain, area compressed."""
    extras: dict[str, Any] = {}
    if "along" in shared:
        shear = shared["shear"]
        extras["eigenstrain"] = matrix([[shared["along"], shear], [shear, shared["across"]]])
    if "absorbed" in shared:
        light = [shared[f"light_{axis}"] for axis in "xyz"]
        extras |= {"light": light, "absorbed": shared["absorbed"], "mirrored": shared["mirrored"]}
    nu = shared.get("nu", setup.regions[0].poisson_ratio)
    at = element_points(T, element, w, shared["D"], nu, shared["pressure"], Extras(**extras))
    k = setup.inplane_mass
    lighter = tilt + (1.0 - tilt) / k  # one over the factor on the inertia that stress along the surface moves
    wave = at.wave if k == 1.0 else ca.fmax(at.wave * lighter, at.wave - 1.0 - at.strain)
    return at.P, at.load, limit * shared["D"] * wave, at.strain, at.compressed


def _force_loop(structure: Structure, block: Elements, number: int) -> ElementLoop:
    """Write the forces of one element of a block as a function, for all of them in a loop."""
    names, element = rows(structure.setup), block.element
    m, points = block.nodes.shape[1], len(element.w)
    T, g, w = ca.SX.sym("T", 6), ca.SX.sym("g", 5), ca.SX.sym("w")
    d, limit, tilt = ca.SX.sym("d", len(names)), ca.SX.sym("limit"), ca.SX.sym("tilt")
    placed = replace(element, J=g[0], J_inverse=matrix([[g[1], g[2]], [g[3], g[4]]]))
    shared = {name: d[i] for i, name in enumerate(names)}
    stretched = matrix([[T[2 * i + a] for a in range(2)] for i in range(3)])
    P, load, *rest = _points(structure.setup, stretched, placed, w, shared, limit, tilt)
    point = ca.Function("point", [T, g, w, d, limit, tilt], ca.cse([ca.vertcat(*P.flat), ca.vertcat(*load), *rest]))

    x = ca.SX.sym("x", 3 * m)
    at_points = ca.Function("at_points", [x], [ca.horzcat(*tangents(ca.vertsplit(x, m), element).flat).T])
    P, load = ca.SX.sym("P", 6, points), ca.SX.sym("load", 3, points)
    by_axis = matrix([[P[2 * i + a, :].T for a in range(2)] for i in range(3)])
    on_nodes = ca.Function("on_nodes", [P, load], [balance(by_axis, [load[i, :].T for i in range(3)], element)])

    symbols = [ca.MX.sym("x", 3 * m), ca.MX.sym("d", len(names)), ca.MX.sym("g", 5 * points + 2)]
    x, d, g = symbols
    all_points = point.map(points, [False, False, False, True, True, True])
    maps = ca.reshape(g[:-2], 5, points)
    P, load, rate, strain, compressed = all_points(at_points(x), maps, ca.DM(element.w).T, d, g[-2], g[-1])
    row = ca.SX.sym("row", 1, points)
    largest = ca.Function("largest", [row], [reduce(ca.fmax, ca.horzsplit(row))])
    results = [on_nodes(P, load), largest(rate), largest(strain), ca.sum2(compressed)]
    function = ca.Function(f"element_{number}", symbols, results)
    return ElementLoop(
        f"forces_{number}",
        function.expand() if element.order <= 1 else function,
        True,
        ("largest", "largest", "sum"),
        len(structure.mesh.nodes),
        len(structure.region),
        block.nodes,
        block.combination,
        np.column_stack([_maps(element, len(block.nodes)), _limits(structure, block), _tilts(structure, block)]),
    )


def _volume_loop(structure: Structure, block: Elements, number: int) -> ElementLoop:
    m = block.nodes.shape[1]
    x, d, g = ca.SX.sym("x", 3 * m), ca.SX.sym("d", len(rows(structure.setup))), ca.SX.sym("g")
    swept = g * ca.sum1(_swept(block.element, ca.vertsplit(x, m)))
    function = ca.Function(f"swept_{number}", [x, d, g], [swept])
    own = _encloses(structure, block)[:, None]
    sizes = len(structure.mesh.nodes), len(structure.region)
    return ElementLoop(f"volume_{number}", function, False, ("sum",), *sizes, block.nodes, block.combination, own)


def _swept(element: Element, positions: list[Entry]) -> Entry:
    """Return the volume [m3] between the origin and each point's share of the surface."""
    T = tangents(positions, element)
    at = [_values(element, column) for column in positions]
    w = ca.repmat(ca.DM(element.w), 1, positions[0].shape[1])
    return w * sum(a * b for a, b in zip(at, np.cross(T[:, 0], T[:, 1]), strict=True)) / 3.0


def _limits(structure: Structure, block: Elements) -> Vector:
    """Return the squared frequency [1/s2] of the stiffest motion of each element, at a stiffness of 1 N/m."""
    areal = np.array([r.density * r.thickness for r in structure.setup.regions])[structure.region]
    return np.asarray(block.stiffest / areal[block.combination])


def _tilts(structure: Structure, block: Elements) -> Vector:
    """Return the largest squared sine [1] between the normals of each element and those of its nodes."""
    across = block.node_normals / np.linalg.norm(block.node_normals, axis=2, keepdims=True)
    cosine = np.sum(across * structure.normals[block.nodes], axis=2)
    return np.asarray(np.max(1.0 - cosine**2, axis=1).clip(0.0))


def _encloses(structure: Structure, block: Elements) -> Vector:
    return np.asarray(structure.enclosing[block.combination], dtype=np.float64)


def _maps(element: Element, n: int) -> Vector:
    """Return J and the inverse of the reference map of every point of each element, shape (n, 5 points)."""
    parts = [element.J, *element.J_inverse.flat]
    return np.stack([np.asarray(ca.densify(part)).T for part in parts], axis=-1).reshape(n, -1)


def _places(block: Elements) -> NDArray[np.int64]:
    """Return the places in x of x of the nodes of each element, then y, then z, shape (n, 3 m)."""
    return (3 * block.nodes[:, None, :] + np.arange(3)[:, None]).reshape(len(block.nodes), -1)


def _positions(block: Elements, x: ca.MX) -> list[ca.MX]:
    columns = ca.reshape(x[_places(block).reshape(-1).tolist()], -1, len(block.nodes))
    found: list[ca.MX] = ca.vertsplit(columns, block.nodes.shape[1])
    return found


def _values(element: Element, column: Entry) -> Entry:
    for factor in element.N:
        column = ca.mtimes(factor, column)
    return column

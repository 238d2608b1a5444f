r"""The equations of motion of a membrane: elements assembled on a mesh.

Symbols: ``x`` node positions from the membrane's origin [m], node by node as (x, y, z), shape (3 N,), and ``q``
displacements of the M nodes that move [m], shape (3 M,), both in the order of ``Structure.order``; ``f`` nodal forces [N];
``D`` = E t/(1 - nu^2) stiffness [N/m], ``t`` thickness [m]; ``shared`` what elements share, by name: one number for all, or
a column for each of the G combinations, shape (1, G); ``V`` volume of gas [m3]; ``u`` inputs and ``p`` parameters by name.

Damage of a zone takes its share of Young's modulus, Section 7.1 of the thesis. All elements of a kind are one expression
with a column per element; see ``element``. For compiled code they are loops over one element's function instead, and arrays
are parts of a table; see ``loops``. Equal squares are computed in units of their side, where their reference map is one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector
from ..element_loop import ElementLoop, Tables
from ..variables import Values
from .element import balance, sum_at, tangents
from .geometry import stiffest
from .loops import at_points, element_tangent, encloses, force_loop, limits, own_numbers, swept, tilts, volume_loop
from .setup import LEFT, Load
from .structure import Elements, Structure

Shared: TypeAlias = dict[str, ca.MX]
_PER_LENGTH = ("pressure", "onward", "mirrored", "scattered", "emitted")  # forces by length in the units of an element
LAMBERT = 2.0 / 3.0  # mean cosine [1] of what a surface radiates by Lambert's law, weighted by it


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


class MembraneEquations:
    """Positions, forces, volume and masses of a structure as expressions.

    Parameters
    ----------
    structure : Structure
        The membrane.
    compiled : bool
        True: write sums over elements as loops for compiled code. False: as expressions for CasADi's virtual machine.
    mapped : bool
        Expressions that map one element's function, whose code is small, rather than those that are fast.
    rest : ndarray, shape (3 M,), optional
        Displacements [m] in which the search for an equilibrium begins.

    Attributes
    ----------
    n_q : int
        Number of displacements, 3 M.
    column : casadi.MX or None
        Table of all arrays but those of the elements, if compiled.
    loops : list of ElementLoop
        The loops of compiled code.
    """

    def __init__(
        self, structure: Structure, *, compiled: bool = False, mapped: bool = False, rest: Vector | None = None
    ) -> None:
        self.structure, self._compiled, self._is_mapped = structure, compiled, mapped
        self.n_q = 3 * len(structure.moving)
        self._rank = np.argsort(structure.order)
        arrays = _arrays(structure) | {"rest": np.zeros(self.n_q) if rest is None else rest}
        self._numbers = np.concatenate([*arrays.values()])
        self.column = ca.MX.sym("t", self._numbers.size) if compiled else None
        self.arrays = _named(arrays, self.column)
        self._table = {v.name for v in structure.table}
        blocks = range(len(structure.elements) if compiled or mapped else 0)
        compressed = "compressed_share" in self._table
        own = structure, self._rank
        self._force_loops = [force_loop(*own, i, self.shared_names, compressed=compressed) for i in blocks]
        on_lines = np.unique(np.concatenate([np.zeros(0, dtype=int), *(parts.nodes.ravel() for parts in structure.lines)]))
        of_lines = len(structure.setup.lines), 1 + bool(structure.setup.warm_lines)
        self._line_loops = [parts.loop(on_lines, *of_lines) for parts in structure.lines]
        self._on_lines = (3 * self._rank[on_lines][:, None] + np.arange(3)).ravel().tolist()
        enclosing = blocks if structure.setup.gas is not None else ()
        self._volume_loops = [volume_loop(*own, i, self.shared_names) for i in enclosing]
        self.loops = [*self._force_loops, *self._line_loops, *self._volume_loops]

    @property
    def tables(self) -> Tables | None:
        """What compiled code reads from a file."""
        return Tables(self._numbers, tuple(self.loops)) if self._compiled else None

    def size(self, p: Values) -> Any:  # noqa: ANN401
        """Return the factor on all lengths of the mesh [1]."""
        return p.side_length / self.structure.mesh.size if hasattr(p, "side_length") else 1.0

    def shortness(self, p: Values) -> Any:  # noqa: ANN401
        """Return one over it [1]: a vector is multiplied in a fraction of the time that it is divided in."""
        return self.structure.mesh.size / p.side_length if hasattr(p, "side_length") else 1.0

    def mass(self, p: Values) -> ca.MX:
        """Return the mass of each node [kg], all nodes, shape (N,)."""
        return self.arrays["mass"] / self.lightness(p)

    def lightness(self, p: Values) -> Any:  # noqa: ANN401
        """Return one over the factor on all masses of the structure [1]."""
        numbers = self._share(p, "density") * self._share(p, "thickness") * self.shortness(p) ** 2
        return numbers / (self.factor(p, "density") * self.factor(p, "thickness"))

    def factor(self, p: Values, name: str) -> Any:  # noqa: ANN401
        """Return the factor on a number of the setup [1]; 1 if it is no parameter."""
        return getattr(p, f"{name}_factor", 1.0)

    def positions(self, q: ca.MX, u: Values, p: Values) -> ca.MX:
        """Write the positions of all nodes [m], shape (3 N,)."""
        moving, held = self._still(u, p, self.parted)
        return ca.vertcat(moving + q, held)

    def positions_at(self, places: Sequence[int], q: ca.MX, u: Values, p: Values) -> ca.MX:
        """Write some of the positions [m], which costs less than taking them from all."""
        (still,) = self._still(u, p, lambda array: [array[places]])
        moving = [i for i, place in enumerate(places) if place < self.n_q]
        moved = ca.MX.zeros(len(places))
        moved[moving] = q[[places[i] for i in moving]]
        return still + moved

    def parted(self, x: ca.MX) -> list[ca.MX]:
        """Part a column of all nodes, shape (3 N,), into those that move and those that are held; nothing is copied."""
        parts: list[ca.MX] = ca.vertsplit(x, [0, self.n_q, x.numel()])
        return parts

    def _still(self, u: Values, p: Values, part: Callable[[ca.MX], list[ca.MX]]) -> list[ca.MX]:
        """Write parts of the positions [m] of nodes that are not displaced."""
        found = [self.size(p) * each for each in part(self.arrays["start"])]
        for i, support in enumerate(self.structure.setup.supports):
            if support.motion:
                motion = getattr(u if hasattr(u, support.motion) else p, support.motion)
                found = [x + motion * way for x, way in zip(found, part(self.arrays[f"way_{i}"]), strict=True)]
        return found

    def filled(self, u: Values) -> ca.MX:
        """Write the pressure of the gas at its volume of the start, with the ambient one [Pa]."""
        gas = self.structure.setup.gas
        return (gas.pressure + gas.ambient) * u.gas_amount if gas else ca.MX(0.0)

    def gas_of_start(self, u: Values) -> ca.MX:
        """Write the pressure of the gas at its volume of the start [Pa]."""
        return self.filled(u) - (self.structure.setup.gas.ambient if self.structure.setup.gas else 0.0)

    def shared(self, u: Values, p: Values, built_in: ca.MX, gas: ca.MX) -> Shared:
        """Write what elements share, with the built-in pressure and that of the gas [Pa]."""
        setup, region = self.structure.setup, self.structure.region.tolist()

        def of_region(values: Any) -> Any:  # noqa: ANN401
            if len(setup.regions) == 1:
                return values[0]
            return (ca.MX(ca.DM(values)) if isinstance(values, np.ndarray) else values)[region].T

        def on(acts: NDArray[np.bool_]) -> Any:  # noqa: ANN401
            return 1.0 if acts.all() else ca.DM(acts.astype(float)).T

        nu, t = (self._material(p, name, of_region) for name in ("poisson_ratio", "thickness"))
        t *= self.factor(p, "thickness")
        E = of_region(p.youngs_modulus)
        left = 1.0
        if self.structure.zone_names:
            left = 1.0 - ca.vertcat(u.damage, 0.0)[self.structure.zone.tolist()].T  # the last is that of no zone
        values = {"D": E * left * (t / (1.0 - nu**2)), "nu": nu}
        for name in LEFT if setup.directional else ():
            left = getattr(u, name)
            parts = len(self.structure.zone_names) // left.numel()  # of a zone, where these have damage of their own
            values[name] = ca.vertcat(left, 1.0)[(self.structure.zone // parts).tolist()].T
        pressure, oscillates = ca.MX(0.0), True
        if self.structure.enclosing.any():
            pressure += on(self.structure.enclosing) * gas
        for load, acts in zip(setup.loads, self.structure.loaded, strict=True):
            if load.kind == "pressure":
                pressure += on(acts) * (getattr(u, load.name) + (built_in if oscillates else 0.0))
                oscillates = False
            elif load.kind == "light":
                values |= _lit(load, setup.lights.index(load), on(acts), u)
        values["pressure"] = pressure
        if "along" in self.shared_names:
            factor = self.factor(p, "prestress")
            S = [factor * of_region(np.array([r.prestress[k] for r in setup.regions])) for k in range(3)]
            expansion = np.array([r.thermal_expansion for r in setup.regions])
            warm = 2.0 * of_region(expansion) * self._warmth(of_region(u.temperature), u) if setup.warms else 0.0
            for a, name in enumerate(("along", "across")):
                values[name] = 2.0 * (S[a] - nu * S[1 - a]) / E - warm
            values["shear"] = 2.0 * (1.0 + nu) * S[2] / E
        return {name: values[name] for name in self.shared_names}

    def _warmth(self, of_region: ca.MX, u: Values) -> ca.MX:
        """Write the temperature of each combination [K], of its region and its zone over that."""
        if not hasattr(u, "zone_temperature"):
            return of_region
        parts = self.structure.n_face_zones // u.zone_temperature.numel()  # of a zone, where these have damage of their own
        rises = ca.vertcat(u.zone_temperature, 0.0)  # the last is of no zone
        return of_region + rises[(self.structure.zone // parts).tolist()].T

    @property
    def shared_names(self) -> tuple[str, ...]:
        """Name what elements share: always stiffness [N/m] and pressure [Pa], and what else this setup has.

        Poisson's ratio [1]; twice the eigenstrain [1] along the first local axis, along the second and across; shares of the
        stiffness [1] that are left along both axes; of each light its pressures [Pa] and direction [1], see
        ``element.light``.
        """
        setup, found = self.structure.setup, ["D", "pressure"]
        if np.ptp([r.poisson_ratio for r in setup.regions]) > 0.0 or "poisson_ratio" in self._table:
            found.append("nu")
        if setup.warms or any(any(r.prestress) for r in setup.regions):
            found += ["along", "across", "shear"]
        if setup.directional:
            found += LEFT
        for k, load in enumerate(setup.lights):
            around = ("scattered", "emitted") if load.glows else ()
            found += [f"{name}_{k}" for name in ("onward", "mirrored", "light_x", "light_y", "light_z", *around)]
        return tuple(found)

    def spring_stiffness(self, p: Values) -> ca.MX:
        """Write the stiffness of springs at each displacement that is not held [N/m], shape (3 M,)."""
        each = ca.vertsplit(p.support_stiffness) if self.structure.setup.springs else []
        return sum((k * self.arrays[f"spring_{i}"] for i, k in enumerate(each)), ca.MX.zeros(self.n_q))

    def forces(self, x: ca.MX, shared: Shared, u: Values, p: Values) -> Forces:
        r"""Write the nodal forces of stress, follower pressure, light and springs.

        Notes
        -----
        The bound of the frequency is that of the element whose own is highest: ``geometry.stiffest`` times the square of
        the wave speed at its fastest point. Springs add the largest
        of theirs on lumped masses. With inertia along the surface scaled by k, waves along it are slower by
        sqrt(k), and transverse ones, whose speed is :math:`\sqrt{S/\rho}`, are not. Where an element is tilted against
        the normal of a node, that share of its stress moves the node's own inertia. The bound takes the tilt of the
        reference shape: a surface that turns by more than sqrt(1.8/k) rad against it is beyond the margin of the step.
        """
        parts = []
        for i, block in enumerate(self.structure.elements):
            side = block.geometry.side or 1.0
            unit, per_unit = side * self.size(p), self.shortness(p) / side
            own = _in_units(shared, unit)
            if self._compiled or self._is_mapped:
                sums = self._looped if self._compiled else self._mapped
                f, rate, strain, *rest = sums(self._force_loops[i], per_unit * x, self._columns(own))
                found = Forces(f, rate, strain, rest[0] if rest else ca.MX(0.0))
            else:
                found = self._at_once(block, per_unit * x, own)
            parts.append(replace(found, f=unit * found.f, compressed=side**2 * found.compressed))
        total = parts[0]
        for part in parts[1:]:
            rate, strain = ca.fmax(total.rate, part.rate), ca.fmax(total.strain, part.strain)
            total = Forces(total.f + part.f, rate, strain, total.compressed + part.compressed)
        area = float(self.structure.areas.sum())
        total = replace(total, rate=self._quickening(p) * total.rate, compressed=total.compressed / area)
        if self._line_loops:
            total = self._with_lines(total, x, u, p)
        if not self.structure.setup.springs:
            return total
        k = self.spring_stiffness(p)
        moving, held = self.parted(x)
        pull = k * (moving - self._still(u, p, self.parted)[0])
        rate = self.lightness(p) * ca.mmax(k * self.arrays["mobility"])
        return replace(total, f=total.f - ca.vertcat(pull, ca.MX.zeros(held.numel())), rate=total.rate + rate)

    def _with_lines(self, total: Forces, x: ca.MX, u: Values, p: Values) -> Forces:
        """Add what cables and beams give; the bounds of their squared frequencies add up."""
        d, x, f, strain, rate = self._of_lines(u), x[self._on_lines], ca.MX(total.f), total.strain, ca.MX(0.0)
        for loop in self._line_loops:
            pull, each, *more = self._looped(loop, x, d) if self._compiled else self._mapped(loop, x, d)
            f[self._on_lines] += pull
            strain = ca.fmax(strain, *more) if more else strain
            rate += self.lightness(p) * each
        rate = total.rate + rate if self.structure.adds_lines else ca.fmax(total.rate, rate)
        return replace(total, f=f, rate=rate, strain=strain)

    def _of_lines(self, u: Values) -> ca.MX:
        """Write the share of the stiffness that is left in each beam and cable [1], and its expansion [1] if one expands."""
        zone, setup = self.structure.line_zone, self.structure.setup
        left = 1.0 - ca.vertcat(u.damage, 0.0)[zone.tolist()].T if np.any(zone >= 0) else ca.MX.ones(1, len(zone))
        if not setup.warm_lines:
            return left
        expansion = np.array([line.thermal_expansion for line in setup.lines])
        own = np.maximum(np.cumsum(expansion != 0.0) - 1, 0) + (len(setup.regions) if setup.warms else 0)
        return ca.vertcat(left, (ca.DM(expansion) * u.temperature[own.tolist()]).T)

    def volume(self, x: ca.MX) -> ca.MX:
        r"""Write the volume [m3] that the enclosing faces bound: :math:`\tfrac13 \oint x \cdot n\,\mathrm{d}A`.

        Notes
        -----
        Of an open surface whose edge stays, its change is that of the volume behind it.
        """
        if self._compiled:
            d = ca.MX.zeros(len(self.shared_names) * len(self.structure.region))  # of which the volume knows nothing
            return sum(loop.stand_in(x, d) for loop in self._volume_loops)
        total = ca.MX(0.0)
        for block in self.structure.elements:
            flags = ca.repmat(ca.DM(encloses(self.structure, block)).T, len(block.element.w), 1)
            total += ca.sum1(ca.sum2(flags * swept(block.element, self._positions(block, x))))
        return total

    def filled_volume(self, bounded: ca.MX, start: ca.MX) -> ca.MX:
        """Write the volume of the gas [m3], with what lies behind an open surface; ``start``: what was bounded at first."""
        given = self.structure.setup.gas.volume if self.structure.setup.gas else None
        return bounded if given is None else bounded - start + given

    def gas_mobility(self) -> float:
        r"""Return :math:`\sum A_i^2/m_i` [m4/kg] of nodes that enclose gas: with its stiffness, a squared frequency."""
        structure = self.structure
        areas = np.zeros((len(structure.mesh.nodes), 3))
        for block in structure.elements:
            on = structure.enclosing[block.combination]
            np.add.at(areas, block.nodes[on], block.geometry.node_normals[on])
        return float(np.sum(structure.free.reshape(-1, 3) * areas**2 / np.maximum(structure.mass[:, None], 1e-300)))

    def tangents(self, x: ca.MX, shared: Shared, u: Values, p: Values, axes: int = 3) -> list[ca.MX]:
        """Write the derivative of the forces [N/m] of the elements of each kind by their nodes' positions, side by side.

        Shape (axes m, axes m n), along x of all nodes first; see ``places`` for where they belong.
        """
        found = []
        for i, block in enumerate(self.structure.elements):
            side = block.geometry.side or 1.0
            unit = side * self.size(p)
            d = self._columns(_in_units(shared, unit))
            each = element_tangent(self.structure, i, self.shared_names, axes).map(len(block.nodes), "serial")
            at = ca.vertcat(*self._positions(block, self.shortness(p) / side * x))
            numbers = ca.DM(own_numbers(self.structure, block)).T
            found.append(each(at, d[:, block.combination.tolist()], numbers))
        for loop in self._line_loops:
            arguments = [ca.SX.sym("i", loop.function.size1_in(i)) for i in range(3)]
            slope = ca.densify(ca.jacobian(loop.function.call(arguments)[0], arguments[0]))
            each = ca.Function("line_tangent", arguments, [slope]).map(len(loop.nodes), "serial")
            at = ca.reshape(x[self._on_lines][_places(loop.nodes).reshape(-1).tolist()], -1, len(loop.nodes))
            found.append(each(at, self._of_lines(u)[:, loop.shared.tolist()], ca.DM(loop.own).T))
        return found

    def places(self, nodes: NDArray[np.int64], axes: int = 3) -> NDArray[np.int64]:
        """Return the places in q of the displacements of each element, ``n_q`` of those that are held, shape (n, axes m)."""
        node = self._rank[nodes]
        row = np.where(node < self.n_q // 3, axes * node, self.n_q // 3 * axes)[:, None, :] + np.arange(axes)[:, None]
        return np.minimum(row, self.n_q // 3 * axes).reshape(len(node), -1)

    def _share(self, p: Values, name: str) -> Any:  # noqa: ANN401
        """Return the number of the setup over a parameter [1]; 1 if it is none."""
        return getattr(self.structure.setup.regions[0], name) / getattr(p, name) if hasattr(p, name) else 1.0

    def _material(self, p: Values, name: str, of_region: Any) -> Any:  # noqa: ANN401
        if hasattr(p, name):
            return getattr(p, name)
        values = np.array([getattr(region, name) for region in self.structure.setup.regions])
        return float(values[0]) if np.ptp(values) == 0.0 else of_region(values)

    def _quickening(self, p: Values) -> Any:  # noqa: ANN401
        """Return the factor on the squared frequencies [1], but for the stiffness, of parameters against the setup.

        That of Poisson's ratio is convex, so its chords are above it.
        """
        factor = self.lightness(p)
        if not hasattr(p, "poisson_ratio"):
            return factor
        at, chords = self.structure.setup.regions[0].poisson_ratio, []
        for end in {-0.9, 0.499} - {at}:
            ratios = [
                np.max(stiffest(g, np.full(len(g.J), end)) / stiffest(g, np.full(len(g.J), at)))
                for g in (block.geometry for block in self.structure.elements)
            ]
            chords.append(1.0 + (max(ratios) - 1.0) / (end - at) * (p.poisson_ratio - at))
        return factor * ca.fmax(*chords)

    def _at_once(self, block: Elements, x: ca.MX, shared: Shared) -> Forces:
        """Write the forces of all elements of a kind as one expression."""
        n, points = len(block.nodes), len(block.element.w)
        combination = block.combination.tolist()
        spread = {
            name: value if ca.MX(value).is_scalar() else ca.repmat(value[:, combination], points, 1)
            for name, value in shared.items()
        }
        limit, tilt = (
            ca.repmat(ca.DM(value).T, points, 1) if isinstance(value, np.ndarray) else value
            for value in (limits(self.structure, block), tilts(self.structure, block))
        )
        T = tangents(self._positions(block, x), block.element)
        w = ca.repmat(ca.DM(block.element.w), 1, n)
        P, load, rate, strain, compressed = at_points(self.structure.setup, T, block.element, w, spread, limit, tilt)
        f, rate, strain, compressed = ca.cse([balance(P, load, block.element), rate, strain, compressed])
        f = sum_at(_places(self._rank[block.nodes]).reshape(-1), ca.vec(f), 3 * len(self._rank))
        return Forces(f, ca.mmax(rate), ca.mmax(strain), ca.sum1(ca.sum2(compressed)))

    def _mapped(self, loop: ElementLoop, x: ca.MX, columns: ca.MX) -> list[ca.MX]:
        """Write the forces as a map of one element's function, whose C is small and in lanes fast without expansion."""
        places = _places(loop.nodes).reshape(-1)
        elements = ca.reshape(x[places.tolist()], -1, len(loop.nodes))
        each = loop.function.map(len(loop.nodes))
        f, *numbers = each(elements, columns[:, loop.shared.tolist()], ca.DM(loop.own).T)
        reduced = {"largest": ca.mmax, "sum": ca.sum2}
        numbers = [reduced[kind](row) for kind, row in zip(loop.reductions, numbers, strict=True)]
        return [sum_at(places, ca.vec(f), 3 * loop.n_nodes), *numbers]

    def _looped(self, loop: ElementLoop, x: ca.MX, columns: ca.MX) -> list[ca.MX]:
        found: list[ca.MX] = loop.stand_in.call([x, ca.vec(columns)])
        return found

    def _columns(self, shared: Shared) -> ca.MX:
        """Return what elements share as one matrix, a column for each combination."""
        columns = len(self.structure.region)
        return ca.vertcat(*(ca.repmat(v, 1, columns) if ca.MX(v).is_scalar() else v for v in shared.values()))

    def _positions(self, block: Elements, x: ca.MX) -> list[ca.MX]:
        columns = ca.reshape(x[_places(self._rank[block.nodes]).reshape(-1).tolist()], -1, len(block.nodes))
        found: list[ca.MX] = ca.vertsplit(columns, block.nodes.shape[1])
        return found


def _in_units(shared: Shared, unit: Any) -> Shared:  # noqa: ANN401
    """Return what elements share where their own unit of length is so many metres."""
    return {name: value * unit if name.partition("_")[0] in _PER_LENGTH else value for name, value in shared.items()}


def _lit(light: Load, k: int, acts: Any, u: Values) -> Shared:  # noqa: ANN401
    """Write what elements share of light k of the setup, by name, where it acts."""
    value = acts * getattr(u, light.name) * (1.0 - getattr(u, f"{light.name}_eclipse"))
    found = {f"onward_{k}": (1.0 - light.reflectivity) * value, f"mirrored_{k}": light.reflectivity * value}
    along = getattr(u, f"{light.name}_direction")
    direction = ca.vertsplit(along / ca.fmax(ca.norm_2(along), 1e-300))
    found |= {f"light_{axis}_{k}": part for axis, part in zip("xyz", direction, strict=True)}
    front, back = light.emissivity
    absorbed = 1.0 - light.reflectivity - light.diffuse
    found[f"scattered_{k}"] = LAMBERT * light.diffuse * value
    return found | {f"emitted_{k}": LAMBERT * absorbed * (front - back) / (front + back) * value}


def _arrays(structure: Structure) -> dict[str, Vector]:
    """Return the arrays of the expressions by name, all but those of the elements, in the order of the model."""
    order, moving = structure.order, structure.moving
    static = [not support.motion for support in structure.setup.supports]

    def of_nodes(values: Vector) -> Vector:
        return np.asarray(values.reshape(-1, 3)[order].ravel())

    nodes = (structure.mesh.nodes - structure.origin).ravel()
    found = {
        "nodes": of_nodes(nodes),
        "start": of_nodes(nodes + sum(structure.ways[static])),
        "free": structure.free.reshape(-1, 3)[moving].ravel().astype(float),
        "mass": structure.mass[order],
        "stiffness": np.repeat(structure.stiffness[moving], 3),
        "mobility": (structure.free.reshape(-1, 3)[moving] / structure.mass[moving, None]).ravel(),
    }
    if structure.setup.inplane_mass > 1.0:
        found["slowing"] = structure.slowing[moving].ravel()
    found |= {f"spring_{i}": row.reshape(-1, 3)[moving].ravel() for i, row in enumerate(structure.springs)}
    motions = enumerate(structure.setup.supports)
    found |= {f"way_{i}": of_nodes(structure.ways[i]) for i, support in motions if support.motion}
    if structure.edge_force.any():
        found["edge_force"] = of_nodes(structure.edge_force)
    return found | {f"unit_{name}": of_nodes(force) for name, force in structure.unit_forces.items()}


def _named(arrays: dict[str, Vector], column: ca.MX | None) -> dict[str, ca.MX]:
    """Return the arrays as constants, or as parts of a column that holds them one after another."""
    if column is None:
        return {name: ca.MX(ca.DM(array)) for name, array in arrays.items()}
    ends = np.cumsum([0, *(array.size for array in arrays.values())]).tolist()
    return dict(zip(arrays, ca.vertsplit(column, ends), strict=True))


def _places(nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the places in x of x of the nodes of each element, then y, then z, shape (n, 3 m)."""
    return (3 * nodes[:, None, :] + np.arange(3)[:, None]).reshape(len(nodes), -1)

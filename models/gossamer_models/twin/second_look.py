r"""A second look at a fit: what it does not know that would explain the residuals better.

Symbols: ``W`` weighed columns of a group of causes, ``J`` weighed derivatives by the unknowns, ``r`` residuals; ``s`` scale
of a group; ``G`` = W M W^T, where M takes from readings what the unknowns explain.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Matrix, Vector
from ..errors import ParameterError
from ..membrane import make_structure
from ..membrane.boundary import members_of
from ..membrane.gauges import BESIDE, beside, moved_gauge
from ..membrane.interface import mesh_variables
from ..membrane.setup import Load, Setup
from ..membrane.structure import stretched_evenly
from ..membrane.surface import refined
from ..membrane.zones import Zone
from ..mistakes import DescriptionError
from ..variables import Variable
from .forward import Forward, MembraneForward
from .least_squares import MOST_DAMAGE, change
from .nuisances import DEGREE, spline_basis
from .problem import RecordProblem
from .reasons import WORTH
from .search import Fit, again, box
from .weights import scale_evidence
from .zone_sets import LIKELY, NEAR, drop_zones, price

PARTS = 4  # of a zone
WAYS = np.array([[1.0, 1.0, -1.0, -1.0], [1.0, -1.0, 1.0, -1.0], [1.0, -1.0, -1.0, 1.0]])  # from the mean of a zone's damage
STRIPS = 4  # of a tilted pressure, along each axis
STEP = 1e-3  # of damage and of pressure for a difference
KNOT = 1.0 / 300.0  # [s] between knots of a pressure that flickers
CERTAIN = 9.0  # of twice the logarithm of the evidence: what a cause must explain
HOPELESS = 3.0  # chi2 per sample of which no cause explains enough
SCALES = np.geomspace(1e-4, 1.0, 33)  # deviations of a cause: shares of a zone's damage, of the pressure, of the size
LEAST_PARTED = 0.05  # damage of a zone whose parts may differ by as much
VAGUE = 0.5  # of the damage of a zone: what it lacks of its mean, where its parts differ and stiffness is no sum of theirs
DOUBTS = {
    "partial": "partial: most likely damage does not fill {}, so that no mean over a zone is known to 2 points",
    "tilt": "the pressure is most likely not even over the surface, by some {:.2g} %",
    "flicker": "the pressure most likely fluctuates by some {:.2g} %",
    "place": "a sensor is most likely off its place, by some {:.2g} % of the size",
}


@dataclass(frozen=True)
class Cause:
    """A group of causes that explains more than it costs.

    Attributes
    ----------
    kind : str
        Key of ``DOUBTS``.
    gain : float
        Twice the logarithm of its evidence.
    scale : float
        Deviation of each of its columns; 1 of parts, since damage of a half or a quarter of a zone is as likely as any.
    """

    kind: str
    gain: float
    scale: float


class Parted:
    """The structure of a twin with more detail: zones in parts, strips of pressure, sensors beside their places.

    Parameters
    ----------
    forward : MembraneForward
        Of the twin.

    Raises
    ------
    DescriptionError, ParameterError
        Zones that cannot be parted.
    """

    def __init__(self, forward: MembraneForward) -> None:
        self._own, structure = forward, forward.structure
        mesh, order = structure.mesh, structure.setup.order
        zone = structure.zone_of_elements
        if np.bincount(zone[zone >= 0]).min() < PARTS:
            if any(load.kind == "force" for load in structure.setup.loads):
                msg = "forces on nodes belong to one mesh. Mesh the zones with four elements each, or more."
                raise ParameterError(msg)
            order = max(1, order // 2)
            mesh, zone = refined(mesh, order), np.repeat(zone, 4)
        at = np.concatenate([mesh.nodes[block.elements].mean(axis=1) for block in mesh.blocks])
        groups = {f"zone {k}": np.flatnonzero(zone == k) for k in range(structure.n_zones)}
        film = mesh.nodes[np.unique(np.concatenate([block.elements.ravel() for block in mesh.blocks]))]
        self._axes = [k for k in range(3) if np.ptp(at[:, k]) > 0.1 * mesh.size]
        pressed = next((load for load in structure.setup.loads if load.kind == "pressure"), None)
        loads = list[Load]()
        self._pressure, self._strips = None if pressed is None else pressed.name, list[dict[str, float]]()
        acts = members_of(mesh, pressed.groups if pressed is not None else ())
        for axis in self._axes if pressed is not None else ():
            low, high = film[:, axis].min(), film[:, axis].max()
            strip = np.minimum((STRIPS * (at[:, axis] - low) / (high - low)).astype(int), STRIPS - 1)
            names = [f"strip_{axis}_{k}" for k in range(STRIPS)]
            groups |= {name: np.flatnonzero(acts & (strip == k)) for k, name in enumerate(names)}
            loads += [Load(name=name, groups=(name,)) for name in names]
            self._strips.append(dict(zip(names, np.linspace(-1.0, 1.0, 2 * STRIPS + 1)[1::2].tolist(), strict=True)))
        sensors, at_nodes = structure.setup.sensors, (structure.mesh, structure.normals)
        moved = [beside(*at_nodes, sensor, BESIDE * mesh.size, way) for way in range(2) for sensor in sensors]
        zones = tuple(Zone(group=f"zone {k}", parts=PARTS) for k in range(structure.n_zones))
        setup = replace(structure.setup, order=order, zones=zones, sensors=(*sensors, *moved), refine=0)
        setup = replace(setup, loads=(*setup.loads, *loads), calibration=None)

        def table(setup: Setup, zones: tuple[str, ...], nodes: int) -> tuple[Variable, ...]:
            own = [v for v in structure.table if v.causality in ("parameter", "input") and not v.name.startswith("damage[")]
            more = [
                v
                for v in mesh_variables(setup, zones, nodes)
                if v.name.startswith(("damage[", "strip_", "strain[", "max_step"))
            ]
            return (*own, *more)

        found = make_structure(replace(setup, sensors=()), replace(mesh, faces=mesh.faces | groups))
        gauges = tuple(moved_gauge(found.mesh, found.normals, sensor) for sensor in setup.sensors)
        found = replace(found, setup=setup, gauges=gauges, variables=table)
        if structure.starts_in_plane:
            found = stretched_evenly(found, structure.origin)
        self.forward = MembraneForward(found, {**forward.parameters, **forward.inputs})

    def look(self, fit: Fit, *, sparse: bool) -> tuple[Fit, list[str]]:
        """Return a fit that allows for what else explains its residuals, and sentences on that.

        A cause is allowed for where its evidence is certain, and, of a fit that does not pass, half of what is left. Parts
        of zones are allowed for too where with them fewer zones explain the record about as well. Columns are renewed at the
        damage that is fitted with them.
        """
        own, causes, renewed = fit.problem, dict[str, Cause](), True
        if fit.per_sample > HOPELESS:
            return fit, []
        while True:
            columns = self.columns(own, fit.point.x)
            unexplained = 0.0 if fit.passes else fit.point.chi2 - own.values
            found = likeliest(fit, {kind: rows for kind, rows in columns.items() if kind not in causes})
            new = [cause for cause in found if cause.gain > max(CERTAIN, WORTH * unexplained)]
            causes |= {cause.kind: cause for cause in new}
            rows = [own.columns_as_read(cause.scale * columns[kind], fit.point.x) for kind, cause in causes.items()]
            if new or not renewed:
                fit, renewed = again(fit, own.beside(np.concatenate(rows)), sparse=sparse), not new
                continue
            fewer = None
            if sparse and fit.passes and "partial" in columns and "partial" not in causes:
                rows.append(own.columns_as_read(columns["partial"], fit.point.x))
                fewer = with_fewer_zones(fit, own.beside(np.concatenate(rows)))
            if fewer is None:
                break
            fit, causes["partial"], renewed = fewer, Cause("partial", 0.0, 1.0), False
        if "partial" in causes:
            parted = np.where(np.arange(own.zones) < own.whole, np.maximum(fit.point.x[: own.zones], LEAST_PARTED), 0.0)
            fit = replace(fit, vague=np.hypot(fit.vague, VAGUE * parted))
        return fit, [self._said(cause, fit) for cause in causes.values()]

    def columns(self, problem: RecordProblem, x: Vector) -> dict[str, Matrix]:
        """Return what a unit of each cause changes of the strain [1] at unknowns, by kind, shape (k, s, n).

        Units are the damage of each zone, the largest pressure, and the size.
        """
        n, h, s = problem.record.samples, problem.record.step, problem.model.sensors
        z, time = problem.z(x[None]), h * np.arange(1.0, n + 1.0)
        moved, acting = problem.nuisances.moved(z), problem.nuisances.histories(z, time)
        (damage,), moved, acting, (keeps,) = self._own.acted(problem.damage(x[None]), moved, acting)
        load = {name: each.reshape(-1, n)[0] for name, each in acting.items()}
        given = {name: float(value[0]) for name, value in moved.items()}
        parts = np.clip(np.repeat(damage, PARTS), STEP, MOST_DAMAGE - STEP)
        ways, pressed = np.kron(np.eye(len(damage)), WAYS), self._pressed(given, load, time)
        rows = np.vstack([parts, parts + STEP * ways, np.repeat(parts[None], len(pressed), axis=0)])
        histories = dict[str, Matrix](load)
        for name in dict.fromkeys(name for each in pressed for name in each):
            more = [np.zeros((1 + len(ways), n)), *(STEP * each.get(name, np.zeros((1, n))) for each in pressed)]
            histories[name] = load.get(name, given.get(name, self.forward.inputs[name])) + np.vstack(more)
        start = {name: np.full(len(rows), value) for name, value in given.items()}
        y = self.forward.strain(rows, start, histories, n, h)
        change, beside = (y[1:, :s] - y[0, :s]) / STEP, (y[0, s:].reshape(2, s, 1, n) - y[0, :s, None]) / BESIDE
        own = np.repeat(np.maximum(damage, LEAST_PARTED), len(WAYS))
        found = {
            "partial": own[:, None, None] * change[: len(ways)],
            "place": (beside * np.eye(s)[:, :, None]).reshape(2 * s, s, n),
        }
        if pressed:
            found |= {"tilt": change[len(ways) :][: len(self._axes)], "flicker": change[len(ways) + len(self._axes) :]}
        return {kind: keeps[:, None] * rows for kind, rows in found.items() if np.isfinite(rows).all()}

    def _said(self, cause: Cause, fit: Fit) -> str:
        """Say what a cause is."""
        damaged = np.flatnonzero(fit.problem.damage(fit.point.x[None])[0, : self._own.structure.n_zones] > 0.0)
        zones = [self._own.zones[k] for k in damaged]
        of = ", ".join(zones or ["its zones"]) if cause.kind == "partial" else 100.0 * cause.scale
        return DOUBTS[cause.kind].format(of)

    def _pressed(self, given: Mapping[str, float], load: Mapping[str, Vector], time: Vector) -> list[dict[str, Vector]]:
        """Return the pressures [Pa] of causes by name of the load, shape (1, n): along each axis, and by knots in time."""
        if self._pressure is None:
            return []
        values = {**self.forward.parameters, **self.forward.inputs, **given}
        angle = 2.0 * np.pi * values["pressure_frequency"] * time + values["pressure_phase"]
        pressure = values["pressure_amplitude"] * np.sin(angle) + load.get(self._pressure, values[self._pressure])
        size = float(np.abs(pressure).max())
        knots = spline_basis(time, time[-1], max(DEGREE + 1, round(time[-1] / KNOT)))
        across = [{name: share * pressure[None] for name, share in each.items()} for each in self._strips]
        return [*across, *({self._pressure: size * knot[None]} for knot in knots.T)] if size else []


def parted(forward: Forward) -> Parted | None:
    """Return the structure in more detail where it is a membrane whose zones can be parted."""
    try:
        return Parted(forward) if isinstance(forward, MembraneForward) else None
    except (DescriptionError, ParameterError):
        return None


def with_fewer_zones(fit: Fit, allowing: RecordProblem) -> Fit | None:
    """Return the fit of a problem that allows for more, where fewer zones explain the record about as well; else None."""
    zones, x = allowing.zones, fit.point.x
    (point,), everything = allowing.points(x[None]), np.ones(allowing.size, dtype=bool)
    model = allowing.about(point, everything, allowing.derivatives(point, everything))
    kept, move = drop_zones(model, limits := box(allowing, x))
    promised = point.chi2 + change(model.A, model.g, move) + allowing.log_determinant + price(model, limits, kept)
    if kept[:zones].sum() >= fit.kept[:zones].sum() or promised > fit.worth + NEAR:
        return None
    other = again(fit, allowing, sparse=True)
    return other if other.kept[:zones].sum() < fit.kept[:zones].sum() and other.worth < fit.worth + LIKELY else None


def likeliest(fit: Fit, columns: Mapping[str, Matrix]) -> list[Cause]:
    r"""Weigh each group of causes beside a fit, and list the one with the largest gain, if any.

    Notes
    -----
    The evidence of a scale that all columns of a group have, over that of none, where the unknowns that are kept move along:
    see ``scale_evidence``.
    """
    problem, r = fit.problem, fit.point.r
    J = fit.J[:, fit.kept]
    A = J.T @ J + np.diag(problem.prior[fit.kept])
    found = []
    for kind, rows in columns.items():
        W = problem.weigh_columns(rows, fit.point.x)
        WJ = W @ J
        gain = scale_evidence(W @ W.T - WJ @ np.linalg.pinv(A, hermitian=True) @ WJ.T, W @ r, SCALES)
        best = int(np.argmax(gain))
        found.append(Cause(kind, float(gain[best]), 1.0 if kind == "partial" else float(SCALES[best])))
    return sorted(found, key=lambda cause: -cause.gain)[:1]

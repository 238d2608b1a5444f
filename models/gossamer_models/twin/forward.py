r"""The one forward model: from damages and loads to the strain of the sensors, in motion or at rest.

Symbols: ``z`` zones, ``s`` sensors, ``m`` cases, ``n`` samples, ``k`` load states, ``h`` step [s].
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from copy import copy
from dataclasses import replace
from functools import cached_property
from threading import Event, local
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Matrix, Vector
from ..batch import Batch
from ..batch.cases import BatchState
from ..errors import ParameterError, require
from ..membrane import Equilibria, Equilibrium, Fault, Structure, first_period, membrane_model, square_structure
from ..membrane.gauges import Gauges

S = TypeVar("S")
T = TypeVar("T")
LANES = 8  # cases that advance at once
WORKERS = os.cpu_count() or 1  # threads of a simulation of many cases
MEMORY = 2**24  # numbers of one recording
MOST_NODES = 6000  # of a finer mesh


class Forward(Protocol):
    """What a twin, a watch and a placement of sensors know of a structure."""

    @property
    def zones(self) -> tuple[str, ...]:
        """Names of the z zones."""
        ...

    @property
    def sensors(self) -> int:
        """Number s of strain gauges."""
        ...

    @property
    def parameters(self) -> Mapping[str, float]:
        """Parameters with their values."""
        ...

    @property
    def inputs(self) -> Mapping[str, float]:
        """Loads and motions that may change in time, with their values at the start."""
        ...

    @property
    def units(self) -> Mapping[str, str]:
        """Units of parameters and inputs."""
        ...

    @property
    def period(self) -> float:
        """Longest period of small vibrations [s]."""
        ...

    @property
    def limit(self) -> float:
        """Largest internal step at rest [s]."""
        ...

    def strain(
        self, damage: Matrix, parameters: Mapping[str, Vector], histories: Mapping[str, Matrix], steps: int, h: float
    ) -> Matrix:
        """Simulate the strain [1] of the sensors, shape (m, s, steps); not a number where a case fails.

        Parameters
        ----------
        damage : ndarray, shape (m, z)
            Lost fraction of Young's modulus [1].
        parameters : mapping of str to ndarray of shape (m,)
            Parameters, and inputs at time 0, that differ from those of the model. Every case begins at rest in equilibrium
            with them.
        histories : mapping of str to ndarray of shape (steps,) or (m, steps)
            Inputs at the end of each step; the others stay.
        steps, h : int, float
            Samples and the time between them [s].
        """
        ...

    def states(self, damage: Matrix, parameters: Mapping[str, Vector], histories: Mapping[str, Matrix]) -> Matrix:
        """Return the strain [1] of the sensors in equilibrium, shape (m, s, k), of k load states.

        Not a number where there is no equilibrium. ``histories`` are inputs in each state, shape (k,) or (m, k).
        """
        ...

    def state_slopes(self, damage: Vector, parameters: Mapping[str, float], histories: Mapping[str, Vector]) -> Matrix:
        """Return how the strain in equilibrium changes with the damage of each zone [1], shape (z, s, k), at one damage."""
        ...

    def begin(self, damage: Vector, parameters: Mapping[str, float]) -> tuple[BatchState, Vector]:
        """Return the state of rest of one case, and the strain [1] there, shape (s,)."""
        ...

    def advance(
        self, state: BatchState, damage: Matrix, histories: Mapping[str, Matrix], h: float
    ) -> tuple[Matrix, BatchState]:
        """Go on from the states of m cases with histories of damage, shape (m, n, z) [1].

        Returns strain [1], shape (m, s, n), not a number where a case fails; and the states where they end, which differ by
        what the cases differ, also where one has begun another cycle of a load.
        """
        ...


class MembraneForward:
    """The membrane of any setup as a forward model, with the faults that it may have as zones after its own.

    Parameters
    ----------
    structure : Structure
        Membrane with zones.
    parameters : mapping of str to float
        Parameters, and inputs at the start, that differ from the start values of the model.
    gauges : Gauges or None
        What reads the strain; None for the sensors of the structure.
    faults : sequence of Fault
        Their shares follow the damages of the zones wherever these are given.

    Raises
    ------
    ParameterError
        The setup has no zones, or the membrane has no such parameter or input, or no such fault.
    """

    def __init__(
        self,
        structure: Structure,
        parameters: Mapping[str, float] | None = None,
        gauges: Gauges | None = None,
        faults: Sequence[Fault] = (),
    ) -> None:
        if not structure.n_zones:
            msg = "the setup has no zones, so there is no damage to find. Write [[zones]] with groups of faces."
            raise ParameterError(msg)
        self.structure, self.gauges, self.faults = structure, gauges, tuple(faults)
        if gauges is not None:
            structure = replace(structure, setup=replace(structure.setup, sensors=(), expose=True), gauges=())
        self._model = membrane_model(structure)
        self.zones = (*structure.zone_names, *(fault.name for fault in self.faults))
        self.sensors = structure.n_sensors if gauges is None else len(gauges.sensors)
        self._damages = self._model.elements("damage")
        rows = {c: [v for v in self._model.variables if v.causality == c] for c in ("parameter", "input")}
        self.units = {v.name: v.unit for each in rows.values() for v in each}
        starts = {c: {v.name: float(v.start or 0.0) for v in rows[c] if v.name not in self._damages} for c in rows}
        given = dict(parameters or {})
        for name in given:
            if name not in starts["parameter"] | starts["input"]:
                known = ", ".join([*starts["parameter"], *starts["input"]][:12])
                msg = f"this membrane has no parameter or input {name!r}. It has {known}, ..."
                raise ParameterError(msg)
        self.parameters, self.inputs = (
            {name: given.get(name, value) for name, value in starts[c].items()} for c in ("parameter", "input")
        )
        self._given, self._batches = given, dict[tuple[str, ...], Batch]()
        assert self._model.at_rest is not None
        self._phase = 2 * self._model.at_rest.begin.size1_in(2)  # after displacements and velocities, see ``MembraneState``
        self._acts_on = [self._acted_on(fault) for fault in self.faults]

    def _acted_on(self, fault: Fault) -> tuple[int | None, list[str]]:
        """Return which sensor a fault acts on, from 0, or which parameters and inputs."""
        array, _, place = fault.parameter.partition("[")
        if array == "sensor":
            require(place[:-1].isdigit() and 0 < int(place[:-1]) <= self.sensors, f"there is no {fault.parameter}.")
            return int(place[:-1]) - 1, []
        numbers = [*self.parameters, *self.inputs]
        found = [name for name in numbers if fault.parameter in (name, name.partition("[")[0])]
        known = ", ".join(numbers[:12])
        text = f"the fault {fault.name!r} acts on {fault.parameter!r}, which this membrane does not have"
        require(found, f"{text}. It has {known}, ...")
        return None, found

    def acted(
        self, damage: Matrix, parameters: Mapping[str, Vector], histories: Mapping[str, Matrix]
    ) -> tuple[Matrix, dict[str, Vector], dict[str, Matrix], Matrix]:
        """Return damages of the zones alone, parameters and histories as ``strain`` takes them, with what faults do to them.

        The last is the share of its reading that each sensor keeps [1], shape (m, s).
        """
        z, moved, load = self.structure.n_zones, dict(parameters), dict(histories)
        keeps = np.ones((len(damage), self.sensors))
        for fault, (sensor, names), share in zip(self.faults, self._acts_on, damage[:, z:].T, strict=True):
            factor = 1.0 + _sign(fault) * share
            if sensor is not None:
                keeps[:, sensor] *= factor
            for name in names:
                value = moved.get(name, self.parameters.get(name, self.inputs.get(name, 0.0)))
                moved[name] = factor * value
                if name in load:
                    load[name] = factor[:, None] * load[name]
        return damage[:, :z], moved, load, keeps

    def strain(
        self, damage: Matrix, parameters: Mapping[str, Vector], histories: Mapping[str, Matrix], steps: int, h: float
    ) -> Matrix:
        """Simulate the strain [1] of the sensors, see ``Forward``."""
        damage, parameters, histories, keeps = self.acted(damage, parameters, histories)
        batch = self._batch(tuple(histories))
        start: dict[str, ArrayLike] = {**self._given, **parameters, "damage": damage}
        if self.gauges is None:
            return keeps[:, :, None] * batch.run(steps, h, start, histories, workers=WORKERS).results
        state = batch.run(0, h, start, {name: values[..., :0] for name, values in histories.items()}, workers=WORKERS).state
        nodes, found, done = self.structure.mesh.nodes, np.empty((len(damage), self.sensors, steps)), 0
        piece = max(1, MEMORY // (len(damage) * nodes.size))
        while done < steps:
            n = min(piece, steps - done)
            part = {name: values[..., done : done + n] for name, values in histories.items()}
            run = batch.run(n, h, inputs=part, state=state, workers=WORKERS)
            for case, moved in enumerate(run.results):
                found[case, :, done : done + n] = self.gauges.strain(nodes[:, :, None] + moved.reshape(*nodes.shape, n))
            state, done = run.state, done + n
        return keeps[:, :, None] * found

    def reading(self, gauges: Gauges) -> MembraneForward:
        """Return the same membrane, read by other gauges, if it has some."""
        found = copy(self)
        found.gauges, found.sensors = gauges, len(gauges.sensors)
        return found

    def states(self, damage: Matrix, parameters: Mapping[str, Vector], histories: Mapping[str, Matrix]) -> Matrix:
        """Return the strain [1] of the sensors in equilibrium, see ``Forward``."""
        damage, parameters, histories, keeps = self.acted(damage, parameters, histories)
        found = self._at_rest(damage, parameters, histories)
        strain = found.strain
        if self.gauges is not None:
            strain = self.gauges.strain(np.moveaxis(self.structure.mesh.nodes + found.displacement, 0, 2)).T
        return keeps[:, :, None] * np.moveaxis(strain.reshape(len(damage), -1, self.sensors), 1, 2)

    def state_slopes(self, damage: Vector, parameters: Mapping[str, float], histories: Mapping[str, Vector]) -> Matrix:
        """Return how the strain in equilibrium changes with damage, see ``Forward``."""
        given = {name: np.array([value]) for name, value in parameters.items()}
        of_zones, given, acting, keeps = self.acted(damage[None], given, histories)
        found = self._at_rest(of_zones, given, acting)
        n_zones = self.structure.n_zones
        moved = list(dict.fromkeys(name for _, names in self._acts_on for name in names))
        derivatives = self._equilibrium.derivatives(found, ["damage", *moved])
        slopes = np.moveaxis(derivatives.strain, 0, 2)
        by_damage, by_name = slopes[:n_zones], dict(zip(moved, slopes[n_zones:], strict=True))
        strain = found.strain.T
        by_fault = []
        for fault, (sensor, names), share in zip(self.faults, self._acts_on, damage[n_zones:], strict=True):
            relative = _sign(fault) / (1.0 + _sign(fault) * share)  # of what it acts on
            own = np.zeros_like(strain)
            if sensor is not None:
                own[sensor] = strain[sensor]
            for name in names:
                own = own + acting.get(name, given[name]) * by_name[name]
            by_fault.append(relative * own)
        return np.asarray(keeps[0][:, None] * np.concatenate([by_damage, np.array(by_fault).reshape(-1, *strain.shape)]))

    def begin(self, damage: Vector, parameters: Mapping[str, float]) -> tuple[BatchState, Vector]:
        """Return the state of rest of one case, and the strain [1] there, see ``Forward``."""
        given = {name: np.array([value]) for name, value in parameters.items()}
        of_zones, given, _, keeps = self.acted(damage[None], given, {})
        run = self._batch(()).run(0, 1.0, {**self._given, **given, "damage": of_zones})
        return run.state, np.asarray(keeps[0] * run.initial[0])

    def advance(
        self, state: BatchState, damage: Matrix, histories: Mapping[str, Matrix], h: float
    ) -> tuple[Matrix, BatchState]:
        """Go on from the states of m cases with histories of damage, see ``Forward``."""
        inputs = {**histories, **dict(zip(self._damages, np.moveaxis(damage, 2, 0), strict=True))}
        run = self._batch(tuple(inputs)).run(damage.shape[1], h, inputs=inputs, state=state, workers=WORKERS)
        x = run.state.x.copy()
        phase = x[:, self._phase]
        known = phase[np.isfinite(phase)]  # of cases that have not failed
        x[:, self._phase] -= np.round(phase - (known[0] if known.size else 0.0))  # whole cycles, where one has begun another
        return run.results, replace(run.state, x=x)

    def _batch(self, inputs: tuple[str, ...]) -> Batch:
        _go_on()
        if inputs not in self._batches:
            results = self._model.elements("strain" if self.gauges is None else "node")
            self._batches[inputs] = Batch(self._model, results, inputs)
        return self._batches[inputs]

    @cached_property
    def period(self) -> float:
        """Longest period of small vibrations without damage [s]."""
        return first_period(self.structure, {**self._given, "damage": np.zeros((1, self.structure.n_zones))})

    @cached_property
    def limit(self) -> float:
        """Largest internal step at rest without damage [s]."""
        state, _ = self.begin(np.zeros(len(self.zones)), {})
        return float(state.values[0, -1])  # the last result, see ``BatchState``

    @cached_property
    def _equilibrium(self) -> Equilibrium:
        return Equilibrium(self.structure, self._model)

    def _at_rest(self, damage: Matrix, parameters: Mapping[str, Vector], histories: Mapping[str, Matrix]) -> Equilibria:
        """Return the equilibria of m cases in k load states, case by case."""
        _go_on()
        m, k = len(damage), max(np.shape(values)[-1] for values in histories.values())
        start: dict[str, ArrayLike] = {name: np.repeat(values, k) for name, values in parameters.items()}
        start |= {name: np.broadcast_to(values, (m, k)).ravel() for name, values in histories.items()}
        return self._equilibrium.solve({**self._given, **start, "damage": np.repeat(damage, k, axis=0)})


def _sign(fault: Fault) -> float:
    """Return what a share of a fault of 1 changes of what it acts on, relatively."""
    return -1.0 if fault.change == "falls" else 1.0


def side_by_side(what: Callable[[S], T], each: Sequence[S]) -> list[T]:
    """Return what a function gives of each, in threads where there are several.

    An interrupt and an error do not wait for the others: these end when they ask a membrane the next time.
    """
    if len(each) < 2:
        return [what(one) for one in each]
    stop, outer = Event(), getattr(_thread, "stops", ())

    def work(one: S) -> T:
        _thread.stops = (*outer, stop)
        return what(one)

    pool = ThreadPoolExecutor(WORKERS)
    try:
        begun = [pool.submit(work, one) for one in each]
        ended, _ = wait(begun, return_when=FIRST_EXCEPTION)
        for future in begun:
            if future in ended:
                future.result()
        return [future.result() for future in begun]
    finally:
        stop.set()
        pool.shutdown(wait=False, cancel_futures=True)


_thread = local()  # its "stops" are set where nobody waits for its search any more


class _StoppedError(Exception):
    """Nobody waits for this search any more."""


def _go_on() -> None:
    if any(stop.is_set() for stop in getattr(_thread, "stops", ())):
        raise _StoppedError


def forward_of(structure: Structure | Forward | None, parameters: Mapping[str, float] | None) -> Forward:
    """Return the forward model of a membrane, of the square of the thesis for None, or the one that is given."""
    if structure is None or isinstance(structure, Structure):
        return MembraneForward(structure or square_structure(), parameters)
    require(not parameters, "a forward model has its own parameters. Make it with them.")
    return structure


def finer_of(forward: Forward) -> Forward | None:
    """Return the same membrane with finer elements; None of another model, or where there would be too many."""
    if not isinstance(forward, MembraneForward):
        return None
    finer = forward.structure.finer()
    small = len(finer.mesh.nodes) <= MOST_NODES
    return MembraneForward(finer, {**forward.parameters, **forward.inputs}, faults=forward.faults) if small else None


def faults_of(forward: Forward) -> tuple[Fault, ...]:
    """Return the faults that are the last zones of a forward model."""
    return forward.faults if isinstance(forward, MembraneForward) else ()

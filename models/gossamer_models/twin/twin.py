r"""The digital twin: damages that explain a record, with their standard deviations.

Symbols: ``x`` unknowns, the damages and then the nuisances in units of their priors' deviations; ``r`` residuals.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from threading import Lock
from typing import Literal, TypeAlias

import numpy as np
from gossamer_files.options import option
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from ..arrays import Matrix, Vector
from ..errors import DataError, ParameterError, require
from ..membrane import Fault, Structure, square_structure
from ..sensor import SensorArtifact
from .answer import Answer, answer_of, untold_zones
from .calibration import Calibration, spread_of
from .colour import in_colour, of_noise
from .correction import SAME_NOISE, corrected, noise_left
from .discrepancy import Discrepancy, default_discrepancy, is_learned, is_load_learned
from .faults import with_faults
from .forward import Forward, MembraneForward, faults_of, forward_of, side_by_side
from .groups import groups_of, untold, without_nuisances
from .mesh_error import MeshError, MeshErrors
from .nuisances import (
    BY_DEFAULT,
    FACTORS,
    NAMES,
    OF_MOTION,
    OF_SENSOR,
    PLACES,
    SENSOR,
    Loads,
    Nuisances,
    check_names,
    number_of,
    possible,
)
from .places import PlaceSlopes
from .problem import RecordProblem
from .reasons import likely_reason
from .record import (
    PASSING,
    ResponseRecord,
    StaticRecord,
    Wiring,
    best_wiring,
    dead_sensors,
    less_healthy,
    other_wirings,
    without_still,
)
from .search import Fit, again, begun, elsewhere, ended, from_priors, in_groups, misfit, search
from .second_look import Parted, parted
from .simulation import SensedForward, SensorBank
from .unknowns import DamageUnknowns

EARLY = (0.6, 2.0)  # first periods of the first stages: early, chi2 has one valley; over two periods it has several
VALLEY = 0.7  # first periods over which chi2 has one valley, at most
MOST_STEPS = 5000  # internal steps that are compared, unless the record is said to be compared whole
SUSPECT = 0.5  # deviations of chi2 above the expected one from which on wirings are compared, and by which one is better
Progress: TypeAlias = Callable[[float, int], None]  # length of the record [s], and simulations that were made
ESTIMATES = 4  # of noise from what a fit leaves
KEPT = 16  # records whose places of sensors are known
HIDES = 0.5  # of the noise: where the error of the mesh is larger, a finer one is simulated at the fit
COLOURED = 100.0  # chi2 per sample up to which noise may be coloured: what is slow leaves so much of what is fast
LOUD = 10.0  # chi2 per sample of a search with louder noise, up to which that may be the noise
FLOOR = 3.0  # times the noise: no search takes the mesh for more exact, before a finer one is simulated
LEFT = {"strain": 0.15, "resistance": 0.3}  # of the error of the thesis' square: measured of order 8 by pairs of order 12
UNPARTED = "zones of cables and beams are not parted, so nothing but damage of whole zones was looked for"
WIRED = 20.0  # of chi2: what another wiring of a record that fits must explain, or another end of a search, to stand alone


@dataclass(frozen=True)
class Alone:
    """What a record says by itself.

    Attributes
    ----------
    record : ResponseRecord
        As it was read.
    fit : Fit
        The likeliest, each zone an unknown of its own.
    minima : list of Fit
        Others.
    wiring : Wiring or None
        How it was read, unless as it is.
    doubts : list of str
        Sentences on what is missing in it.
    finer : tuple or None
        The finer mesh that it still needs, and components of the error that is left there, see ``Twin.finer``.
    noise : ndarray, shape (sensors,)
        Standard deviation of the noise that it is compared with there, or was.
    """

    record: ResponseRecord
    fit: Fit
    minima: list[Fit]
    wiring: Wiring | None
    doubts: list[str]
    finer: tuple[Forward, Matrix] | None
    noise: Vector


class Twin:
    """A simulation of the membrane, and of the sensors, that is fitted to records.

    Parameters
    ----------
    structure : Structure, Forward or None
        Membrane, with the start values of its load, or another forward model; None for the square of the thesis.
    parameters : mapping of str to float
        Parameters, and inputs at the start, of the membrane that differ from their start values.
    sensor : SensorArtifact or None
        Sensors, for records of resistance.
    sensor_parameters : mapping of str to float or array_like of shape (sensors,)
        Parameters of the sensors that differ from their start values; they rest at the strain of the undamaged structure.
    nuisances : sequence of str
        What is fitted beside the damages and what is fitted by default: ``phase`` of the built-in load (deviation of its
        normal prior 0.1 rad), a load by its name, for instance ``pressure`` (any, a spline in time that is added), or
        ``sensor`` of resistance, which wins where it is among what is known.
    known : sequence of str
        What of the following is known exactly. By default all are fitted, each with a normal prior: ``offset`` and ``gain``
        of each sensor (deviation 0.02 of strain, or of the change of resistance at full scale; 2 %), the ``clock`` (5
        samples late), ``amplitude`` of every load that changes (10 %), ``frequency`` (5 %) of the built-in one, ``damping``
        (a factor of 2), Young's ``modulus`` (2 %), ``density`` and ``prestrain`` (5 %); beside a load by its name, only
        ``clock``, ``offset`` and ``gain``. Of resistance, ``sensor`` in place of offset and gain: how far each sensor is off
        its identified model, see ``SensorError``.
    sparse : bool
        Whether zones are dropped while chi2 rises by less than 9 for each.
    discrepancy : Discrepancy, "learned" or None
        What finer meshes would add to the strain: by default, what was learned of the default mesh, if the twin has that
        mesh and nearly the default membrane and load. Only the time and the frequencies that it covers are then compared,
        0.3 s and 150 Hz. Where it is larger than half of the noise, elements of twice the order are simulated at the fit.
        None if the record comes from a simulation with the twin's mesh.
    mesh_error : MeshErrors or None
        What finer meshes change under the loads of a record; None if it comes from a simulation with the twin's mesh, or
        where a discrepancy is known. Where it is larger than half of the noise, the finer mesh is simulated at
        the fit; no answer is valid where what that one lacks still does, or is not known.
    healthy : ResponseRecord or None
        Record of the same structure without damage under the same loads: what it has beside the model is taken from every
        other one. Only with ``mesh_error``, of which the part is left that damage changes.
    whole : bool
        Whether a record is compared whole that takes more than 5000 internal steps.
    calibration : Calibration or None
        What healthy records have told of the structure: values of its parameters, unless they are given, and how well they
        are known; by default what its setup carries.
    faults : sequence of Fault or "known"
        What else may explain a record; known: all of ``known_faults``.

    Raises
    ------
    ParameterError
        There is no such nuisance, parameter or fault.

    Notes
    -----
    Bounded weighted least squares. Young's modulus and equal damage of all zones change the membrane in the same way, so
    that only the wish for few damaged zones tells them apart.
    """

    def __init__(
        self,
        structure: Structure | Forward | None = None,
        *,
        parameters: Mapping[str, float] | None = None,
        sensor: SensorArtifact | None = None,
        sensor_parameters: Mapping[str, ArrayLike] | None = None,
        nuisances: Sequence[str] = (),
        known: Sequence[str] = (),
        sparse: bool = True,
        discrepancy: Discrepancy | Literal["learned"] | None = "learned",
        mesh_error: MeshErrors | None = None,
        healthy: ResponseRecord | None = None,
        whole: bool = False,
        calibration: Calibration | None = None,
        faults: Sequence[Fault] | Literal["known"] = (),
    ) -> None:
        self.nuisances, self.sparse, self._mesh_error, self._whole = tuple(nuisances), sparse, mesh_error, whole
        self.known, self._healthy = tuple(known), None if healthy is None else without_still(healthy)
        self._spread = spread_of(structure)
        if calibration is not None:
            structure, parameters = calibration.applied(structure, parameters)
            self._spread = calibration.spread
        self._forward = forward_of(structure, parameters)
        if faults:
            self._forward = with_faults(self._forward, faults)
        self.faults = faults_of(self._forward)
        self._sensed = SensedForward(self._forward, sensor, sensor_parameters)
        self.parameters = self._forward.parameters
        self.numbers = {**self._forward.parameters, **self._forward.inputs}
        check_names(self.nuisances, self._forward.inputs)
        check_names(self.known)
        self.discrepancy = default_discrepancy() if discrepancy == "learned" else discrepancy
        if discrepancy == "learned" and not self._learned:
            self.discrepancy = None
        self._behind: Discrepancy | None = None
        self._learning = Lock()  # records are searched side by side
        self._slopes: dict[int, tuple[ResponseRecord, Matrix | None]] = {}
        if healthy is not None and (mesh_error is None or self.discrepancy is not None):
            msg = (
                "a healthy record does not tell what damage does on a finer mesh, so it is taken from others only where the "
                f"error of the mesh is known. Use it with a setup, and with {option('mesh_error')}."
            )
            raise ParameterError(msg)

    @property
    def zones(self) -> int:
        """Number of zones."""
        return len(self.names)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the zones."""
        return self._forward.zones[: len(self._forward.zones) - len(self.faults)]

    @property
    def sensors(self) -> int:
        """Number of sensors."""
        return self._forward.sensors

    @property
    def bank(self) -> SensorBank:
        """The sensors of records of resistance; raises ``ParameterError`` if there are none."""
        return self._sensed.require_bank()

    def has(self, name: str) -> bool:
        """Tell whether the membrane has something that a nuisance acts on."""
        return name in possible(self.numbers, Loads())

    def least_squares(self, record: ResponseRecord, report: Progress = lambda *_: None) -> RecordProblem:
        """Return the least squares of a record, of as much of it as is compared, see ``fit``."""
        return self._problem(self._usable(record)[0], report)

    def placed(self, problem: RecordProblem, x: Vector) -> RecordProblem:
        """Return a problem whose places of sensors change what they do at unknowns, where they are nuisances."""
        slopes = self._slopes_at(problem.record, problem.nuisances, x)
        return problem if slopes is None else problem.placed(slopes)

    def _slopes_at(self, record: ResponseRecord, nuisances: Nuisances, x: Vector | None = None) -> Matrix | None:
        if not {*PLACES} & {*nuisances.kinds} or self._place_slopes is None:
            return None
        return self._place_slopes.at(nuisances, record, x)

    @cached_property
    def _place_slopes(self) -> PlaceSlopes | None:
        return PlaceSlopes(self._forward) if isinstance(self._forward, MembraneForward) else None

    def finer(self, problem: RecordProblem) -> tuple[Forward, Matrix] | None:
        """Return the membrane on a finer mesh, and components of the error that is left there; None if that is not known.

        The problem is one of this mesh, without what a finer one adds.
        """
        return self._finer(problem.record, problem.components)

    def fit(self, record: ResponseRecord, report: Progress = lambda *_: None) -> Answer:
        """Find the damages that explain a record.

        Parameters
        ----------
        record : ResponseRecord
            Histories from the moment that the load sets in.
        report : callable, optional
            Called before each group of simulations with the length of the record that they cover [s], and how many of this
            length were made before.

        Raises
        ------
        DataError
            No sensor is left, or the record is too short.
        ParameterError
            The record holds resistance and the twin has no sensor.
        """
        with threadpool_limits(1):  # small matrices: waking other threads for them costs many times their work
            return self._fit(record, report)

    def alone(self, record: ResponseRecord, report: Progress = lambda *_: None, *, corrects: bool = True) -> Alone:
        """Find the damages of a record as ``fit`` does, each zone by itself, without a second look at what is found.

        Where it does not correct, a record that is explained without a finer mesh is left to that.
        """
        record, doubts = self._usable(record)
        fit, minima = self._searched(record, report, corrects=corrects)
        wiring = self._other_wiring(record, fit, report)
        if wiring is not None:
            changed = wiring.applied(record)
            other, others = self._searched(changed, report, corrects=corrects)
            if other.passes and not (fit.passes and other.unlikely > fit.unlikely - WIRED):
                record, fit, minima = changed, other, others
                doubts.append(wiring.doubt)
            else:
                wiring = None
        whole = fit.problem if corrects else self._problem(record, report)
        needs = not corrects and (fit.problem.added is not None or whole.mesh_over_noise > HIDES)
        finer, noise = (self.finer(whole), whole.noise) if needs else (None, fit.problem.noise)
        return Alone(record, fit, minima, wiring, doubts, finer, noise)

    def _fit(self, record: ResponseRecord, report: Progress) -> Answer:
        found = self.alone(record, report)
        record, doubts, minima = found.record, found.doubts, found.minima
        first, (fit, looked, unresolved) = found.fit, self._looked(record, found.fit, report)
        unknown = record.noise is None and not isinstance(record, StaticRecord)
        white = self._louder(record, first, report) if unknown and not fit.passes else None
        if white is not None:
            anew, weighed = partial(self._searched, report=report), self._weighed
            known, other, others = in_colour(record, white, self._forward.period, anew, weighed)
            if other is not white:
                other, more, untold_now = self._looked(known, other, report)
                if other.passes:
                    record, fit, minima, unresolved = known, other, others, untold_now
                    looked = [*of_noise(known), *more]
        if minima:
            reached = ", ".join(f"{each.per_sample:.4g}" for each in minima)
            doubts.append(
                f"{1 + len(minima)} minima were found; the likeliest was taken. Chi2 per sample is {fit.per_sample:.4g}; "
                f"of the others {reached}"
            )
        doubts += looked
        if not fit.passes:
            wider = self._problem(record, report, fit.problem.groups, wider=True, noise=fit.problem.noise)
            doubts[:0] = [reason] if (reason := likely_reason(fit, wider.like(fit.problem))) else []
        return self._answer(fit, doubts, found.wiring, unresolved)

    def _answer(self, fit: Fit, doubts: list[str], wiring: Wiring | None, unresolved: tuple[int, ...]) -> Answer:
        more, hidden = self.of_mesh(fit.problem)
        return answer_of(fit, doubts, more, wiring, unresolved, sparse=self.sparse, hidden=hidden)

    def _looked(self, record: ResponseRecord, fit: Fit, report: Progress) -> tuple[Fit, list[str], tuple[int, ...]]:
        """Return a fit after a second look, with sentences on it, and the zones, from 1, that the record cannot tell."""
        unresolved = untold_zones(fit)
        groups = groups_of(fit.model.A, fit.problem.zones, fit.problem.whole)
        if fit.passes and groups.max() + 1 < fit.problem.zones:  # those that the record cannot tell apart have one damage
            whole = self._problem(record, report, groups, noise=fit.problem.noise)
            together = in_groups(fit, whole.like(fit.problem), sparse=self.sparse)
            finer = None if fit.problem.added is None else self._finer(record, whole.components)
            if together is not None and finer is not None:
                together = corrected(together, *finer, whole.noise, sparse=self.sparse, simulated=False)
            fit = together if together is not None and together.passes else fit
        if self._parted is None or isinstance(record, StaticRecord):
            structure = getattr(self._forward, "structure", None)
            lines = self._parted is None and structure is not None and structure.n_face_zones < structure.n_zones
            return fit, [UNPARTED] * lines, unresolved
        return *self._parted.look(fit, sparse=self.sparse), unresolved

    def untold(self, record: ResponseRecord, report: Progress = lambda *_: None) -> list[str]:
        """Say which zones a record cannot tell, from derivatives about no damage, before anything is fitted.

        Parameters
        ----------
        record : ResponseRecord
            As of ``fit``; it costs a simulation for each zone, and the error of the mesh behind sensors if none is kept.
        report : callable, optional
            As of ``fit``.

        Returns
        -------
        list of str
            A sentence for each group of zones that act alike on its sensors, and for each zone that hardly moves them.

        Raises
        ------
        DataError, ParameterError
            As ``fit``.
        """
        with threadpool_limits(1):  # the error of the mesh is kept for the fit
            problem = self._problem(self._usable(record)[0], report)
            (point,) = problem.points(np.zeros((1, problem.size)))
            free = np.ones(problem.size, dtype=bool)
            A = problem.about(point, free, problem.derivatives(point, free)).A
        return untold(without_nuisances(A, problem.zones)[: problem.whole, : problem.whole], self.names)

    def _usable(self, record: ResponseRecord) -> tuple[ResponseRecord, list[str]]:
        """Return a record without dead sensors, and what is missing in it."""
        if record.kind == "resistance":
            self._sensed.require_bank()
        elif SENSOR in self.nuisances:
            msg = f"{SENSOR!r} is fitted to records of resistance, and this one holds strain. Leave it out."
            raise ParameterError(msg)
        if len(record.values) != self.sensors:
            shape = f"({self.sensors}, n), not {record.values.shape}"
            msg = f"a record needs one row for each of {self.sensors} sensors, shape {shape}"
            raise DataError(msg)
        dead = dead_sensors(record)
        doubts = [f"sensor {k + 1} does not move and is left out" for k in dead]
        doubts += [f"sensor {k + 1} has no values" for k in range(self.sensors) if k not in record.sensors]
        record = record.without(dead)
        moving = without_still(record)
        many = enumerate((record.present.sum(axis=1) - moving.present.sum(axis=1)).tolist(), 1)
        doubts += [f"sensor {k} repeats one reading, and {n} samples of it are left out" for k, n in many if n]
        record = moving.without(dead_sensors(moving))  # too little may be left of one
        require(record.sensors, "no sensor has values that move. Check the columns and the wiring.", DataError)
        self._check(record)
        return record if self._healthy is None else less_healthy(record, self._healthy, self._undamaged(record)), doubts

    def _undamaged(self, record: ResponseRecord) -> Matrix:
        """Return what the sensors read of the undamaged model under the loads of a record, shape (sensors, n)."""
        nothing, static = np.zeros((1, len(self._forward.zones))), isinstance(record, StaticRecord)
        unknowns = DamageUnknowns(self._forward, self._nuisances((), record))
        strain = unknowns.histories(nothing, record.states, 0.0 if static else record.step)
        strain = strain[:, :, record.state] if isinstance(record, StaticRecord) else strain
        return np.asarray(self._sensed.read(strain, record.kind, record.step)[0])

    def _check(self, record: ResponseRecord) -> None:
        """Refuse more unknowns than readings, and load states without an equilibrium."""
        least, samples = record.least_samples, self._compared(record)
        if samples < least:
            msg = f"{samples} samples of the record are compared; the twin needs {least}. Record with a shorter step."
            raise DataError(msg)
        compared = record.first(samples)
        readings = len(record.sensors) * compared.states
        size = DamageUnknowns(self._forward, self._nuisances(self.nuisances, compared)).size - len(
            self.faults
        )  # priors tell the others
        if size > readings:
            msg = (
                f"{size} unknowns, {self.zones} of them damages, cannot be told from {readings} readings under "
                "different loads. Add load states, samples or sensors, or fit less."
            )
            raise DataError(msg)
        if isinstance(record, StaticRecord):
            lost = ~np.isfinite(self._undamaged(record)).all(axis=0)
            if lost.any():
                names = ", ".join(dict.fromkeys(record.names[k] for k in record.state[lost]))
                msg = f"the undamaged membrane has no equilibrium in load state {names}. Check its loads and supports."
                raise DataError(msg)

    def _nuisances(self, kinds: tuple[str, ...], record: ResponseRecord) -> Nuisances:
        model, loads = self._forward, self._loads(record)
        period = model.period if set(kinds) & set(model.inputs) else math.inf
        known = model.parameters, model.inputs, model.sensors, loads, record.step * record.samples, period
        spread = self._spread.of_structure if self._spread is not None and record.kind == "resistance" else self._spread
        return Nuisances(kinds, *known, spread)

    def _loads(self, record: ResponseRecord) -> Loads:
        """Return the loads of a record; a factor of its own would be the same as a fault of it."""
        return Loads(record.start, record.inputs, tuple(fault.parameter for fault in self.faults))

    def _places_are_known(self, record: ResponseRecord) -> bool:
        """Tell whether no place of a sensor is fitted: no calibration has told any, or sensors bend strain."""
        return record.kind == "resistance" or self._spread is None or PLACES[0] not in map(number_of, self._spread.names)

    def _may_be_off(self, record: ResponseRecord) -> bool:
        """Tell whether the sensors of a record may be off their model."""
        return record.kind == "resistance" and (SENSOR in self.nuisances or SENSOR not in self.known)

    def _kinds(self, record: ResponseRecord, *, wider: bool = False) -> tuple[str, ...]:
        """Return the nuisances that are fitted; wider: all that act on the record."""
        given = possible(self.numbers, self._loads(record), self._spread)
        left_out = {*(OF_MOTION if isinstance(record, StaticRecord) else ())}
        left_out |= {*OF_SENSOR} if self._may_be_off(record) else {SENSOR}
        left_out |= {*PLACES} if self._places_are_known(record) else set()
        if not wider:
            calibrated = () if self._spread is None else map(number_of, self._spread.names)
            left_out |= {*self.known} | ({*NAMES} - {*BY_DEFAULT, *calibrated})
            left_out |= {*FACTORS} if {*self.nuisances} & {*self._forward.inputs} else set()  # any load explains any of them
        return tuple(dict.fromkeys((*self.nuisances, *(name for name in given if not left_out & {name, number_of(name)}))))

    def _weighed(self, record: ResponseRecord, noise: Vector, fit: Fit) -> Fit:
        """Fit a record with another noise, from where a fit has ended."""
        return again(fit, fit.problem.under(noise, record), sparse=self.sparse)

    def _searched(self, record: ResponseRecord, report: Progress, *, corrects: bool = True) -> tuple[Fit, list[Fit]]:
        """Search longer and longer beginnings of a record, from two sides; follow what they find to the end."""
        stages = self._stages(record, report)
        first = stages[0].record
        one_valley = not isinstance(record, StaticRecord) and first.samples * first.step <= VALLEY * self._forward.period
        noise, over = stages[-1].noise, stages[-1].mesh_over_noise
        finer = self._finer(record, stages[-1].components) if over > HIDES else None
        if finer is not None and over > FLOOR:  # more precise than the mesh lets through
            stages = [stage.under(noise * over / FLOOR) for stage in stages]
        fit, minima = search(stages, sparse=self.sparse, one_valley=one_valley)
        both = [fit, *from_priors(fit, sparse=self.sparse)]
        if not corrects and finer is not None and fit.passes:
            return fit, minima
        finish = partial(self._finished, record=record, noise=noise, finer=finer, corrects=corrects)
        ends = side_by_side(finish, both)
        best = min(ends, key=lambda end: (not end.passes, end.worth))
        near = [end for end in ends if end is not best and end.worth < best.worth + WIRED and elsewhere(end, best)]
        return best, [*minima, *near]

    def _finished(
        self, fit: Fit, record: ResponseRecord, noise: Vector, finer: tuple[Forward, Matrix] | None, *, corrects: bool
    ) -> Fit:
        """Go on from a search on a finer mesh, where that counts, and under the noise that is left where it is unknown."""
        ending = partial(corrected, sparse=self.sparse, simulated=self._mesh_error is None)
        if finer is not None:
            fit = ending(fit, *finer, noise)
        for _ in range(ESTIMATES):
            problem = fit.problem
            noise = noise_left(problem, fit.point)
            if not np.nanmin(noise / problem.noise) < SAME_NOISE:
                break
            if finer is None and corrects and problem.under(noise).mesh_over_noise > HIDES:
                finer = self._finer(record, problem.components)
            fit = self._weighed(record, noise, fit) if finer is None else ending(fit, *finer, noise)
        return fit

    def _louder(self, record: ResponseRecord, fit: Fit, report: Progress) -> Fit | None:
        """Return the fit that may tell the colour of the noise: one that is not far off, or another with as much noise.

        A search gives up early where the noise is many times what sixth differences see of it. Another one begins with the
        noise that the first stage leaves. None if that does not explain the record either.
        """
        if fit.per_sample < COLOURED:
            return fit
        stages = self._stages(record, report)
        first = begun(stages[:1], np.zeros(stages[0].size), one_valley=False) if stages[1:] else None
        if first is None:
            return None
        noise = stages[0].noise * math.sqrt(first.reached / stages[0].values)
        stages = [stage.under(noise) for stage in stages]
        start = begun(stages[:-1], np.zeros(stages[0].size), one_valley=True)
        louder = None if start is None or start.hopeless else ended(stages[-1], start, sparse=self.sparse)
        return None if louder is None or louder.per_sample > LOUD else louder

    def _stages(self, record: ResponseRecord, report: Progress) -> list[RecordProblem]:
        """Return the problems of longer and longer beginnings of a record, the last of all of it."""
        return [self._problem(record, report, samples=samples) for samples in [*self._early_samples(record), None]]

    def _compared(self, record: ResponseRecord) -> int:
        """Return how many samples are compared: those that the discrepancy covers, or that do not take too many steps."""
        if isinstance(record, StaticRecord) or (self.discrepancy is None and self._whole):
            return record.samples
        if self.discrepancy is None:
            most = MOST_STEPS // math.ceil(record.step / self._forward.limit)
            return min(record.samples, max(record.least_samples, most))
        return min(record.samples, math.floor(self.discrepancy.length / record.step * (1.0 + 1e-12)))

    def _early_samples(self, record: ResponseRecord) -> list[int]:
        """Return the lengths of the early stages."""
        if isinstance(record, StaticRecord):
            return []
        lengths = {max(record.least_samples, math.ceil(periods * self._forward.period / record.step)) for periods in EARLY}
        return [n for n in sorted(lengths) if n < self._compared(record)]

    def _problem(
        self,
        record: ResponseRecord,
        report: Progress = lambda *_: None,
        groups: NDArray[np.int64] | None = None,
        *,
        samples: int | None = None,
        wider: bool = False,
        noise: Vector | None = None,
    ) -> RecordProblem:
        """Make the problem of what is compared of a record, or of its first samples; wider: with all nuisances there are."""
        compared = record.first(self._compared(record))
        nuisances = self._nuisances(self._kinds(compared, wider=wider), compared)
        known = self._slopes.get(id(record))
        if known is None or known[0] is not record:  # those of all its problems
            known = record, self._slopes_at(compared, nuisances)
            self._slopes = dict([*self._slopes.items(), (id(record), known)][-KEPT:])
        return RecordProblem(
            self._sensed,
            compared if samples is None else compared.first(samples),
            replace(nuisances, slopes=known[1]),
            record.noise_deviation() if noise is None else noise,
            self._discrepancy_of(record, report),
            groups,
            None if (error := self._error_of(compared)) is None else error.components,
            report,
        )

    def _finer(self, record: ResponseRecord, components: Matrix) -> tuple[Forward, Matrix] | None:
        """Return the membrane on a finer mesh, and components of the error that is left there; None if it is not known.

        ``components`` are those of the error of the twin's mesh, shape (k, s, n), in the unit of the record.
        """
        if self._finer_square is not None:
            return self._finer_square, LEFT[record.kind] * components
        error = self._error_of(record.first(self._compared(record)))
        left = None if error is None or error.healthy else error.of_finer
        if self._mesh_error is None or left is None or left.buries:  # no answer would be valid
            return None
        assert self._finer_mesh is not None
        return self._finer_mesh, left.components

    @cached_property
    def _finer_square(self) -> Forward | None:
        """The square of the thesis with elements of twice the order, if its error is learned."""
        if self.discrepancy is None or not self._learned:
            return None
        square = square_structure(self.discrepancy.elements_per_side, 2 * self.discrepancy.order)
        return MembraneForward(square, {**self._forward.parameters, **self._forward.inputs}, faults=self.faults)

    @cached_property
    def _finer_mesh(self) -> Forward | None:
        """The membrane on the finer mesh of the error of its own, with its faults."""
        finer = None if self._mesh_error is None else self._mesh_error.finer
        return with_faults(finer, self.faults) if finer is not None and self.faults else finer

    @cached_property
    def _learned(self) -> bool:
        """Whether the discrepancy was learned for this mesh, membrane and load."""
        return self.discrepancy is not None and is_learned(self._forward, self.discrepancy)

    def _discrepancy_of(self, record: ResponseRecord, report: Progress) -> Discrepancy | None:
        """Return what finer meshes would add to a history: where sensors may be off their model, to what they read."""
        if isinstance(record, StaticRecord):
            return None
        if self.discrepancy is None or not self._may_be_off(record):
            return self.discrepancy
        with self._learning:
            if self._behind is None:
                advice = f"Give discrepancy=None, or {option('known', SENSOR)}."
                require(self._learned, f"what a mesh lacks behind sensors is learned of the thesis' square alone. {advice}")
                self._behind = self.discrepancy.behind(self._sensed.require_bank(), report)
            return self._behind

    def _error_of(self, record: ResponseRecord) -> MeshError | None:
        """Return the error of the mesh under the loads of a record, where no discrepancy stands for it."""
        if self._mesh_error is None or self.discrepancy is not None:
            return None
        read = partial(self._sensed.read, kind=record.kind, h=record.step)
        return self._mesh_error.of(record, read, healthy=self._healthy is not None)

    def _other_wiring(self, record: ResponseRecord, fit: Fit, report: Progress) -> Wiring | None:
        """Return another reading of a record that does not fit as it is, or fits badly; None if none fits better."""
        if fit.passes and (misfit(fit.problem, fit.point) < SUSPECT or isinstance(record, StaticRecord)):
            return None
        most = self._early_misfit(record, report) - SUSPECT if fit.passes else PASSING
        wirings = other_wirings(record.first(fit.problem.record.samples), fit.problem.reading(fit.point))
        wirings = [wiring for wiring in wirings if wiring.moved or not fit.passes]
        misfits = [self._early_misfit(wiring.applied(record), report, most) for wiring in wirings]
        return best_wiring(wirings, misfits, most)

    def _early_misfit(self, record: ResponseRecord, report: Progress, most: float = math.inf) -> float:
        """Return the misfit of the last early stage, or of one that is hopeless or above a bound."""
        lengths = self._early_samples(record) or [self._compared(record)]
        early = [self._problem(record, report, samples=samples) for samples in lengths]
        found = begun(early, np.zeros(early[0].size), one_valley=True, most=most)
        return math.inf if found is None else found.misfit

    @cached_property
    def _parted(self) -> Parted | None:
        return parted(self._forward)

    def of_mesh(self, problem: RecordProblem) -> tuple[list[str], bool]:
        """Return doubts about a fit that come from its mesh, and whether they forbid a valid answer."""
        more, hidden = list[str](), False
        record = problem.record
        error = None if problem.added is not None else self._error_of(record)
        if self._mesh_error is not None and error is not None:
            more, hidden = self._mesh_error.doubts(error), error.buries
        if self._learned and not isinstance(record, StaticRecord) and not is_load_learned(self._forward, record):
            beside = "was learned under the built-in load alone, and the record has other loads beside it"
            advice = f"Describe the membrane as a setup: {option('mesh_error', True)} simulates what finer elements change"
            more, hidden = [f"the error of the mesh {beside}. {advice}"], True
        return more, hidden

r"""Components that are stepped at once: each in a thread, or as a group until what they send each other agrees.

A native FMU releases Python's lock while it steps, so threads pay for FMUs that need nothing of each other.

Symbols of a group: ``x`` values that are fed back, as guessed before a sweep; ``y = H(x)`` what the sweep makes of them;
``r = y - x`` residual; ``V``, ``W`` changes of ``r`` and ``y``.

A sweep steps the components one after another from their saved states. A value is fed back if a component of the group
receives it from itself or from one that is stepped after it; all others are fresh. Noise and dropouts are functions of the
step, so they are the same in every sweep.

The next guess comes from the newest one :math:`x_k` and the earlier ones :math:`x_i`, interface quasi-Newton with an inverse
Jacobian from least squares (IQN-ILS of [1]_):

.. math:: V_i = r_i - r_k, \quad W_i = y_i - y_k, \quad c = \arg\min \|V c + r_k\|, \quad x_{k+1} = y_k + W c

For a linear ``H`` of n values that is exact after n + 1 sweeps, whether plain repetition converges or not.

References
----------
.. [1] J. Degroote, K.-J. Bathe, J. Vierendeels, Performance of a new partitioned procedure versus a monolithic procedure in
   fluid-structure interaction, Computers & Structures 87, 793-801, 2009.
"""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from typing import Any, TypeAlias

import numpy as np
from gossamer_files.options import option
from numpy.typing import NDArray

from ..errors import SimulationError
from ..fmi.instance import Instance
from ..fmi.types import EXCHANGED_EXACTLY, FLOATS
from ..scenario import schema
from ..scenario.plan import Plan
from .member import Member
from .position import AT_ONCE, COMPONENT, RETURNED, Position
from .signals import Store


class Together:
    """Components none of which receives what another of them has just computed; it has the methods of a member.

    Parameters
    ----------
    members : sequence of Member
        Neighbours in the stepping order.
    position : Position
        Where to note which FMUs are called.
    pool : concurrent.futures.Executor
        Threads.
    """

    def __init__(self, members: Sequence[Member], position: Position, pool: Executor) -> None:
        self.number, self.every = members[0].number, 1
        self._members, self._position, self._pool = members, position, pool

    def receive(self, tick: int) -> None:
        """Fetch the inputs for a communication point, and set them."""
        for member in self._members:
            member.receive(tick)

    def advance(self, time: ctypes.c_double, size: ctypes.c_double, *, full: bool) -> bool:
        """Step and read outputs (all of them if ``full``); False if an FMU discarded the step."""
        first, *others = self._members
        self._position[COMPONENT], self._position[AT_ONCE] = self.number, len(self._members)
        waiting = [self._pool.submit(member.advance, time, size, full=full) for member in others]
        try:
            done = [first.advance(time, size, full=full)]
        finally:
            for _ in as_completed(waiting):
                self._position[RETURNED] += 1  # the time limit is that of a call
            self._position[AT_ONCE] = self._position[RETURNED] = 0
        done += [future.result() for future in waiting]  # which raises what was raised there
        if all(done):
            return True
        self._position[COMPONENT] = self._members[done.index(False)].number
        return False


def side_by_side(stages: Sequence[Stage], plan: Plan, position: Position, pool: Executor) -> list[Stage]:
    """Put neighbours together that may step at the same time; the results are the same to the last bit.

    Under Gauss-Seidel a component waits for those before it that feed it.
    """
    feeds = {(c.sender, c.receiver) for c in plan.connections} if plan.scenario.master != "jacobi" else set()
    batches: list[list[Member] | Stage] = []
    for stage in stages:
        last = batches[-1] if batches else None
        if not isinstance(stage, Member) or stage.every > 1:
            batches.append(stage)
        elif isinstance(last, list) and not any((other.name, stage.name) in feeds for other in last):
            last.append(stage)
        else:
            batches.append([stage])
    alone = [batch[0] if isinstance(batch, list) and len(batch) == 1 else batch for batch in batches]
    return [Together(batch, position, pool) if isinstance(batch, list) else batch for batch in alone]


logger = logging.getLogger(__name__)

_SLOT = 1  # of the states at the beginning of a step; 0 belongs to the master


class IteratedGroup:
    """The members of a group, stepped together; it has the methods of a member that the master calls.

    Parameters
    ----------
    group : schema.Group
        Tolerance and largest number of sweeps.
    members : sequence of Member
        Its components, in stepping order.
    store : Store
        The values of the run.
    over : list of Instance
        FMUs that have ended the simulation; what an earlier sweep added is taken back.
    strict : bool
        Raise ``SimulationError`` where it does not converge.

    Attributes
    ----------
    names : list of str
        Names of the components in stepping order.
    number, every : int
        Number of the first of them; they step at every communication point.
    peaks : numpy.ndarray
        Largest magnitude so far of each Real that is fed back, or its nominal value if the FMU declares one.
    sweeps : int
        Sweeps of the last step.
    may_refuse : bool
        Where it does not converge the step is refused: a smaller one will be tried.
    """

    def __init__(
        self, group: schema.Group, members: Sequence[Member], store: Store, over: list[Instance], *, strict: bool
    ) -> None:
        self.names = [member.name for member in members]
        self.number, self.every = members[0].number, 1
        self.sweeps = 0
        self.may_refuse = False
        self._members = members
        self._store, self._over, self._strict = store, over, strict
        self._tolerance, self._most = group.tolerance, group.sweeps
        self._tick = 0
        self._failures = 0
        self._guesses: list[Vector] = []
        self._results: list[Vector] = []
        place = {name: i for i, name in enumerate(self.names)}
        inside = [c for c in store.plan.connections if {c.sender, c.receiver} <= set(self.names)]
        back = dict.fromkeys((c.sender, c.output) for c in inside if place[c.sender] >= place[c.receiver])
        variables = {(name, v): store.plan.component(name).fmu.variables[v] for name, v in back}
        self._reals = [source for source, v in variables.items() if v.type in FLOATS]
        self._places = np.array([self._store.places[source] for source in self._reals], dtype=np.intp)
        self._others = [(source, v.type in EXCHANGED_EXACTLY) for source, v in variables.items() if v.type not in FLOATS]
        self.peaks: Vector = np.array([nominal(variables[source]) for source in self._reals])
        self._declared = self.peaks > 0.0

    def receive(self, tick: int) -> None:
        """Note for which communication point the inputs will be fetched, in each sweep."""
        self._tick = tick

    def advance(self, time: ctypes.c_double, size: ctypes.c_double, *, full: bool) -> bool:
        """Step all components and read their outputs (all of them if ``full``); False if an FMU discarded the step."""
        for member in self._members:
            member.call().save_state(_SLOT)
        ended = len(self._over)

        def sweep(*, again: bool) -> bool:
            if again:
                del self._over[ended:]
                for member in self._members:
                    member.call().restore_state(_SLOT)
            for member in self._members:
                member.receive(self._tick)
                if len(self._over) > ended or not member.advance(time, size, full=False):
                    return False
            return True

        if not self._iterate(sweep, time.value):
            return False
        for member in self._members if full else ():
            member.read(full=True)
        return True

    def initialize(self, start: float) -> None:
        """Exchange values while all components are in their initialization, at the start of the run [s]."""
        self._iterate(self._sweep, start)
        self._store.values[self._places] = self._guesses[-1]  # one more sweep follows, when it ends

    def _sweep(self, *, again: bool) -> bool:  # noqa: ARG002
        """Exchange values once, without a step."""
        for member in self._members:
            member.receive(self._tick)
            member.read(full=False)
        return True

    def conclude(self) -> None:
        """Say how often it did not converge, if more than the once that has been said."""
        if self._failures > 1:
            logger.warning("the group %s did not converge in %d steps", ", ".join(self.names), self._failures)

    def _iterate(self, sweep: Callable[..., bool], time: float) -> bool:
        """Sweep until nothing changes; False if an FMU discarded the step, which begins at a time [s]."""
        values = self._store.values
        guesses, results = self._guesses, self._results
        guesses.clear()
        results.clear()
        residuals = np.zeros(0)
        with np.errstate(all="ignore"):  # what diverges is said below
            for sweeps in range(1, self._most + 1):
                self.sweeps = sweeps
                others = self._read_others()
                guesses.append(values[self._places])
                if not sweep(again=sweeps > 1):
                    return False
                results.append(values[self._places])
                x, y = guesses[-1], results[-1]
                scale = np.where(self._declared, self.peaks, np.maximum(self.peaks, np.maximum(abs(x), abs(y))))
                scale[scale == 0.0] = 1.0
                residuals = abs(y - x) / scale
                if (residuals <= self._tolerance).all() and self._read_others() == others:
                    np.maximum(self.peaks, abs(y), out=self.peaks, where=~self._declared)
                    return True
                if not np.isfinite(residuals).all():
                    break
                if sweeps < self._most:
                    values[self._places] = next_guess(guesses, results, scale)
        if self.may_refuse:
            return False
        self._give_up(time, residuals)
        return True

    def _read_others(self) -> list[Any]:
        """Return the values of other types that are fed back."""
        store = self._store
        places = [(store.places[source], exact) for source, exact in self._others]
        return [store.exact[i] if exact else float(store.values[i]) for i, exact in places]

    def _give_up(self, time: float, residuals: Vector) -> None:
        """Say that the step from a time [s] did not converge, the first time; with ``strict`` raise it."""
        self._failures += 1
        if self._failures > 1 and not self._strict:
            return
        source, change = self._worst(residuals)
        text = (
            f"the group {', '.join(self.names)} does not converge in the step from t = {time:.9g} s: after {self.sweeps} "
            f"sweep{'s' * (self.sweeps > 1)} {'.'.join(source)} still {change}."
        )
        advice = "Use a smaller 'step', or more 'sweeps'."
        if self._strict:
            msg = f"{text} {advice}"
            raise SimulationError(msg, component=source[0], time=time)
        logger.warning("%s The run goes on with its last values; %s ends it there. %s", text, option("strict", True), advice)

    def _worst(self, residuals: Vector) -> tuple[tuple[str, str], str]:
        """Return the value that is fed back and changes most, and how it does."""
        worst = int(np.argmax(np.where(np.isfinite(residuals), residuals, np.inf))) if residuals.size else 0
        if not residuals.size or residuals[worst] <= self._tolerance:
            return self._others[0][0], "changes"
        limit = f"more than 'tolerance' = {self._tolerance:g}"
        return self._reals[worst], f"changes by {residuals[worst]:.3g} of its size, {limit}"


def nominal(variable: Any) -> float:  # noqa: ANN401
    """Return the nominal value that a variable or its type declares; 0 for none."""
    declared = variable.declaredType.nominal if variable.declaredType is not None else None
    return abs(float(variable.nominal or declared or 0.0))


_SINGULAR = 1e-10  # smaller directions, relative to the largest, are left out

Vector = NDArray[np.float64]


def next_guess(guesses: Sequence[Vector], results: Sequence[Vector], scale: Vector) -> Vector:
    """Return the next guess at a fixed point.

    Parameters
    ----------
    guesses, results : sequence of numpy.ndarray, shape (n,)
        Guesses so far and what came of them, the newest last; finite.
    scale : numpy.ndarray, shape (n,)
        Size of each value, positive.

    Returns
    -------
    numpy.ndarray, shape (n,)
    """
    x, y = np.array(guesses[-1 - len(scale) :]), np.array(results[-1 - len(scale) :])
    r = (y - x) / scale
    V, W = (r[:-1] - r[-1]).T, (y[:-1] - y[-1]).T
    sizes = np.linalg.norm(V, axis=0)
    useful = sizes > 0.0
    if not useful.any():
        return results[-1]
    V, W = V[:, useful] / sizes[useful], W[:, useful] / sizes[useful]
    c = np.linalg.lstsq(V, -r[-1], rcond=_SINGULAR)[0]
    return np.asarray(y[-1] + W @ c)


Stage: TypeAlias = Member | Together | IteratedGroup  # what a run steps at once

"""Running FMUs of FMI 3.0 with time-based clocks.

Symbols: ``t`` time of a tick [s], ``T`` interval of a clock [s].

A clock ticks at its own times, between communication points too: the FMU's own step ends there, in event mode the clock is
active, and the rest of the step follows. Others do not notice: inputs are those of the step. Times of ticks are sums of
fractions, which are exact. What belongs to a clock is read and set while it is active, and keeps its value in between;
before the first tick it has its start value, or what the FMU computes for the start.

A stated interval is the one that is used. ``fmi3SetInterval`` is not called: it would tell the
FMU another, which no scenario states, and where it is not called the stated one holds [1]_. One that is not stated is the
FMU's to give.

References
----------
.. [1] Functional Mock-up Interface 3.0, 2.2.8.3, fixed and tunable periodic clocks. https://fmi-standard.org/docs/3.0/
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any
from weakref import WeakKeyDictionary
from zipfile import ZipFile

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from .file import FmuFile
from .instance import MAX_UPDATES, Instance
from .instances import Instance3, ModelExchange2, ModelExchange3
from .types import TEXTS, Port, Value, parse

_CHANGED = 2  # of fmi3IntervalQualifier
PERIODIC = ("constant", "fixed", "tunable")


@dataclass(eq=False)
class FmuClock:
    """A clock of a running FMU.

    Attributes
    ----------
    name, kind : str
        Its name and its ``intervalVariability``.
    reference : int
        Its value reference.
    interval : Fraction or None
        ``T`` of a periodic clock; None until the FMU has been asked, if the model description does not state it.
    shift : Fraction
        Time of the first tick of a periodic clock after the start, as far as the model description states it.
    asked : bool
        The FMU is asked for its interval.
    due : Fraction or None
        ``t`` of the next tick, None if it is not known yet.
    """

    name: str
    reference: int
    kind: str
    interval: Fraction | None
    shift: Fraction
    asked: bool
    due: Fraction | None = None


def read_clocks(fmu: FmuFile) -> list[FmuClock]:
    """Read the clocks of an FMU; FMPy 0.3.32 leaves out their intervals."""
    with ZipFile(fmu.path) as archive, archive.open("modelDescription.xml") as file:
        root = etree.parse(file).getroot()
    types = {each.get("name"): dict(each.attrib) for each in root.iter("ClockType")}
    clocks = []
    for element in root.iter("Clock"):
        stated = types.get(element.get("declaredType"), {}) | dict(element.attrib)
        kind = stated["intervalVariability"]
        interval = _fraction(stated, "interval") if kind in PERIODIC else None
        shift = _fraction(stated, "shift") or Fraction(0) if interval else Fraction(0)
        clocks.append(FmuClock(stated["name"], int(stated["valueReference"]), kind, interval, shift, asked=interval is None))
    return clocks


def _fraction(stated: Mapping[str, str], what: str) -> Fraction | None:
    """Return an interval or a shift that a model description states, as a fraction if it does; -1 s is refused by name."""
    try:
        if f"{what}Counter" in stated and "resolution" in stated:
            return Fraction(int(stated[f"{what}Counter"]), int(stated["resolution"]))
        return Fraction(stated[f"{what}Decimal"]) if f"{what}Decimal" in stated else None
    except (ValueError, ZeroDivisionError):
        return Fraction(-1)


class Clocked(Instance3):
    """One instance of an FMU of FMI 3.0 with time-based clocks; see ``Instance``."""

    def __init__(self, fmu: FmuFile, name: str, time: float = 0.0) -> None:
        super().__init__(fmu, name, time)
        self._clocks = read_clocks(fmu)
        self._start = Fraction(repr(time))
        self._ports: WeakKeyDictionary[Port, tuple[int, ...]] = WeakKeyDictionary()  # with their clocks
        self._waiting: dict[Port, None] = {}  # inputs that are set when their clock ticks
        self._kept: list[tuple[Any, ...]] = [(), ()]
        self._divides = getattr(fmu.interface, "canHandleVariableCommunicationStepSize", True)

    def port(self, names: Sequence[str], kind: str = "Real", values: NDArray[np.float64] | None = None) -> Port:
        """Prepare the exchange of some variables of one type, and of one clock; ``values`` is a buffer for Reals."""
        port = super().port(names, kind, values)
        if names and (clocks := self.fmu.clocks_of(names[0])):
            self._ports[port] = clocks
            port.put([parse(kind, self.fmu.variables[v].start) for v in names])
        return port

    def differing(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """Return what the FMU has in place of values that were set; what belongs to a clock cannot be read later."""
        free = {v: x for v, x in values.items() if not (self._initialized and self.fmu.clocks_of(v))}
        return super().differing(free)

    def exit_initialization(self) -> None:
        """Ask for the intervals and leave the initialization mode; clocks may tick at once."""
        initial = {unknown.variable.valueReference for unknown in self.fmu.description.initialUnknowns}
        for port in list(self._ports):
            if initial.issuperset(port.arguments[1]):
                self._take(port)
        for clock in self._clocks:
            if clock.asked:
                self._ask(clock, self._start)
            if clock.kind in PERIODIC:
                shift = (ctypes.c_double * 1)()
                if clock.asked:
                    self._query(clock, "shift", "getShiftDecimal", shift)
                if not (
                    math.isfinite(shift[0])
                    and shift[0] + clock.shift >= 0
                    and (clock.interval is None or clock.interval > 0)
                ):
                    self._fail(f"gives its clock {clock.name!r} no interval above 0 s and no shift of 0 s or more")
                clock.due = self._start + clock.shift + Fraction(repr(shift[0]))
        super().exit_initialization()

    def read(self, port: Port) -> None:
        """Get the variables of a port; those of a clock keep what they had when it ticked."""
        if not (self._initialized and port in self._ports):
            super().read(port)

    def write_events(self, port: Port) -> None:
        """Set inputs that may jump; those of a clock wait for its tick."""
        if self._initialized and port in self._ports:
            self._waiting[port] = None
        else:
            super().write_events(port)

    def _write(self, port: Port, failure: str = "refused its inputs") -> None:
        if self._initialized and port in self._ports:
            self._waiting[port] = None
        else:
            super()._write(port, failure)

    def _take(self, port: Port) -> None:
        """Read what belongs to an active clock; a text is copied, since the FMU's own lasts for one call."""
        super().read(port)
        if port.kind in TEXTS:
            port.put(port.get())

    def step(self, time: ctypes.c_double, size: ctypes.c_double) -> bool:
        """Advance by ``size`` [s] from ``time`` [s], with the ticks on the way; see ``Instance.step``."""
        self._time = time
        end = time.value + size.value
        if self._next_tick < end and not self._is_at(self._next_tick, end) and not self._divides:
            first = min((clock for clock in self._clocks if clock.due is not None), key=lambda clock: clock.due or 0)
            what = f"cannot vary its step, and its clock {first.name!r} ticks at t = {self._next_tick:.9g} s, inside the"
            self._fail(f"{what} step to {end:.9g} s", " Use a 'step' that ends at the ticks.")
        done = super().step(time, size)
        if done and self.ended_at is None and self._due():  # a tick that is later than the step's end by rounding
            self.enter_event_mode()
            self._leave_events()
        return done

    def _due(self) -> list[FmuClock]:
        return [clock for clock in self._clocks if clock.due is not None and self._is_at(self._reached, float(clock.due))]

    def update_events(self) -> bool:
        """Tick the clocks that are due, and let the FMU handle its events; True if it ends the simulation."""
        ticking = self._due()
        for _ in range(MAX_UPDATES):
            now = max((clock.due for clock in ticking if clock.due is not None), default=Fraction(repr(self._reached)))
            if ticking:
                self._tick({clock.reference for clock in ticking})
            if super().update_events():
                return True
            for clock in self._clocks:
                if clock in ticking:
                    clock.due = None if clock.interval is None or clock.due is None else clock.due + clock.interval
                if clock.asked and (
                    clock.kind in ("countdown", "tunable") or (clock.kind == "changing" and clock in ticking)
                ):
                    self._ask(clock, now)
            ticking = self._due()
            if not ticking:
                break
        else:
            self._fail(f"has clocks that tick more than {MAX_UPDATES} times at t = {self._reached:.9g} s")
        self._next_tick = min((float(clock.due) for clock in self._clocks if clock.due is not None), default=math.inf)
        self._next_event = min(self._next_event, self._next_tick)
        return False

    def _tick(self, clocks: set[int]) -> None:
        """Activate clocks, set the inputs that belong to them, and read what else does."""
        references = (ctypes.c_uint32 * len(clocks))(*clocks)
        self._call("refused to activate its clocks", "setClock", references, [True] * len(clocks))
        active = [port for port, own in list(self._ports.items()) if not clocks.isdisjoint(own)]
        waiting = [port for port in active if port in self._waiting]
        for port in waiting:
            super()._write(port)
            del self._waiting[port]
        for port in active:
            if port not in waiting:
                self._take(port)

    def _ask(self, clock: FmuClock, now: Fraction) -> None:
        """Ask for the interval of a clock, relative to the time of the present event [s]."""
        interval, qualifier = (ctypes.c_double * 1)(), (ctypes.c_int * 1)()
        self._query(clock, "interval", "getIntervalDecimal", interval, qualifier)
        periodic = clock.kind in PERIODIC
        if qualifier[0] != _CHANGED and not (periodic and clock.interval is None):
            return  # one that changes goes on with the last interval
        T = interval[0]
        if not math.isfinite(T) or T < 0.0 or (periodic and T == 0.0):
            self._fail(f"gives its clock {clock.name!r} the interval {T:.9g} s at t = {self._reached:.9g} s")
        clock.due = now + Fraction(repr(T))
        if periodic or clock.kind == "changing":
            clock.interval = Fraction(repr(T))

    def _query(self, clock: FmuClock, what: str, method: str, *places: object) -> None:
        """Let the FMU write what is asked of a clock into some places."""
        failure = f"did not give the {what} of its clock {clock.name!r}"
        self._call(failure, method, (ctypes.c_uint32 * 1)(clock.reference), *places)

    def save_state(self, slot: int = 0) -> None:
        """Save the present state in a slot, 0 or 1, in place of the one saved there before."""
        super().save_state(slot)
        times = self._reached, self._next_event, self._next_tick
        due = [(clock.due, clock.interval) for clock in self._clocks]
        self._kept[slot] = times, due, dict(self._waiting), [(port, port.get()) for port in list(self._ports)]

    def restore_state(self, slot: int = 0) -> None:
        """Restore the state saved in a slot, with the inputs of then."""
        super().restore_state(slot)
        (self._reached, self._next_event, self._next_tick), due, waiting, values = self._kept[slot]
        for clock, (at, interval) in zip(self._clocks, due, strict=True):
            clock.due, clock.interval = at, interval
        self._waiting = dict(waiting)
        for port, value in values:
            port.put(value)


class ClockedExchange(Clocked, ModelExchange3):
    """One instance of an FMU of FMI 3.0 for model exchange with time-based clocks."""


def start_instance(fmu: FmuFile, name: str, time: float = 0.0) -> Instance:
    """Start an instance of an FMU of either version and kind, with clocks or without; see ``Instance``."""
    kinds: dict[tuple[int, bool, bool], type[Instance]] = {
        (2, False, False): Instance,
        (3, False, False): Instance3,
        (3, False, True): Clocked,
        (2, True, False): ModelExchange2,
        (3, True, False): ModelExchange3,
        (3, True, True): ClockedExchange,
    }
    return kinds[fmu.version, fmu.model_exchange, bool(fmu.clocks)](fmu, name, time)

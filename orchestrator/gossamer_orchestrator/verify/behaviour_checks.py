"""Checks of a running FMU. A check that raises an exception has failed."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from contextlib import nullcontext
from itertools import zip_longest
from operator import methodcaller
from pathlib import Path
from typing import Any

import numpy as np

from ..fmi.slave import DISCARD, ERROR, FATAL, OK, WARNING
from .checks import FAILED, NOT_APPLICABLE, PASSED, REMARK, Outcome, check, none_of
from .subject import REALS, InstanceUnderTest, Subject, Trajectory, length, swing

_WORDS = {OK: "accepted", WARNING: "accepted with a warning", DISCARD: "discarded", ERROR: "refused with an error"}
_STATE = ("canGetAndSetFMUstate",)
_SECONDS, _LEAST = 0.5, 100  # spent on counting memory, and steps
_LEAK = 16.0  # [byte] per step
_NOISE = 2.0**17  # [byte]
_TOLERANCE = 1e-3


@check("start", gate=True)
def _start(subject: Subject) -> Outcome:
    with subject.instance() as one:
        one.slave.terminate()
    return PASSED, "Instantiated, initialized with its start values, terminated and freed."


@check("wrong token", misuse=True)
def _token(subject: Subject) -> Outcome:
    try:
        with subject.instance(initialize=False, token="{00000000-0000-0000-0000-000000000000}"):
            pass
    except Exception as error:  # FMPy raises bare exceptions here
        if "instantiate" in str(error):
            return PASSED, "An instance with another guid or instantiation token is refused."
        raise
    return REMARK, "An instance with another guid or instantiation token starts nevertheless."


@check("first outputs")
def _first_outputs(subject: Subject) -> Outcome:
    with subject.instance() as one:
        strange = one.not_finite()
    good = f"All {len(subject.outputs)} outputs are finite after initialization."
    return none_of(strange, "Not finite after initialization", good)


@check("readable")
def _readable(subject: Subject) -> Outcome:
    with subject.instance() as one:
        unreadable = [v.name for v in subject.variables if one.attempt(one.get, v) > WARNING]
    good = f"All {len(subject.variables)} variables can be read after initialization."
    return none_of(unreadable, "Cannot be read after initialization", good)


@check("stated parameters")
def _stated(subject: Subject) -> Outcome:
    given = {
        v.name: (v, [0.999 * x or y for x, y in zip(swing(v, 0.0), swing(v, 1.0), strict=True)]) for v in subject.parameters
    }
    if not given:
        return NOT_APPLICABLE, "It has no Real parameter."

    def lost() -> list[str]:
        return [name for name, (v, values) in given.items() if not np.allclose(one.get(v), values, rtol=1e-6, atol=0.0)]

    def set_again() -> None:
        overwritten.extend(lost())
        for name in overwritten:
            one.set(*given[name])

    overwritten: list[str] = []
    with subject.instance(initialize=False) as one:
        for variable, values in given.values():
            one.set(variable, values)
        if one.attempt(one.initialize, set_again) > WARNING:
            return (
                NOT_APPLICABLE,
                f"It does not start with parameters that differ a little from its own.{subject.log.tail()}",
            )
        law = "FMI: what a host sets before the initialization is the start value. Not kept"
        if gone := lost():
            return none_of(gone, f"{law}, not even set again in the initialization mode", "")
    good = f"{len(given)} parameters set before the initialization hold after it."
    return none_of(overwritten, f"{law} unless set again in the initialization mode", good, verdict=REMARK)


@check("steps", runs=True)
def _steps(subject: Subject) -> Outcome:
    with subject.instance() as one:
        for k in range(subject.steps):
            verdict = one.attempt(one.step, k)
            if verdict > WARNING:
                return FAILED, f"Step {k} of {subject.size:g} s is {_WORDS.get(verdict, 'fatal')}.{subject.log.tail()}"
            if one.not_finite():
                return FAILED, f"An output is not finite after step {k} of {subject.size:g} s."
            if one.ended:
                end = subject.start + (k + 1) * subject.size
                what = f"It ends the simulation in step {k} of {subject.size:g} s, by t = {end:g} s"
                return REMARK, f"{what}; its outputs are finite until then.{subject.log.tail()}"
    return PASSED, f"{subject.steps} steps of {subject.size:g} s with start values, outputs finite."


def _equal(subject: Subject, first: Trajectory, second: Trajectory, good: str, bad: str) -> Outcome:
    """Compare outputs to the bit; name the first that differs, and by how much it does at most."""
    k = next((k for k, (a, b) in enumerate(zip_longest(first, second)) if repr(a) != repr(b)), None)
    if k is None:
        return PASSED, good
    bad = f"{bad}, the outputs differ from step {k} on"
    if k >= min(len(first), len(second)):
        return FAILED, f"{bad}: one run ends there."
    names = [v.name for v in subject.outputs for _ in range(length(v))]
    at = next(i for i, (a, b) in enumerate(zip(first[k], second[k], strict=True)) if repr(a) != repr(b))
    a, b = first[k][at], second[k][at]
    if not isinstance(a, float):
        return FAILED, f"{bad}, {names[at]} first: {a!r} and {b!r}."
    both = np.array([(one[at], other[at]) for one, other in zip(first, second, strict=False)])
    apart, size = np.nanmax(abs(both[:, 0] - both[:, 1])), np.nanmax(abs(both))
    return (
        FAILED,
        f"{bad}, {names[at]} first: {a!r} and {b!r}, by up to {apart:.3g}, {apart / (size or 1.0):.1e} of its size.",
    )


@check("save and restore", needs=_STATE, runs=True)
def _restore(subject: Subject) -> Outcome:
    with subject.instance() as one:
        older = one.save()
        one.excite(0, subject.half)
        state = one.save(over=older)
        first = one.excite(subject.half, subject.steps)
        one.restore(state)
        second = one.excite(subject.half, subject.steps)
    good = f"{subject.half} steps repeated from a saved state are equal to the bit."
    return _equal(subject, first, second, good, "Repeated from a saved state")


@check("serialize", needs=(*_STATE, "canSerializeFMUstate"), runs=True)
def _serialize(subject: Subject) -> Outcome:
    with subject.instance() as one:
        one.excite(0, subject.half)
        state, ended = one.save(), one.ended
        data = one.slave.serializeFMUState(state)
        one.slave.freeFMUState(state)
        first = one.excite(subject.half, subject.steps)
        with nullcontext(one) if subject.can.canBeInstantiatedOnlyOncePerProcess else subject.instance() as other:
            other.restore(other.slave.deserializeFMUState(data))
            other.ended = ended
            second = other.excite(subject.half, subject.steps)
    good = f"{len(data)} bytes carry the state to another instance, which continues to the bit."
    return _equal(subject, first, second, good, "Continued in another instance from a serialized state")


@check("reset", runs=True)
def _reset(subject: Subject) -> Outcome:
    with subject.instance() as one:
        first = one.excite(0, subject.steps)
        one.rewind()
        second = one.excite(0, subject.steps)
    return _equal(
        subject, first, second, f"{subject.steps} steps repeated after a reset are equal to the bit.", "After a reset"
    )


@check("two instances", runs=True)
def _two(subject: Subject) -> Outcome:
    if subject.can.canBeInstantiatedOnlyOncePerProcess:
        return NOT_APPLICABLE, "It declares canBeInstantiatedOnlyOncePerProcess."
    with subject.instance() as alone:
        expected = alone.excite(0, subject.steps)
    with subject.instance() as one, subject.instance() as other:
        found = []
        for k in range(subject.steps):
            found += one.excite(k, k + 1)
            other.excite(k, k + 1, phase=1.0)
    good = "An instance beside another with other inputs gives the outputs it gives alone."
    return _equal(subject, expected, found, good, "Beside another instance with other inputs")


@check("fixed parameter", misuse=True, runs=True)
def _fixed(subject: Subject) -> Outcome:
    variable = next((v for v in subject.parameters if v.variability == "fixed"), None)
    if variable is None:
        return NOT_APPLICABLE, "It has no fixed Real parameter."
    with subject.instance() as one:
        before = one.get(variable)
        moved = next((values for by in (1.0, -1.0) if (values := swing(variable, by)) != before), before)
        verdict = one.attempt(one.set, variable, moved)
        if verdict > WARNING:
            return PASSED, f"Setting {variable.name!r} after initialization is {_WORDS.get(verdict, 'fatal')}."
        after = one.get(variable)
    if after == before:
        return PASSED, f"Setting {variable.name!r} after initialization is ignored.{subject.log.tail()}"
    return REMARK, f"{variable.name!r} is fixed, but can be set after initialization, which a host must not do."


@check("not a number", runs=True)
def _nan(subject: Subject) -> Outcome:
    if not subject.inputs:
        return NOT_APPLICABLE, "It has no Real input."
    found = []
    for value in (math.nan, math.inf):
        with subject.instance() as one:
            worst = max(one.attempt(one.set, v, [value] * length(v)) for v in subject.inputs)
            how = "is set"
            if worst <= WARNING:
                worst, how = one.attempt(one.step, 0), "is stepped"
            text = f"{value} {'refused' if one.ended else _WORDS.get(worst, 'fatal')} when it {how}"
            if one.ended:
                text += ", which ends the simulation"
            elif worst <= WARNING:
                text += f", outputs {'not finite' if one.not_finite() else 'finite'}"
            found.append(text)
            if worst == FATAL:
                return FAILED, f"Inputs {text}."
    return PASSED, f"Inputs {'; '.join(found)}."


@check("wrong state", misuse=True, runs=True)
def _wrong_state(subject: Subject) -> Outcome:
    initialize, step = InstanceUnderTest.initialize, methodcaller("step", 0)
    cases: dict[str, list[Callable[[InstanceUnderTest], object]]] = {
        "a step before initialization": [step],
        "the end of an initialization that never began": [lambda one: one.slave.exitInitializationMode()],
        "a second initialization": [initialize, initialize],
        "a step after termination": [initialize, lambda one: one.slave.terminate(), step],
    }
    accepted = []
    for name, (*prepare, misuse) in cases.items():
        with subject.instance(initialize=False) as one:
            for call in prepare:
                call(one)
            if one.attempt(misuse, one) <= WARNING:
                accepted.append(name)
    return none_of(accepted, "Accepted", f"Refused: {', '.join(cases)}.", verdict=REMARK)


@check("log messages", runs=True)
def _log(subject: Subject) -> Outcome:
    with subject.instance() as one:
        for variable in subject.inputs:
            one.attempt(one.set, variable, [math.nan] * length(variable))
        one.attempt(one.step, 0)
    if any(not text.strip() for _, text in subject.log.messages):
        return REMARK, "It logs messages without text."
    if not subject.log.messages:
        return NOT_APPLICABLE, "It logged nothing, not even in a step with inputs that are not numbers."
    return PASSED, f"All its messages have text.{subject.log.tail()}"


@check("directional derivatives", needs=_STATE, runs=True)
def _derivatives(subject: Subject) -> Outcome:
    if not subject.differentiates:
        return NOT_APPLICABLE, "It does not declare that it provides them."
    outputs = [v for v in subject.outputs if v.type in REALS]
    if not subject.inputs or not outputs:
        return NOT_APPLICABLE, "It has no Real input or no Real output."
    worst = 0.0
    with subject.instance() as one:
        one.excite(0, subject.half)
        if one.ended:
            return NOT_APPLICABLE, "It ends the simulation before."
        for i, variable in enumerate(subject.inputs[:8]):
            at = math.sin(0.3 * subject.half + i)
            worst = max(worst, min(_derivative_error(one, variable, at, outputs, step=step) for step in (True, False)))
    if not worst < _TOLERANCE:
        return FAILED, f"They differ from difference quotients by up to {worst:.1e} of the largest."
    return PASSED, f"They agree with difference quotients within {worst:.1e} of the largest."


def _derivative_error(one: InstanceUnderTest, variable: Any, at: float, outputs: list[Any], *, step: bool) -> float:  # noqa: ANN401
    """Compare outputs by one input with difference quotients, either over the step that follows or at an instant."""

    def given(values: list[float], result: Callable[[], list[float]]) -> list[float]:
        state = one.save()
        one.set(variable, values)
        if step:
            one.step(one.subject.half)
        found = result()
        one.restore(state)
        return found

    seed = [1.0] * length(variable)
    low, middle, high = (swing(variable, at + by) for by in (-0.01, 0.0, 0.01))
    derivatives = given(middle, lambda: [x for output in outputs for x in one.derivative(output, variable, seed)])
    below, above = (given(values, lambda: one.read(outputs)) for values in (low, high))
    quotients = [(b - a) / (high[0] - low[0]) for a, b in zip(below, above, strict=True)]
    largest = max(map(abs, quotients)) or 1.0
    return max(abs(a - b) for a, b in zip(derivatives, quotients, strict=True)) / largest


@check("memory", runs=True)
def _memory(subject: Subject) -> Outcome:
    pages = Path("/proc/self/statm")
    if not pages.exists():
        return NOT_APPLICABLE, "This system does not report the memory of a process."

    def resident() -> int:
        return int(pages.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    with subject.instance() as one:
        done = 0  # steps since the beginning of a run

        def grow(count: int) -> float:
            nonlocal done
            before = resident()
            for _ in range(count):
                if one.ended or (subject.ends and done == subject.steps):
                    one.rewind()
                    done = 0
                one.excite(done, done + 1)
                done += 1
                if subject.can.canGetAndSetFMUstate:
                    one.slave.freeFMUState(one.save())
            return float(resident() - before)

        if subject.ends and one.attempt(one.rewind) > WARNING:
            return NOT_APPLICABLE, "Its experiment has an end, and it cannot be reset to begin again."
        steps, until = 0, time.monotonic() + _SECONDS
        while steps < _LEAST or time.monotonic() < until:
            grow(50)
            steps += 50
        # what grows once is a cache; a leak goes on
        growth = max(min(grow(steps), grow(steps)), 0.0)
    text = f"Its process grew by {growth / 1024:.0f} KiB in {steps} steps, each with a saved and freed state if it has any."
    if growth > _LEAK * steps and growth > _NOISE:
        return FAILED, text
    return PASSED, text

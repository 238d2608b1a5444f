"""The process of a run, in which the FMUs are; they may crash it or hang in it.

It reads a ``RunTask`` from its standard input and writes its reports, a marked line of JSON each, to its standard output. It
ends with the process that started it: at the end of its standard input it ends, with all its descendants.
"""

from __future__ import annotations

import json
import logging
import os
import pickle
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from gossamer_files import exit_code
from gossamer_files.inputs import OverwriteError, check_outputs, keep, keeping

from ..errors import OrchestratorError, ResultsError, ScenarioError, SimulationError
from ..exchange import open_scenario
from ..results.dataset import group, plan_columns
from ..results.files import OF_RUN, RESUME
from ..results.shapes import SHAPES, UNFINISHED_SHAPES
from ..scenario.plan import ComponentPlan, Plan, make_plan
from ..scenario.schema import MASTERS, Connection, Given, Scenario
from ..scenario.values import changed
from .master import Observer, Simulation
from .position import COMPONENT, NOT_FINITE, open_position
from .recorder import FiniteCheck, ShapeRecorder
from .stream import Shared, Stream, check_space, load_checkpoint, restore_checkpoint

POSITION, WAITING = "position", "waiting"  # files in the temporary folder


@dataclass(frozen=True, kw_only=True)
class RunTask:
    """What to run.

    The arguments of ``run_scenario``, a temporary folder, the level of log messages to report, and whether to end before the
    first step.
    """

    scenario: Scenario | Path | str
    fmus: Path | str
    scratch: Path
    level: int
    step: float | None = None
    stop: float | None = None
    values: Mapping[str, Given] | None = None
    master: str | None = None
    strict: bool = False
    out: Path = Path()  # where a run writes its folder by default
    threads: int = 1
    resume: bool = False
    observers: bytes = b""
    only_start: bool = False


Report = Callable[..., None]


def mark(task: RunTask) -> str:
    """Return what every line of a report begins with: an FMU may write to any open file."""
    return f"{task.scratch.name} "


class _Reporter(logging.Handler):
    """Report log messages."""

    def __init__(self, report: Report) -> None:
        super().__init__()
        self._report = report

    def emit(self, record: logging.LogRecord) -> None:
        self._report(log=[record.name, record.levelno, record.getMessage()])


def work() -> None:
    """Run the task that stands on the standard input, as the program of a process; it does not return."""
    control, reports = os.fdopen(os.dup(0), "rb"), os.dup(1)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)  # what FMUs read and print is nothing of this
    os.dup2(2, 1)
    np.seterr(invalid="ignore")  # what is not finite is said by ``FiniteCheck``
    lock, task = threading.Lock(), pickle.load(control)

    def report(**content: object) -> None:
        left = f"\n{mark(task)}{json.dumps(content)}\n".encode()
        with lock, suppress(OSError):  # an FMU may have closed it
            while left:
                left = left[os.write(reports, left) :]

    threading.Thread(target=_end_with_parent, args=(control,), daemon=True).start()
    logging.basicConfig(level=task.level, handlers=[_Reporter(report)])
    try:
        _run(task, report)
    except OrchestratorError as error:
        report(error=_describe(error))
    except KeyboardInterrupt:
        report(interrupted=True)
    except BaseException:
        report(bug=traceback.format_exc())
    report(closed=True)
    sys.stderr.flush()
    os._exit(0)  # an FMU's library may crash at the end of a process


def _run(task: RunTask, report: Report) -> None:
    """Plan and simulate; the end of the run is reported before the FMUs are freed, which may crash."""
    with keeping(), open_scenario(task.scenario, step=task.step, stop=task.stop) as scenario:
        if task.master is not None:
            if task.master not in MASTERS:
                msg = f"there is no master {task.master!r}. Choose {' or '.join(MASTERS)}."
                raise ScenarioError(msg)
            order = scenario.order if task.master == "gauss-seidel" else None
            scenario = scenario.model_copy(update={"master": task.master, "order": order})
        scenario = changed(scenario, task.values or {}, Path(task.fmus))
        plan = make_plan(scenario, Path(task.fmus), strict=task.strict)
        check_space(plan, task.out)
        card, arrays = load_checkpoint(task.out / RESUME, plan) if task.resume else (None, {})
        names = [component.name for component in plan.components]
        report(planned=[names, scenario.start, scenario.step, scenario.ticks])
        position = open_position(task.scratch / POSITION)
        if task.only_start:
            with Simulation(plan, position, strict=task.strict) as simulation:
                check = FiniteCheck(strict=task.strict)
                check.begin(simulation)
                check.sample(simulation)
                report(outline=asdict(outline(plan)), ended="started")
            return
        observers: list[Observer] = pickle.loads(task.observers)

        def announce(shared: Shared) -> None:
            report(begun=[shared.layout, shared.shape])

        _check_outputs(plan, task.out)
        stream = Stream(plan, task.out, task.scratch / WAITING, announce, card)
        with Simulation(plan, position, strict=task.strict, threads=task.threads) as simulation:
            simulation.say = lambda text: report(aside=text)
            if card is not None:
                restore_checkpoint(simulation, card, arrays)
            try:
                simulation.run([stream, FiniteCheck(strict=task.strict), ShapeRecorder(plan, task.out), *observers])
            except OrchestratorError as error:
                report(error=_describe(error) | ({"not_finite": True} if position[NOT_FINITE] else {}))
            except KeyboardInterrupt:
                if position[COMPONENT] < 0:
                    stream.save(simulation)
                report(interrupted=True)
            else:
                report(ended=simulation.ended or "complete")
            report(counts=[[member.refused, member.instance.restored] for member in simulation.members])


def _check_outputs(plan: Plan, out: Path) -> None:
    """Refuse a folder for results in which a run would write over its scenario, an FMU or a history of inputs."""
    keep(*(file.path for file in plan.files), *(plan.scenario.folder / given.file for given in plan.scenario.inputs))
    try:
        check_outputs(out / name for name in (*OF_RUN, SHAPES, UNFINISHED_SHAPES))
    except OverwriteError as error:
        raise ResultsError(str(error)) from error


def _describe(error: OrchestratorError) -> dict[str, Any]:
    """Return an error as JSON can hold it."""
    more = {}
    if isinstance(error, SimulationError):
        more = {"component": error.component, "time": error.time, "fatal": error.fatal}
    return {"kind": type(error).__name__, "message": str(error), "more": more, "not_finite": exit_code(error) > 1}


def _end_with_parent(control: BinaryIO) -> None:
    """Wait for the end of the parent, and end this process and its descendants."""
    control.read()
    if hasattr(os, "killpg"):
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


@dataclass(frozen=True, kw_only=True)
class Outline:
    """A run that can start.

    Attributes
    ----------
    start, stop, step : float
        First and last time, and communication step [s].
    master : {"gauss-seidel", "jacobi"}
        How the components are stepped.
    components : list of dict
        In stepping order: ``component``, ``fmu``, ``fmi``, ``every``, and how many inputs are ``connected``.
    connections : list of dict
        One per scalar: ``from`` and ``to`` with their units, ``from_unit`` and ``to_unit``; ``gain`` and ``bias`` where the
        scenario states them or units are converted.
    variables, scalars, points : int
        How many variables are recorded, arrays whole as results hold them; how many scalars these are, each element of an
        array one; and at how many instants at least.
    warnings : list of str
        What the run would warn of before its first step.
    """

    start: float
    stop: float
    step: float
    master: str
    components: list[dict[str, Any]]
    connections: list[dict[str, Any]]
    variables: int
    scalars: int
    points: int
    warnings: list[str] = field(default_factory=list)


def outline(plan: Plan) -> Outline:
    """Say what a run would do."""
    scenario = plan.scenario
    return Outline(
        start=scenario.start,
        stop=scenario.seconds(scenario.ticks),
        step=scenario.step,
        master=scenario.master,
        components=[_component(each) for each in plan.components],
        connections=[_connection(each, plan) for each in plan.connections],
        variables=len(group(plan_columns(plan))[0]),
        scalars=len(plan.columns),
        points=scenario.ticks // scenario.record.every + 1,
    )


def _component(planned: ComponentPlan) -> dict[str, Any]:
    return {
        "component": planned.name,
        "fmu": planned.fmu.path.name,
        "fmi": planned.fmu.description.fmiVersion,
        "every": planned.every,
        "connected": len(planned.connections),
    }


def _connection(wired: Connection, plan: Plan) -> dict[str, Any]:
    return {
        "from": wired.origin,
        "from_unit": plan.component(wired.sender).fmu.unit(wired.output),
        "to": wired.target,
        "to_unit": plan.component(wired.receiver).fmu.unit(wired.input),
        "gain": wired.gain,
        "bias": wired.bias,
    }

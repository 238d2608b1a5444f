"""Watch the process of a run: what it reports, how it ends, and end it.

All that an FMU starts ends with it.
"""

from __future__ import annotations

import json
import logging
import pickle
import queue
import signal
import subprocess
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from gossamer_files import NotFiniteError
from gossamer_files.options import option

from .. import errors
from ..errors import OrchestratorError, SimulationError
from ..processes import end_all, signal_name, start
from ..results.netcdf import Layout
from .child import POSITION, Outline, RunTask, mark, work
from .position import (
    AT_ONCE,
    CALL,
    COMPONENT,
    FREE,
    PART,
    RETURNED,
    STEP,
    STOP,
    TICK,
    deferred_interrupt,
    describe,
    open_position,
)
from .progress import ProgressBar
from .stream import Shared

GRACE = 5.0  # [s] that an FMU has to return after Ctrl-C, and to be freed after the run
SOON, FEW = 3.0, 10_000  # [s] before its end, and steps of a run, that ends soon
_POLL = 0.1  # [s]
_SAMPLE = 0.005  # [s]


class Process:
    """The process of a run.

    Parameters
    ----------
    task : RunTask
        What it does.

    Attributes
    ----------
    position : memoryview
        Where it stands.
    shared : Shared or None
        How to write the rows that wait, once there are results.
    ended : str
        How the run reached its end, "complete" or by which FMU; empty if it did not.
    outline : Outline or None
        What the run would do, of a task that ends before the first step.
    error : BaseException or None
        Why it did not.
    effort : dict
        What each component took of the steps: ``seconds``, steps ``refused``, states ``restored``.
    """

    def __init__(self, task: RunTask) -> None:
        self.position = open_position(task.scratch / POSITION, new=True)
        self.shared: Shared | None = None
        self.ended, self._closed = "", False
        self.outline: Outline | None = None
        self.error: BaseException | None = None
        self.effort: dict[str, dict[str, float]] = {}
        self._names: list[str] = []
        self._start = self._step = 0.0
        self._ticks = 0
        self._aside = ""  # what the run waits for beside its FMUs
        self._reports: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._scratch, self._mark = task.scratch, mark(task).encode()
        self._process = start(work, mark=task.scratch, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._control, self._lines = self._process.stdin, self._process.stdout
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        with suppress(BrokenPipeError):  # it died at once
            pickle.dump(task, self._control)
            self._control.flush()

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()
        self._reader.join(GRACE)
        with suppress(OSError):
            self._control.close()
        if not self._reader.is_alive():  # closing waits for one that reads: what is left of the process may hold the pipe
            self._lines.close()

    def watch(self, limit: float | None, progress: ProgressBar | None, soon: Callable[[], object] | None = None) -> None:
        """Wait for its end, and end it if it must.

        Parameters
        ----------
        limit : float or None
            Time that one call of an FMU may take [s].
        progress : ProgressBar or None
            Shows how far it is.
        soon : callable or None
            Called once when the run will end soon, see ``run_scenario``.
        """
        over = threading.Event()
        sampler = threading.Thread(target=self._sample, args=(over,), daemon=True)
        sampler.start()
        try:
            with deferred_interrupt(self.position):
                self._watch(limit, progress, soon)
        except KeyboardInterrupt as error:
            self._kill(error)
        finally:
            over.set()
            sampler.join()
            if progress is not None and self._ticks:
                progress.show(self.position[TICK] + bool(self.ended), self._ticks, self._seconds(bool(self.ended)))
                progress.stop()

    def _sample(self, over: threading.Event) -> None:
        """Add up the time of each component from samples of which is called, which costs the steps nothing."""
        last, position = time.perf_counter(), self.position
        while not over.wait(_SAMPLE):
            now, first = time.perf_counter(), position[COMPONENT]
            if position[CALL] == STEP:
                for name in self._names[first : first + max(position[AT_ONCE], 1)] if first >= 0 else ():
                    self.effort[name]["seconds"] += now - last
            last = now

    def _watch(self, limit: float | None, progress: ProgressBar | None, soon: Callable[[], object] | None) -> None:
        last, since, asked = [0] * 5, time.monotonic(), 0.0
        begin: tuple[int, float] | None = None
        while not self._closed:
            self._take(_POLL)
            now, position = time.monotonic(), self.position
            if soon is not None and self._ticks and position[TICK] and not self._closed and self.error is None:
                first, begun = begin = begin or (position[TICK], now)  # a run that goes on begins later than at 0
                done, left = position[TICK] - first, self._ticks - position[TICK]
                if self._ticks <= FEW or (now - begun) * left < SOON * done:
                    soon()
                    soon = None
            if progress is not None and self.shared is not None:
                progress.show(position[TICK], self._ticks, self._seconds(), self._aside)
            present = [position[i] for i in (TICK, PART, COMPONENT, CALL, RETURNED)]
            if present != last or position[COMPONENT] < 0:
                last, since = present, now
            over = bool(self.ended) or self.error is not None
            if self._process.poll() is not None:
                self.end()
                self._take_rest()
                if not self._closed:
                    self._explain_death()
                return
            if over and now - since > (limit or GRACE):
                self._explain_death()
                return
            if limit is not None and now - since > limit and not over:
                self._kill(self._blame(f"did not return within {limit:g} s", f"Give it more time with {option('limit')}."))
                return
            asked = asked or (now if position[STOP] else 0.0)
            if asked and now - asked > GRACE and not over:
                interrupt = KeyboardInterrupt()
                interrupt.add_note(str(self._blame("did not return", "Its process was ended.")))
                self._kill(interrupt)
                return

    def _seconds(self, more: int = 0) -> float:
        """Return the time of the step under way [s], or of a later one."""
        return self._start + (self.position[TICK] + more) * self._step

    def _read(self) -> None:
        for line in self._lines:
            if line.startswith(self._mark):
                with suppress(ValueError):  # cut short by the end of the process
                    self._reports.put(json.loads(line.removeprefix(self._mark)))

    def _take(self, patience: float) -> None:
        """Obey the next report, if one comes in time, and those that are there."""
        with suppress(queue.Empty):
            self._obey(self._reports.get(timeout=patience))
            while True:
                self._obey(self._reports.get_nowait())

    def _take_rest(self) -> None:
        self._reader.join(GRACE)
        self._take(0.0)

    def _obey(self, report: dict[str, Any]) -> None:
        if log := report.get("log"):
            logging.getLogger(log[0]).log(log[1], "%s", log[2])
        elif planned := report.get("planned"):
            names, self._start, self._step, self._ticks = planned
            self.effort = {name: {"seconds": 0.0, "refused": 0, "restored": 0} for name in names}
            self._names = names
        elif begun := report.get("begun"):
            self.shared = Shared(Layout(*begun[0]), tuple(begun[1]))
        elif counts := report.get("counts"):
            for each, (refused, restored) in zip(self.effort.values(), counts, strict=True):
                each |= {"refused": refused, "restored": restored}
        elif outline := report.get("outline"):
            self.outline = Outline(**outline)
        elif error := report.get("error"):
            self.error = self.error or getattr(errors, error["kind"])(error["message"], **error["more"])
            if error["not_finite"]:
                self.error.__cause__ = NotFiniteError(error["message"])
        elif bug := report.get("bug"):
            self.error = self.error or RuntimeError(bug)
        self.ended = report.get("ended", self.ended)
        self._aside = report.get("aside", self._aside)
        self._closed |= "closed" in report
        if "interrupted" in report:
            self.error = KeyboardInterrupt()

    def _kill(self, error: BaseException) -> None:
        """End the process before its time."""
        self.end()
        self._take_rest()
        if not self.ended and self.error is None:
            self.error = error

    def _explain_death(self) -> None:
        """Blame the FMU that was called when the process ended by itself, or was freed for too long."""
        code = self._process.poll()
        what = "did not return" if code is None else _death(code)
        if self.ended or self.error is not None:
            if self.position[CALL] == FREE and self.position[COMPONENT] >= 0:
                logging.getLogger(__name__).warning("%s", self._blame(what, "The results are not touched by that."))
            return
        killed = code == -getattr(signal, "SIGKILL", 0)
        self.error = self._blame(what, "Was there enough memory?" if killed else "Check it with 'gossamer verify'.")

    def _blame(self, what: str, advice: str) -> OrchestratorError:
        """Return an error that names the component that is called."""
        seconds = self._seconds()
        name, call = describe(self.position, seconds, self._names)
        if not name:
            return OrchestratorError(f"no component was called, but the process of the run {what}. {advice}")
        return SimulationError(f"component {name!r} {what} {call}. {advice}", component=name, time=seconds, fatal=True)

    def end(self) -> None:
        """End the process and all its descendants, if they still run."""
        end_all(self._process, self._scratch)


def _death(code: int) -> str:
    """Say how a process ended."""
    if code >= 0:
        return f"ended the process with exit code {code}"
    name = signal_name(code)
    return f"had its process killed ({name})" if name == "SIGKILL" else f"crashed the process ({name})"

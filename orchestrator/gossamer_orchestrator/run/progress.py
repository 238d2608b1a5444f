"""Show how far a task is: a bar with elapsed and remaining time on a terminal or in a notebook, elsewhere a line in 10 s."""

from __future__ import annotations

import threading
from datetime import timedelta

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.text import Text

EVERY = 10.0  # [s] from line to line where there is no terminal


class ProgressBar:
    """A bar on stderr, or lines; it begins with the first call of ``update`` or ``show``, or with a ``with`` block.

    Parameters
    ----------
    label : str
        Stands before the bar.
    console : rich.console.Console or None
        Where to draw; None is stderr.
    remaining : bool
        Whether to show the remaining time, which supposes that what is done grows evenly.
    """

    def __init__(self, label: str = "", console: Console | None = None, *, remaining: bool = True) -> None:
        self._console = Console(stderr=True) if console is None else console
        self._progress = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("{task.fields[text]}", markup=False),
            TimeElapsedColumn(),
            _Remaining(),
            console=self._console,
            disable=not (self._console.is_terminal or self._console.is_jupyter),
        )
        self._task = self._progress.add_task(label, total=None, text="", first=0.0, aside=0.0, waits=False, even=remaining)
        self._begun = False
        self._text = ""
        self._first: float | None = None  # time of a run when its bar began [s]
        self._last = 0.0  # when ``update`` or ``show`` was called last [s]
        self._ended = threading.Event()
        self._lines: threading.Thread | None = None

    def __enter__(self) -> ProgressBar:
        self._begin()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def update(
        self, done: float | None = None, total: float | None = None, text: str | None = None, aside: str = ""
    ) -> None:
        """Say how far the task is.

        Parameters
        ----------
        done, total : float or None
            What is done, and all of it, in any unit; None leaves what was said last.
        text : str or None
            What stands behind the bar; None leaves what was said last.
        aside : str
            What the task waits for, which is no part of its speed: until the next call only the elapsed time is shown.
        """
        self._begin()
        self._wait(aside)
        task = self._progress.tasks[0]
        if task.total is None and total is not None:  # what an earlier program did tells nothing of the speed
            task.fields["first"] = task.completed = done or 0.0
        self._text = self._text if text is None else text
        shown = f"{self._text} {aside},".lstrip() if aside else self._text
        self._progress.update(self._task, completed=done, total=total, text=shown)

    def show(self, tick: int, ticks: int, seconds: float, aside: str = "") -> None:
        """Say how far a run is; to be called every now and then.

        Parameters
        ----------
        tick, ticks : int
            Communication steps done, and of the whole run.
        seconds : float
            Present time [s].
        aside : str
            As of ``update``.
        """
        self._begin()
        self._wait(aside)
        if self._first is None:
            self._first = seconds
        task = self._progress.tasks[0]
        rate = (seconds - self._first) / max((task.elapsed or 0.0) - task.fields["aside"], 1e-9)
        speed = "" if aside else f" {rate:.3g} simulated s per s,"
        self.update(tick, ticks, f"t = {seconds:.4f} s,{speed}", aside)

    def stop(self) -> None:
        """Leave the bar as it is now."""
        if self._begun and self._console.is_jupyter:
            self._progress.refresh()  # rich draws the end on terminals only
        self._progress.stop()
        self._ended.set()
        if self._lines is not None:
            self._lines.join()

    def _wait(self, aside: str) -> None:
        """Count the time since the last call as a wait if it was one, and note whether one begins."""
        task = self._progress.tasks[0]
        now = task.elapsed or 0.0
        if task.fields["waits"]:
            task.fields["aside"] += now - self._last
        self._last = now
        task.fields["waits"] = bool(aside)

    def _begin(self) -> None:
        if self._begun:
            return
        self._begun = True
        self._progress.reset(self._task)
        self._progress.start()
        if self._progress.disable and not self._console.quiet:
            self._lines = threading.Thread(target=self._print_lines, daemon=True)
            self._lines.start()

    def _print_lines(self) -> None:
        while not self._ended.wait(EVERY):
            task = self._progress.tasks[0]
            share = "" if task.total is None else f"{task.percentage:.0f} %"
            parts = (share, str(task.fields["text"]).rstrip(","), f"{_clock(task.elapsed)} elapsed")
            text = ", ".join(part for part in (*parts, _remaining(task)) if part)
            self._console.print(f"{task.description}: {text}", markup=False, highlight=False, soft_wrap=True)


class _Remaining(ProgressColumn):
    """The time that remains."""

    def render(self, task: Task) -> Text:
        """Return it as a text."""
        left = _remaining(task)
        return Text(f"elapsed, {left}" if left else "elapsed")


def _remaining(task: Task) -> str:
    """Say how long the task still takes at the mean speed so far, without waits: what ends in lumps has no present speed.

    While it waits nobody knows.
    """
    done = task.completed - task.fields["first"]
    known = task.fields["even"] and not task.fields["waits"]
    if not known or task.total is None or done <= 0.0 or task.elapsed is None:
        return ""
    spent = task.elapsed - task.fields["aside"]
    return f"{_clock(spent * (task.total - task.completed) / done)} remaining"


def _clock(seconds: float | None) -> str:
    return str(timedelta(seconds=round(seconds or 0.0)))

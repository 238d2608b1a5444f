"""Show the progress of a run: simulated time, rate and remaining time. Quiet without a terminal or a notebook."""

from __future__ import annotations

import time

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn


class ProgressBar:
    """A bar on stderr.

    Parameters
    ----------
    label : str
        Stands before the bar.
    console : rich.console.Console or None
        Where to draw; None is stderr.
    """

    def __init__(self, label: str = "", console: Console | None = None) -> None:
        self._console = Console(stderr=True) if console is None else console
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("t = {task.fields[now]:.4f} s, {task.fields[rate]:.3g} simulated s per s, remaining"),
            TimeRemainingColumn(),
            console=self._console,
            auto_refresh=False,
            disable=not (self._console.is_terminal or self._console.is_jupyter),
        )
        self._task = self._progress.add_task(label, now=0.0, rate=0.0)
        self._begun = self._first = 0.0

    def show(self, tick: int, ticks: int, seconds: float) -> None:
        """Draw the bar.

        Parameters
        ----------
        tick, ticks : int
            Communication steps done, and of the whole run.
        seconds : float
            Present time [s].
        """
        now = time.perf_counter()
        if not self._begun:
            self._begun, self._first = now, seconds
            self._progress.start()
        rate = (seconds - self._first) / max(now - self._begun, 1e-9)
        self._progress.update(self._task, completed=tick, total=ticks, now=seconds, rate=rate)
        self._progress.refresh()

    def stop(self) -> None:
        """Leave the bar as it was drawn last."""
        self._progress.stop()

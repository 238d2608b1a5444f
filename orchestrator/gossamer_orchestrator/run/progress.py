"""Show the progress of a run: simulated time, rate and remaining time. Quiet without a terminal."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

if TYPE_CHECKING:
    from .master import Simulation

REFRESH = 0.1  # [s] of wall time


class ProgressBar:
    """Observer that draws a bar on stderr.

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
            disable=not self._console.is_terminal,
        )
        self._task = self._progress.add_task(label, now=0.0, rate=0.0)
        self._begun = self._drawn = 0.0

    def begin(self, simulation: Simulation) -> None:
        """Start the bar."""
        self._begun = time.perf_counter()
        self._progress.update(self._task, total=simulation.scenario.ticks, now=simulation.time)
        self._progress.start()

    def sample(self, simulation: Simulation) -> None:
        """Redraw the bar, ten times per second."""
        now = time.perf_counter()
        if now - self._drawn >= REFRESH:
            self._drawn = now
            self._draw(simulation)

    def end(self, simulation: Simulation) -> None:
        """Draw the last state and leave it."""
        self._draw(simulation)
        self._progress.stop()

    def _draw(self, simulation: Simulation) -> None:
        elapsed = max(time.perf_counter() - self._begun, 1e-9)
        rate = (simulation.time - simulation.scenario.start) / elapsed
        self._progress.update(self._task, completed=simulation.tick, now=simulation.time, rate=rate)
        self._progress.refresh()

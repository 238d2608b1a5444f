"""Observers that end a run at a step, as a signal does, let it wait there, and keep what its FMUs are at its end."""

from __future__ import annotations

import time
from pathlib import Path

from gossamer_orchestrator import Simulation
from gossamer_orchestrator.run.position import STOP


class StopAt:
    """Ask for the end of the run after a step."""

    def __init__(self, tick: int) -> None:
        self._tick = tick

    def begin(self, simulation: Simulation) -> None:
        """Do nothing."""

    def sample(self, simulation: Simulation) -> None:
        """Do what a signal does."""
        if simulation.tick == self._tick:
            simulation.position[STOP] = 1

    def end(self, simulation: Simulation) -> None:
        """Do nothing."""


class WaitAt:
    """Let the run wait at a step, and say for what."""

    def __init__(self, tick: int, text: str) -> None:
        self._tick, self._text = tick, text

    def begin(self, simulation: Simulation) -> None:
        """Do nothing."""

    def sample(self, simulation: Simulation) -> None:
        """Wait for some draws of a progress bar."""
        if simulation.tick == self._tick:
            simulation.say(self._text)
            time.sleep(0.5)
            simulation.say("")

    def end(self, simulation: Simulation) -> None:
        """Do nothing."""


class KeepStates:
    """Write the states of all FMUs at the end of the run, and what floats do not hold, to a file."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def begin(self, simulation: Simulation) -> None:
        """Do nothing."""

    def sample(self, simulation: Simulation) -> None:
        """Do nothing."""

    def end(self, simulation: Simulation) -> None:
        """Write them."""
        self._path.write_bytes(b"".join(simulation.serialize()) + repr(simulation.store.exact).encode())

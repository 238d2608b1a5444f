"""Strain from resistance while it is measured."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from gossamer_orchestrator.words import counted

from .arguments import File, Values, assigned, command
from .records import numbers_by_name
from .results import Result


@dataclass(frozen=True, kw_only=True, repr=False)
class Recovery(Result):
    """What was recovered.

    Attributes
    ----------
    lines_read, gaps : int
        Readings, and how many of them were missing.
    """

    lines_read: int
    gaps: int

    @property
    def sentence(self) -> str:
        """How many readings."""
        missing = f", {self.gaps} of them missing" * (self.gaps > 0)
        return f"Recovered strain from {counted(self.lines_read, 'reading')}{missing}."

    def to_json(self) -> dict[str, Any]:
        """Return the counts."""
        return {"readings": self.lines_read, "missing": self.gaps}


@command
def recover(
    sensor: File, source: File, *, method: Literal["inverse", "estimator", "filter"] | None = None, set: Values | None = None
) -> Recovery:
    """Recover strain from resistance line by line, as it arrives.

    Reads lines of time [s] and resistance [ohm], with a comma between, and of temperature [K] where the sensor was
    identified with it, from a file, a serial port or, as -, a pipe. Writes a line of time, strain, its standard deviation
    and its delay for each, at once: the strain is that of the delay ago. A reading that is empty leaves a gap.

    Parameters
    ----------
    sensor
        Artifact of the sensor, as gossamer identify writes it.
    source
        Where the lines come from; - for standard input.
    method
        How strain is recovered; what the identification chose by default.
    set
        Parameter of the compensator, NAME=VALUE, such as noise; may be repeated.

    Returns
    -------
    Recovery
        How many readings there were.

    Examples
    --------
    >>> gossamer.recover("sensor.json", "resistance.csv")

    On the command line::

        tail -f resistance.csv | gossamer recover sensor.json - > strain.csv
    """
    from gossamer_models.live import recover_lines
    from gossamer_models.sensor import SensorArtifact

    artifact, count, gaps = SensorArtifact.read(Path(sensor)), 0, 0
    given = numbers_by_name(assigned(set), "NAME=VALUE", "set")
    with Path(source).open(encoding="utf-8-sig", errors="replace") as lines:
        write, flush = sys.stdout.write, sys.stdout.flush
        write("time [s],strain [1],deviation [1],delay [s]\n")
        for each in recover_lines(lines, artifact, method, given):
            cells = ["" if math.isnan(value) else f"{value:.6g}" for value in each[1:]]
            write(f"{each.time!r},{','.join(cells)}\n")
            flush()
            count, gaps = count + 1, gaps + math.isnan(each.strain)
    return Recovery(lines_read=count, gaps=gaps)

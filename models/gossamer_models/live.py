"""Strain from resistance line by line, as a serial port or a pipe gives it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Literal, NamedTuple

from .compensator import compensator_model
from .errors import DataError, NotFiniteError, require
from .sensor import SensorArtifact
from .stepper import Stepper

COLUMNS = {"time": "s", "resistance": "ohm", "temperature": "K"}


class LiveStrain(NamedTuple):
    """What one reading gives.

    Attributes
    ----------
    time : time of the reading [s].
    strain : recovered strain [1] as it was ``delay`` ago; not a number where there is no reading.
    deviation : its standard deviation [1]; not a number of a method that states none.
    delay : of the strain [s].
    """

    time: float
    strain: float
    deviation: float
    delay: float


def recover_lines(
    lines: Iterable[str],
    artifact: SensorArtifact,
    method: Literal["inverse", "estimator", "filter"] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Iterator[LiveStrain]:
    """Recover strain as readings arrive, at any intervals.

    Parameters
    ----------
    lines : iterable of str
        Time [s] and resistance [ohm], with a comma between, and temperature [K] where the artifact says what it does. The
        first line may name the columns, in any order and among others. A temperature that is missing stays. A reading that
        is empty or not a number is none: the next one follows after a longer step.
    artifact : SensorArtifact
        The sensor.
    method : {"inverse", "estimator", "filter"} or None
        Of ``compensator_model``; None for the one that the identification chose.
    parameters : mapping of str to float
        Of the compensator, that differ from those of the artifact.

    Yields
    ------
    LiveStrain
        For every reading, before the next one is asked for.

    Raises
    ------
    DataError
        A line is none of numbers or lacks a temperature that the sensor feels, or time does not rise.
    """
    written = compensator_model(artifact, method)
    model, has = Stepper(written, **(parameters or {})), {variable.name for variable in written.variables}
    names, before = [name for name in COLUMNS if name != "temperature" or artifact.temperature is not None], math.nan
    columns = list(range(len(names)))
    states = "strain_deviation" in has and artifact.states_deviation(method)
    for number, line in enumerate(lines, 1):
        cells = [cell.strip() for cell in line.split(",")]
        if not line.strip():
            continue
        if number == 1 and not _is_number(cells[0]):
            columns = _named(cells, names)
            continue
        msg = f"line {number} has {len(cells)} columns: {line.strip()!r}. The sensor takes {', '.join(names)}"
        require(len(cells) > max(columns), msg, DataError)
        time, reading, *warmth = (_number(cells[k], number) for k in columns)
        require(math.isfinite(time), f"line {number} has no time: {line.strip()!r}", DataError)
        require(not time <= before, f"line {number}: time {time:g} s does not follow {before:g} s.", DataError)
        if not math.isfinite(reading):
            yield LiveStrain(time, math.nan, math.nan, math.nan)
            continue
        model.set("resistance", reading)
        if warmth and math.isfinite(warmth[0]):
            model.set("temperature", warmth[0])
        if math.isnan(before):
            model.initialize()
        else:
            model.step(time - before)
        before = time
        yield LiveStrain(
            time,
            model.get("strain"),
            model.get("strain_deviation") if states else math.nan,
            model.get("delay") if "delay" in has else 0.0,
        )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _number(text: str, line: int) -> float:
    require(not text or _is_number(text), f"line {line}: {text!r} is no number.", DataError)
    require(not math.isinf(number := float(text or "nan")), f"line {line}: {text!r} is infinite.", NotFiniteError)
    return number


def _named(cells: list[str], names: list[str]) -> list[int]:
    """Return where columns stand."""
    found = []
    for name in names:
        at = [k for k, cell in enumerate(cells) if cell.partition("[")[0].strip().lower() == name]
        require(len(at) == 1, f"the first line names no single column {name!r}: {', '.join(cells)}.", DataError)
        there = cells[at[0]].partition("[")[2].rstrip("]").strip()
        require(there in ("", COLUMNS[name]), f"{name} is in {there}; write it in {COLUMNS[name]}.", DataError)
        found += at
    return found

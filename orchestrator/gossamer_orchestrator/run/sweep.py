"""A scenario run many times with other values: a run per case, each in a folder of its own, so nothing finished is lost.

Cases are numbered from 1 in the order of all combinations, the last value fastest. The folder holds ``case_0001`` and so on,
each what ``gossamer run`` writes; a Zarr store with a dimension ``case``; and a table with a row for each.
"""

from __future__ import annotations

import csv
import itertools
import json
import logging
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np
from gossamer_files import digest, replacing, write_text
from gossamer_files.options import option

from ..errors import OrchestratorError, ResultsError, ScenarioError, require, writing
from ..exchange import open_scenario
from ..results.files import NETCDF, is_finished, load_results, make_folder
from ..scenario.schema import Given
from ..scenario.values import read_changes
from ..words import counted
from .folders import locked

MOST_CASES = 100_000
PLAN = "sweep.json"

logger = logging.getLogger(__name__)
_running: set[subprocess.Popen[str]] = set()  # on this machine


@dataclass(frozen=True)
class Case:
    """One run of a sweep.

    Attributes
    ----------
    number : int
        From 1.
    values : dict
        By name, as ``run --set`` takes them.
    """

    number: int
    values: dict[str, Given]

    @property
    def name(self) -> str:
        """Name of its folder."""
        return f"case_{self.number:04d}"


def read_ranges(texts: Iterable[str]) -> dict[str, list[Given]]:
    """Read ``NAME=FIRST:LAST:COUNT``, evenly spaced; ``NAME=1:20``, whole numbers; ``NAME=0.1,0.2,0.4``; or ``NAME=VALUE``.

    Raises
    ------
    ScenarioError
        One of them is none of these.
    """
    ranges: dict[str, list[Given]] = {}
    for text in texts:
        name, _, spec = (part.strip() for part in text.partition("="))
        try:
            require(name, "a name is missing", ValueError)
            ranges[name] = _spread(spec)
        except ValueError as error:
            msg = f"{text!r}: {error}. Write NAME=FIRST:LAST:COUNT, NAME=1:20, NAME=0.1,0.2 or NAME=VALUE."
            raise ScenarioError(msg) from error
    return ranges


def _spread(spec: str) -> list[Given]:
    parts = spec.split(":")
    if len(parts) == 3:
        try:
            low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
        except ValueError:
            msg = f"{spec!r} is not two numbers and how many values, such as 0:0.5:6"
            raise ValueError(msg) from None
        require(1 <= count <= MOST_CASES, f"{count} values are too few or too many", ValueError)
        require(np.isfinite(high - low), f"{spec!r} has an end that is not finite, or too far away", ValueError)
        return [float(f"{value:.12g}") for value in np.linspace(low, high, count)]
    if len(parts) == 2:
        try:
            first, last = int(parts[0]), int(parts[1])
        except ValueError:
            msg = f"{spec!r} is not two whole numbers; of other numbers say how many values, such as {spec}:6"
            raise ValueError(msg) from None
        require(first <= last < first + MOST_CASES, "the last number is before the first, or too far away", ValueError)
        return list(range(first, last + 1))
    quoted = spec.startswith(("[", '"', "'"))
    require(quoted or len(parts) < 4, f"{spec!r} has too many colons", ValueError)
    each = [spec] if quoted else spec.split(",")
    require(all(map(str.strip, each)), "a value is missing", ValueError)
    return [read_changes([f"it={value}"])["it"] for value in each]


def make_cases(ranges: Mapping[str, Sequence[Given]]) -> list[Case]:
    """Combine all values with all others."""
    count = int(np.prod([float(len(values)) for values in ranges.values()]))
    if not 1 <= count <= MOST_CASES:
        msg = f"the values make {count} cases; from 1 to {MOST_CASES} are run. Use fewer values."
        raise ScenarioError(msg)
    combined = itertools.product(*ranges.values())
    return [Case(number, dict(zip(ranges, values, strict=True))) for number, values in enumerate(combined, start=1)]


def run_case(command: Sequence[str], out: Path, case: Case) -> tuple[int, str]:
    """Run a case in a process of its own, here or on another machine; return its number and how it ended."""
    texts = [f"--set={name}={json.dumps(value)}" for name, value in case.values.items()]
    module = [sys.executable, "-P", "-m", "gossamer", "--quiet"]
    with subprocess.Popen(
        [*module, *command, *texts, "--out", str(out / case.name)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        _running.add(process)
        _, said = process.communicate()
        _running.discard(process)
    ended = _ended(out / case.name)
    return case.number, ended if is_finished(ended) else " ".join(said.split()) or f"exit code {process.returncode}"


Spread: TypeAlias = Callable[[Callable[[Case], tuple[int, str]], Sequence[Case]], Iterable[tuple[int, str]]]


def run_sweep(
    cases: Sequence[Case],
    command: Sequence[str],
    out: Path,
    *,
    spread: Spread,
    progress: Callable[[int, int], None] = lambda _done, _all: None,
) -> list[str]:
    """Run the cases that have no complete results yet, several at once.

    Parameters
    ----------
    cases : sequence of Case
        What to run.
    command : sequence of str
        Arguments of ``gossamer`` for a run, but values and folder: ``["run", "damaged", "--no-pictures"]``.
    out : Path
        Folder of the sweep; on a cluster one that all machines see.
    spread : callable
        Calls a function with each case, several at once, and yields what it returns: ``on_cores``, or a cluster.
    progress : callable
        Called with the number of finished and of all cases.

    Returns
    -------
    list of str
        For each case the attribute ``ended`` of its results, or what the run said.

    Raises
    ------
    ResultsError
        The folder holds another sweep, or cannot be written.
    """
    out = out.absolute()
    make_folder(out)
    with locked(out):
        _keep_plan(out, cases, command)
        ended = {case.number: _ended(out / case.name) for case in cases}
        waiting = [case for case in cases if not is_finished(ended[case.number])]
        done = len(cases) - len(waiting)
        progress(done, len(cases))
        for number, text in spread(partial(run_case, command, out), waiting):
            logger.info("case %d: %s", number, text)
            ended[number] = text
            done += 1
            progress(done, len(cases))
        return [ended[case.number] for case in cases]


def on_cores(
    function: Callable[[Case], tuple[int, str]], cases: Sequence[Case], workers: int | None = None
) -> Iterator[tuple[int, str]]:
    """Call a function with each case, several at once on this machine, one per core by default."""
    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        try:
            for future in as_completed([pool.submit(function, case) for case in cases]):
                yield future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in list(_running):
                process.terminate()
            raise


def _ended(folder: Path) -> str:
    """Return how the last run into a folder ended; empty without one."""
    try:
        with load_results(folder) as data:
            ended, count = str(data.attrs.get("ended", "")), int(data.attrs.get("not_finite", 0))
            return f"not valid: {counted(count, 'component')} had values that are not finite" if count else ended
    except ResultsError:
        return ""


def _keep_plan(out: Path, cases: Sequence[Case], command: Sequence[str]) -> None:
    """Write what the folder is a sweep of, files and FMUs without their folders, and refuse a folder of another one."""
    words = [Path(word).name if Path(word).is_absolute() else word for word in command]
    fmus = Path(command[command.index("--fmus") + 1])
    files = {path.name: digest(path) for path in (Path(command[1]), *_fmus_of(Path(command[1]), fmus)) if path.is_file()}
    plan = json.dumps({"command": words, "files": files, "cases": [case.values for case in cases]})
    path = out / PLAN
    with writing(path, ResultsError):
        if path.is_file() and path.read_bytes() != plan.encode():
            msg = f"{out} holds another sweep. Name another folder with {option('out')}, or remove it."
            raise ResultsError(msg)
        write_text(path, plan)


def _fmus_of(scenario: Path, fmus: Path) -> list[Path]:
    """List the FMUs of a scenario; none of one that cannot be read, which its runs say."""
    try:
        with open_scenario(scenario) as opened:
            return [opened.fmu_path(component, fmus) for component in opened.components]
    except OrchestratorError:
        return []


TABLE, STORE = "cases.csv", "sweep.zarr"


def combine(cases: Sequence[Case], out: Path) -> Path | None:
    """Write what the cases recorded to a Zarr store; return it, None without any results.

    Every recorded variable has the dimension ``case``, whose coordinate is the number of the case; what varies is a
    coordinate along it. Where cases differ in length, the shorter ones end in values that are not a number.
    """
    import xarray as xr

    there = [case for case in cases if (out / case.name / NETCDF).is_file()]
    if not there:
        return None
    each = [load_results(out / case.name).chunk() for case in there]
    data = xr.concat(each, "case", join="outer", combine_attrs="drop_conflicts")
    data = data.assign_coords(case=[case.number for case in there])
    fmus = json.loads(each[0].attrs.get("fmus", "{}"))  # whose parameters may differ from case to case
    data.attrs.setdefault("fmus", json.dumps({name: {"model": fmu.get("model", "")} for name, fmu in fmus.items()}))
    data.attrs["variables"] = [str(name) for name in data.data_vars]  # a store has no order
    values = {name: ("case", np.array([_cell(case.values[name]) for case in there])) for name in cases[0].values}
    shutil.rmtree(out / STORE, ignore_errors=True)
    with writing(out / STORE, ResultsError):
        data.assign_coords(values).to_zarr(out / STORE, mode="w", consolidated=False)
    return out / STORE


def write_table(cases: Sequence[Case], ended: Sequence[str], out: Path) -> Path:
    """Write a row per case: what varies, how it ended, and the last value of each scalar that was recorded."""
    last = [_last(out / case.name) for case in cases]
    names = list(dict.fromkeys(name for values in last for name in values))
    with writing(out / TABLE, ResultsError), replacing(out / TABLE) as new, new.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["case", *cases[0].values, "ended", *(f"last {name}" for name in names)])
        for case, text, values in zip(cases, ended, last, strict=True):
            given = map(_cell, case.values.values())
            rows.writerow([case.number, *given, text, *(values.get(name, "") for name in names)])
    return out / TABLE


def _last(folder: Path) -> dict[str, float]:
    """Return the last value of each scalar with its unit in the name; nothing where there are no results."""
    if not (folder / NETCDF).is_file():
        return {}
    with load_results(folder) as data:
        scalars = {str(name): each for name, each in data.data_vars.items() if each.dims == ("time",) and each.size}
        return {
            f"{name} [{unit}]" if (unit := each.attrs.get("units")) else name: float(each[-1])
            for name, each in scalars.items()
        }


def _cell(value: Given) -> bool | int | float | str:
    return json.dumps(value) if isinstance(value, list) else value

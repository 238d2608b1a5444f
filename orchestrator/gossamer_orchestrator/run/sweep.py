"""A scenario run many times with other values: a run per case, each in a folder of its own, so nothing finished is lost.

Cases are numbered from 1 in the order of all combinations, the last value fastest. The folder holds ``case_0001`` and so on,
each what ``gossamer run`` writes; a table ``cases.csv``; and ``sweep.zarr`` with everything along a dimension ``case``.
"""

from __future__ import annotations

import csv
import itertools
import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from gossamer_files import replacing

from ..errors import ResultsError, ScenarioError, writing
from ..results.files import NETCDF, load_results, make_folder
from ..scenario.changes import read_changes
from ..scenario.schema import Given
from .folders import locked

MOST_CASES = 100_000
TABLE, STORE, PLAN = "cases.csv", "sweep.zarr", "sweep.json"


def is_finished(ended: str) -> bool:
    """Tell whether a run came to its end, or an FMU ended it in peace, by the attribute ``ended`` of its results."""
    return ended == "complete" or " ended the simulation at t = " in ended


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
        name, _, spec = text.partition("=")
        try:
            ranges[name.strip()] = _spread(spec.strip())
        except ValueError as error:
            msg = f"{text!r}: {error}. Write NAME=FIRST:LAST:COUNT, NAME=1:20, NAME=0.1,0.2 or NAME=VALUE."
            raise ScenarioError(msg) from error
    return ranges


def _spread(spec: str) -> list[Given]:
    parts = spec.split(":")
    if len(parts) == 3:
        count = int(parts[2])
        if not 1 <= count <= MOST_CASES:
            msg = f"{count} values are too few or too many"
            raise ValueError(msg)
        return [float(f"{value:.12g}") for value in np.linspace(float(parts[0]), float(parts[1]), count)]
    if len(parts) == 2:
        first, last = int(parts[0]), int(parts[1])
        if not first <= last < first + MOST_CASES:
            msg = "the last number is before the first, or too far away"
            raise ValueError(msg)
        return list(range(first, last + 1))
    quoted = spec.startswith(("[", '"', "'"))
    if len(parts) > 3 and not quoted:
        msg = f"{spec!r} has too many colons"
        raise ValueError(msg)
    each = [spec] if quoted else spec.split(",")
    return [read_changes([f"it={value}"])["it"] for value in each]


def make_cases(ranges: Mapping[str, Sequence[Given]]) -> list[Case]:
    """Combine all values with all others."""
    count = int(np.prod([float(len(values)) for values in ranges.values()]))
    if not 1 <= count <= MOST_CASES:
        msg = f"the values make {count} cases; from 1 to {MOST_CASES} are run. Use fewer values."
        raise ScenarioError(msg)
    combined = itertools.product(*ranges.values())
    return [Case(number, dict(zip(ranges, values, strict=True))) for number, values in enumerate(combined, start=1)]


def run_sweep(
    cases: Sequence[Case],
    command: Sequence[str],
    out: Path,
    *,
    workers: int | None = None,
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
        Folder of the sweep.
    workers : int or None
        Runs at once; None for one per core.
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
    make_folder(out)
    with locked(out):
        _keep_plan(out, cases, command)
        ended = {case.number: _ended(out / case.name) for case in cases}
        waiting = [case for case in cases if not is_finished(ended[case.number])]
        progress(len(cases) - len(waiting), len(cases))
        running: set[subprocess.Popen[str]] = set()
        stop = threading.Event()

        def run(case: Case) -> tuple[int, str]:
            if stop.is_set():
                return case.number, ""
            texts = [f"--set={name}={json.dumps(value)}" for name, value in case.values.items()]
            arguments = [
                sys.executable,
                "-P",
                "-m",
                "gossamer_orchestrator",
                *command,
                *texts,
                "--out",
                str(out / case.name),
            ]
            with subprocess.Popen(
                arguments, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
            ) as process:
                running.add(process)
                _, said = process.communicate()
                running.discard(process)
            if process.returncode == 0:
                return case.number, _ended(out / case.name)
            return case.number, " ".join(said.split()) or f"exit code {process.returncode}"

        with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
            try:
                for future in as_completed([pool.submit(run, case) for case in waiting]):
                    number, text = future.result()
                    ended[number] = text
                    progress(sum(map(bool, ended.values())), len(cases))
            except BaseException:
                stop.set()
                for process in list(running):
                    process.terminate()
                raise
        texts = [ended[case.number] for case in cases]
        _write_table(out, cases, texts)
    return texts


def combine(cases: Sequence[Case], out: Path) -> Path | None:
    """Write what the cases recorded to a Zarr store with a dimension ``case``; return it, None without any results."""
    there = [case for case in cases if (out / case.name / NETCDF).is_file()]
    if not there:
        return None
    each = [load_results(out / case.name).chunk() for case in there]
    data = xr.concat(each, "case", join="outer", combine_attrs="drop_conflicts")
    data = data.assign_coords(case=[case.number for case in there])
    values = {name: ("case", np.array([_cell(case.values[name]) for case in there])) for name in cases[0].values}
    shutil.rmtree(out / STORE, ignore_errors=True)
    with writing(out / STORE, ResultsError):
        data.assign_coords(values).to_zarr(out / STORE, mode="w", consolidated=False)
    return out / STORE


def _ended(folder: Path) -> str:
    """Return how the last run into a folder ended; empty without one."""
    try:
        with load_results(folder) as data:
            return str(data.attrs.get("ended", ""))
    except ResultsError:
        return ""


def _keep_plan(out: Path, cases: Sequence[Case], command: Sequence[str]) -> None:
    """Write what the folder is a sweep of, and refuse a folder of another one."""
    plan = {"command": list(command), "cases": [case.values for case in cases]}
    path = out / PLAN
    if path.is_file() and json.loads(path.read_text(encoding="utf-8")) != plan:
        msg = f"{out} holds another sweep. Name another folder with --out, or remove it."
        raise ResultsError(msg)
    with writing(path, ResultsError), replacing(path) as new:
        new.write_text(json.dumps(plan), encoding="utf-8")


def _write_table(out: Path, cases: Sequence[Case], ended: Sequence[str]) -> None:
    with writing(out / TABLE, ResultsError), replacing(out / TABLE) as new, new.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["case", *cases[0].values, "ended"])
        for case, text in zip(cases, ended, strict=True):
            rows.writerow([case.number, *map(_cell, case.values.values()), text])


def _cell(value: Given) -> bool | int | float | str:
    return json.dumps(value) if isinstance(value, list) else value

"""Run the experiments that an FMU carries beside itself, and compare with its own results: FMI-LS-REF [1]_.

The manifest ``extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml`` holds them, as draft 1.0.0-rc.1 has it, names a file
that does (``role="experiment"``), or names results of the default experiment alone (``role="result"``), as 1.0.0-alpha.1 has
it. Stimuli and results are CSV files with a column ``time``; stimuli are looked up where a step begins, those that are
continuous between their rows.

References
----------
.. [1] Layered Standard References, Modelica Association Project FMI, https://github.com/modelica/fmi-ls-ref.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from .checks import FAILED, NOT_APPLICABLE, PASSED, Outcome, check
from .subject import REALS, InstanceUnderTest, Subject

MANIFEST = "extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml"
_TOLERANCE = 1e-3  # of the largest value of a column: solvers and their steps differ
_MOST_STEPS = 100_000


@dataclass(frozen=True)
class Experiment:
    """One experiment: its name, its files, and its start [s] and step [s] where it states them."""

    name: str
    results: Path
    stimuli: Path | None = None
    parameters: Path | None = None
    start: float | None = None
    size: float | None = None


def experiments(folder: Path) -> Iterator[Experiment]:
    """Give the experiments of an unpacked FMU; files that are not there are left out."""
    manifest = folder / MANIFEST
    if not manifest.is_file():
        return
    root = ElementTree.parse(manifest).getroot()
    yield from _listed(root, manifest.parent, folder)
    for related in root.iter("Related"):
        role, path = related.get("role", "").partition("/")[0], _inside(related.get("source"), manifest.parent, folder)
        if role == "experiment" and path is not None and path.suffix in (".xml", ".exp"):
            yield from _listed(ElementTree.parse(path).getroot(), path.parent, folder)
        if role == "result" and path is not None and path.suffix == ".csv":
            yield Experiment(path.stem, path)


def _listed(root: Any, base: Path, folder: Path) -> Iterator[Experiment]:  # noqa: ANN401
    for each in root.iter("Experiment"):
        files = {}
        for kind in ("References", "Stimuli", "Parameters"):
            found = each.find(kind)
            files[kind] = None if found is None else _inside(found.get("source"), base, folder)
        start, size = (None if (text := each.get(key)) is None else float(text) for key in ("startTime", "stepSize"))
        if files["References"] is not None and files["References"].suffix == ".csv":
            yield Experiment(each.get("name", ""), files["References"], files["Stimuli"], files["Parameters"], start, size)


def _inside(source: str | None, base: Path, folder: Path) -> Path | None:
    """Return a file of the FMU that a source names; None if there is none."""
    path = (base / unquote(source or "")).resolve()
    return path if path.is_relative_to(folder.resolve()) and path.is_file() else None


Columns = dict[str, NDArray[np.float64]]


def _table(path: Path, subject: Subject) -> tuple[NDArray[np.float64], Columns]:
    """Return times, and the columns of Reals by name, of shape (rows, elements): those of an array share a cell."""
    with path.open(newline="", encoding="utf-8-sig") as file:
        header, *rows = [row for row in csv.reader(file) if row]
    reals = {v.name for v in subject.variables if v.type in REALS}
    columns = {
        name.strip(): np.array([row[i].split() for row in rows], dtype=float)
        for i, name in enumerate(header)
        if i == 0 or name.strip() in reals
    }
    return columns.pop(header[0].strip())[:, 0], columns


@check("reference results", runs=True)
def _references(subject: Subject) -> Outcome:
    found = list(experiments(subject.folder))
    if not found:
        return NOT_APPLICABLE, "It carries no reference results in CSV files (FMI-LS-REF)."
    done = [(each, *_worst(subject, each)) for each in found]
    wrong = [text for _, error, text in done if not error <= _TOLERANCE]
    if wrong:
        return FAILED, f"{' '.join(wrong)}{subject.log.tail()}"
    worst = max(error for _, error, _ in done)
    return PASSED, f"{', '.join(each.name for each in found)}: it gives its own results, within {worst:.1e} of the largest."


def _worst(subject: Subject, experiment: Experiment) -> tuple[float, str]:
    """Run an experiment; return the largest difference over the largest value of its column, and where it is."""
    time, expected = _table(experiment.results, subject)
    begin, stimuli = (time[:0], Columns()) if experiment.stimuli is None else _table(experiment.stimuli, subject)
    by_name = {v.name: v for v in subject.variables}
    start = time[0] if experiment.start is None else experiment.start
    usual = getattr(subject.description.defaultExperiment, "stepSize", None)
    size = experiment.size if experiment.size and experiment.size > 0.0 else float(usual or np.diff(time).min())
    steps = min(round((time[-1] - start) / size), _MOST_STEPS)

    def excite(one: InstanceUnderTest, at: float) -> None:
        for name, values in stimuli.items():
            held = by_name[name].variability == "discrete"
            row = max(int(np.searchsorted(begin, at + 1e-9 * size, side="right")) - 1, 0)
            one.set(by_name[name], [float(x[row] if held else np.interp(at, begin, x)) for x in values.T])

    found: dict[str, list[list[float]]] = {name: [] for name in expected}
    times = []
    with subject.instance(initialize=False) as one:
        for name, value in _parameters(experiment.parameters):
            if by_name[name].type in REALS:
                one.set(by_name[name], [value])
        one.initialize(lambda: excite(one, float(start)), float(start))
        for k in range(steps + 1):
            if k and not one.ended:
                excite(one, float(start + (k - 1) * size))
                one.advance(float(start + (k - 1) * size), size)
            times.append(start + k * size)
            for name, values in found.items():
                values.append(one.get(by_name[name]))
            if one.ended:
                break
    worst, text = 0.0, ""
    places = [(i, round((t - start) / size)) for i, t in enumerate(time)]
    shared = [(i, k) for i, k in places if 0 <= k < len(times) and abs(times[k] - time[i]) < 1e-6 * size]
    if not expected or len(shared) < time.size:
        rows = f"{len(shared)} of {time.size} rows of its results, with {len(expected)} columns of Reals"
        return math.inf, f"{experiment.name}: {rows}, were reached in {len(times)} steps of {size:.9g} s."
    for name, wanted in expected.items():
        a, b = np.array([wanted[i] for i, _ in shared]), np.array([found[name][k] for _, k in shared])
        errors = (abs(a - b) / (np.abs(wanted).max(initial=0.0) or 1.0)).max(axis=1, initial=0.0)
        if not errors.max(initial=0.0) <= worst:
            i = int(np.argmax(np.where(np.isnan(errors), np.inf, errors)))
            worst, at = float(errors[i]), f"t = {time[shared[i][0]]:.9g} s"
            got, should = (" ".join(f"{x:.9g}" for x in row) for row in (b[i], a[i]))
            text = f"{experiment.name}: {name} is {got} at {at}, and {should} in its results."
    return worst, text


def _parameters(path: Path | None) -> Iterator[tuple[str, float]]:
    """Give the Real parameters of a parameter set of SSP."""
    for parameter in [] if path is None else ElementTree.parse(path).getroot().iter():
        if parameter.tag.rpartition("}")[2] == "Parameter" and parameter[0].tag.rpartition("}")[2] in REALS:
            yield parameter.get("name", ""), float(parameter[0].get("value", "nan"))

"""Results as an xarray Dataset, and as netCDF and CSV files.

A scalar variable ``deflection`` of component ``membrane`` becomes ``membrane.deflection`` over ``time``. The elements
``strain[1]`` to ``strain[4]`` become one ``membrane.strain`` over ``time`` and ``strain_index``, labelled 1 to 4; ``w[2,3]``
lies at ``w_i = 2``, ``w_j = 3``. Units and descriptions are attributes.

The files: ``results.nc`` (netCDF 3, any tool reads it) holds everything including the scenario's text; ``results.csv`` has a
column per scalar, named ``component.variable [unit]``.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from os.path import commonprefix
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .errors import ResultsError
from .names import split_endpoint, split_indices
from .plan import ComponentPlan, Plan
from .recorder import Recorder

if TYPE_CHECKING:
    import xarray as xr

SCHEMA, VERSION = "gossamer.results", 1
NETCDF, CSV = "results.nc", "results.csv"


def make_dataset(plan: Plan, recorder: Recorder, **attributes: Any) -> xr.Dataset:  # noqa: ANN401
    """Arrange what a recorder holds, with units, descriptions and provenance.

    Parameters
    ----------
    plan : Plan
        What was run.
    recorder : Recorder
        What it produced so far.
    **attributes
        More attributes of the dataset, for instance how the run ended.
    """
    labels = []
    for component, name in recorder.columns:
        fmu = plan.component(component).fmu
        labels.append((f"{component}.{name}", fmu.unit(name) or "1", fmu.variables[name].description or ""))
    data = _arrange(recorder.time, recorder.table, labels)
    scenario = plan.scenario
    data.attrs = {
        "schema": SCHEMA,
        "version": VERSION,
        "title": scenario.title,
        "scenario_name": scenario.name,
        "scenario": scenario.source.text,
        "step": scenario.step,
        "master": scenario.master,
        "fmus": json.dumps({name: _provenance(plan.component(name)) for name in scenario.components}),
        "connections": json.dumps([(c.origin, c.target) for c in scenario.connections]),
        "versions": json.dumps({name: _version(name) for name in ("gossamer", "FMPy", "numpy")}),
    } | attributes
    return data


def _provenance(component: ComponentPlan) -> dict[str, Any]:
    """Describe a component: its FMU, what the scenario set, and all Real parameters with their values."""
    fmu, start = component.fmu, component.start
    values = {v: start.get(v, fmu.variables[v].start) for v in fmu.names("parameter", kind="Real")}
    return {
        "file": fmu.path.name,
        "model": fmu.description.modelName,
        "guid": fmu.guid,
        "start": start,
        "parameters": {v: float(value) for v, value in values.items() if value is not None},
    }


def _arrange(
    time: NDArray[np.float64], table: NDArray[np.float64], labels: Iterable[tuple[str, str, str]]
) -> xr.Dataset:
    """Group the columns of a table into variables; ``labels`` are name, unit and description of each column."""
    import xarray as xr

    groups: dict[str, list[tuple[tuple[int, ...], int]]] = {}
    units: dict[str, str] = {}
    descriptions: dict[str, list[str]] = {}
    for column, (name, unit, description) in enumerate(labels):
        base, indices = split_indices(name)
        if base in groups and len(groups[base][0][0]) != len(indices):
            base = name
        groups.setdefault(base, []).append((indices, column))
        units.setdefault(base, unit)
        descriptions.setdefault(base, []).append(description)
    coordinates: dict[str, Any] = {"time": ("time", time, {"units": "s", "long_name": "time"})}
    variables: dict[str, Any] = {}
    for base, members in groups.items():
        rank = len(members[0][0])
        axes = [sorted({indices[axis] for indices, _ in members}) for axis in range(rank)]
        dims = []
        for axis, values in enumerate(axes):
            suffix = "index" if rank == 1 else "ijk"[axis] if rank <= 3 else str(axis)
            dim = f"{split_endpoint(base)[1]}_{suffix}"
            if dim in coordinates and list(coordinates[dim][1]) != values:
                dim = f"{base}_{suffix}"
            coordinates[dim] = (dim, np.array(values, dtype=np.int32))
            dims.append(dim)
        array = np.full((len(time), *(len(values) for values in axes)), np.nan)
        for indices, column in members:
            place: tuple[Any, ...] = (slice(None), *(axes[axis].index(i) for axis, i in enumerate(indices)))
            array[place] = table[:, column]
        attributes = {"units": units[base], "long_name": _common(descriptions[base])}
        variables[base] = (("time", *dims), array, attributes)
    return xr.Dataset(variables, coords=coordinates)


def _common(descriptions: list[str]) -> str:
    """Return what the descriptions of all elements begin with, in whole words."""
    if len(set(descriptions)) == 1:
        return descriptions[0]
    common = commonprefix(descriptions)  # noqa: RUF071
    begin = re.sub(r"[^\w)]+$", "", common[: common.rfind(" ") + 1])
    return f"{begin} .." if begin else ""


def save_results(data: xr.Dataset, folder: Path) -> tuple[Path, Path]:
    """Write ``results.nc`` and ``results.csv`` into a folder, which is made if needed; return both paths.

    Raises
    ------
    ResultsError
        The folder cannot be written.
    """
    make_folder(folder)
    netcdf, table = folder / NETCDF, folder / CSV
    try:
        data.to_netcdf(netcdf, engine="scipy", format="NETCDF3_64BIT")
        _write_csv(data, table)
    except OSError as error:
        msg = f"cannot write results into {folder}: {error.strerror or error}. Name another folder with --out."
        raise ResultsError(msg) from error
    return netcdf, table


def make_folder(folder: Path) -> None:
    """Make a folder for results; raise ``ResultsError`` if that is not possible."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        msg = f"cannot make the folder {folder}: {error.strerror or error}. Name another one with --out."
        raise ResultsError(msg) from error


def _write_csv(data: xr.Dataset, path: Path) -> None:
    names, columns = ["time [s]"], [data["time"].to_numpy()]
    for base in data.data_vars:
        variable = data[base]
        unit = variable.attrs.get("units", "1")
        labels = [data[dim].to_numpy() for dim in variable.dims[1:]]
        for place in np.ndindex(*variable.shape[1:]):
            indices = ",".join(str(labels[axis][i]) for axis, i in enumerate(place))
            names.append(f"{base}[{indices}] [{unit}]" if indices else f"{base} [{unit}]")
            columns.append(variable.to_numpy()[(slice(None), *place)])
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(np.column_stack(columns).tolist())


def load_results(path: Path) -> xr.Dataset:
    """Read results from ``results.nc``, ``results.csv`` or a folder that holds them.

    A CSV file gives the same variables and units, without descriptions and provenance.

    Raises
    ------
    ResultsError
        There is nothing, or not what ``save_results`` wrote.
    """
    import xarray as xr

    path = Path(path)
    if path.is_dir():
        path = path / NETCDF
    if not path.is_file():
        msg = f"there are no results at {path}. Make them with 'gossamer run'."
        raise ResultsError(msg)
    try:
        if path.suffix == ".csv":
            return _load_csv(path)
        with xr.open_dataset(path, engine="scipy") as opened:
            data = opened.load()
    except (OSError, ValueError, TypeError, IndexError, StopIteration) as error:
        msg = f"cannot read results from {path}: {error}. Run the scenario again."
        raise ResultsError(msg) from error
    if (data.attrs.get("schema"), int(data.attrs.get("version", 0))) != (SCHEMA, VERSION):
        msg = (
            f"{path} holds {data.attrs.get('schema', 'no schema')!r}, this program reads {SCHEMA!r} version {VERSION}."
        )
        raise ResultsError(msg)
    return data


def _load_csv(path: Path) -> xr.Dataset:
    with path.open(newline="", encoding="utf-8") as file:
        header = next(csv.reader(file))
    table = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    labels = []
    for title in header[1:]:
        name, _, unit = title.removesuffix("]").rpartition(" [")
        labels.append((name, unit, ""))
    return _arrange(table[:, 0], table[:, 1:], labels)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"

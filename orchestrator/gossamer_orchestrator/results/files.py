"""Results on disk.

``results.nc`` (netCDF 3, any tool reads it) holds everything including the scenario's text; ``results.csv`` has a column per
scalar, named ``component.variable [unit]``.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import xarray as xr

from ..errors import ResultsError, writing
from .dataset import SCHEMA, VERSION, arrange

NETCDF, CSV = "results.nc", "results.csv"


def save_results(data: xr.Dataset, folder: Path) -> tuple[Path, Path]:
    """Write ``results.nc`` and ``results.csv`` into a folder, which is made if needed; return both paths.

    Raises
    ------
    ResultsError
        The folder cannot be written.
    """
    make_folder(folder)
    netcdf, table = folder / NETCDF, folder / CSV
    with writing(folder, ResultsError):
        data.to_netcdf(netcdf, engine="scipy", format="NETCDF3_64BIT")
        _write_csv(data, table)
    return netcdf, table


def make_folder(folder: Path) -> None:
    """Make a folder for results; raise ``ResultsError`` if that is not possible."""
    with writing(folder, ResultsError):
        folder.mkdir(parents=True, exist_ok=True)


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
        There is no file, or ``save_results`` did not write it.
    """
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
            f"{path} holds {data.attrs.get('schema', 'no schema')!r}, this program reads {SCHEMA!r} version {VERSION}. "
            "Run the scenario again."
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
    return arrange(table[:, 0], table[:, 1:], labels)

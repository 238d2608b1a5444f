"""Results on disk.

``results.nc`` (netCDF 3, any tool reads it) holds everything including the scenario's text; ``results.csv`` has a column per
scalar, named ``component.variable [unit]``. While a run goes on, and after its program was killed, ``unfinished.nc`` takes
the place of ``results.nc``: the rows so far, with the attribute ``ended`` "unfinished"; ``unfinished.npz`` is the state to
resume from. Results of a complete run are replaced by those of a complete run only: of one that ended early they stay in
``unfinished.nc`` beside them. What was made of earlier results, a page, pictures and what a twin found, goes with them.
``watch.json`` is what the digital twin found that watched the run.
"""

from __future__ import annotations

import csv
import json
import logging
import shutil
import weakref
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from gossamer_files import replacing
from numpy.typing import NDArray

from ..errors import ResultsError, check_path, writing
from ..names import split_endpoint
from .dataset import SCHEMA, VERSION, RecordedScalar, arrange, variables_of

if TYPE_CHECKING:
    import xarray as xr


logger = logging.getLogger(__name__)

NETCDF, CSV = "results.nc", "results.csv"
MESSAGES = "messages.txt"  # warnings of the run, a line each
UNFINISHED_NETCDF, RESUME, UNFINISHED_WATCH = "unfinished.nc", "unfinished.npz", "unfinished_watch.json"
WATCH = "watch.json"
TWIN = "twin.json"  # beside results too: what ``gossamer twin`` found; its page is in the folder ``twin``
OF_RUN = (NETCDF, CSV, MESSAGES, WATCH, RESUME, UNFINISHED_NETCDF, UNFINISHED_WATCH)  # what a run writes but shapes
RECORDED = (NETCDF, UNFINISHED_NETCDF, CSV)  # files that hold results
CSV_VALUES = 10_000_000  # above, a CSV file is written on demand only
MAKE_SOME = "Make them with 'gossamer run'."
MOST_NAMED = 3  # folders
_CSV_BYTES = 20  # a value, at most
_LOADED = 20_000_000  # [byte] results above stay on the disk until they are used
_CELLS, _CELLS_IF_WIDE = (
    150_000,
    500_000,
)  # values that are in memory at a time: a slice of a variable costs more than a value
_WIDE = 1000  # columns
_NEAR = 4_000_000  # [byte] of a file that are mapped at a time


def save_csv(data: xr.Dataset, folder: Path) -> None:
    """Write ``results.csv``; raise ``ResultsError`` if that is not possible."""
    path = folder / CSV
    size, free = _CSV_BYTES * values_in(data), shutil.disk_usage(folder).free
    if size > free:
        msg = f"{path} would take about {size / 1e6:.3g} MB, and {free / 1e6:.3g} MB are free. It was not written."
        raise ResultsError(msg)
    with writing(path, ResultsError), replacing(path) as new:
        _write_csv(data, new)


def values_in(data: xr.Dataset) -> int:
    """Count the values of a data set, times included."""
    return data.sizes["time"] + sum(variable.size for variable in variables_of(data).values())


def make_folder(folder: Path) -> None:
    """Make a folder for results; raise ``ResultsError`` if that is not possible."""
    check_path(folder, ResultsError)
    with writing(folder, ResultsError):
        folder.mkdir(parents=True, exist_ok=True)


def _write_csv(data: xr.Dataset, path: Path) -> None:
    names = ["time [s]"]
    variables = variables_of(data)
    for base, variable in variables.items():
        unit = variable.attrs.get("units", "1")
        inner = dict(zip(variable.dims[1:], variable.shape[1:], strict=True))
        labels = [data.variables[dim].to_numpy() if dim in data.variables else range(size) for dim, size in inner.items()]
        for place in np.ndindex(*variable.shape[1:]):
            indices = ",".join(str(labels[axis][i]) for axis, i in enumerate(place))
            names.append(f"{base}[{indices}] [{unit}]" if indices else f"{base} [{unit}]")
    rows = max(1, (_CELLS_IF_WIDE if len(names) > _WIDE else _CELLS) // len(names))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        for first in range(0, data.sizes["time"], rows):
            each = (data.variables["time"], *variables.values())
            whole = rows >= data.sizes["time"]  # a slice of one of ten thousand variables takes longer than its values
            parts = [v.to_numpy() if whole else v[first : first + rows].to_numpy() for v in each]
            columns = [part.reshape(len(part), -1) for part in parts]
            writer.writerows(np.hstack(columns).tolist())


def load_results(path: Path) -> xr.Dataset:
    """Read results from ``results.nc``, ``results.csv`` or a folder that holds them.

    A CSV file gives the same variables and units, without descriptions and provenance. A folder gives the results of a
    complete run, or else its last run: that is ``unfinished.nc`` if its program was killed or is still running. A warning
    says that there is such a file. Results above 20 MB stay on the disk until they are used, and have no index: select by
    place, or call ``set_xindex``.

    Raises
    ------
    ResultsError
        There is no file, or no run wrote it.
    """
    path = Path(path)
    check_path(path, ResultsError)
    if path.is_dir():
        folder, path = path, results_in(path)
        if _has_unfinished(folder):
            instead = f" {path}, of an earlier one, is read." * (path.name == NETCDF)
            logger.warning("%s is of a run that has not finished.%s", folder / UNFINISHED_NETCDF, instead)
        if not path.is_file():
            msg = f"the folder {folder} has no results. {others(folder) or MAKE_SOME}"
            raise ResultsError(msg)
    if not path.is_file():
        msg = f"there are no results at {path}. {others(path) or MAKE_SOME}"
        raise ResultsError(msg)
    if path.suffix == ".toml":
        msg = f"{path} is a scenario. Name the folder of its run, out/{path.stem} by default."
        raise ResultsError(msg)
    try:
        if path.suffix == ".csv":
            return _load_csv(path)
        data = _load_netcdf(path, on_disk=stays_on_disk(path))
        for name in ("connections", "effort", "fmus", "versions"):
            json.loads(data.attrs.get(name) or "{}")
    except (OSError, ValueError, TypeError, LookupError, StopIteration) as error:
        reason = str(error).partition("\n")[0]  # what follows advises to install a library for other files
        msg = f"cannot read results from {path}: {reason}. Run the scenario again."
        raise ResultsError(msg) from error
    if (data.attrs.get("schema"), int(data.attrs.get("version", 0))) != (SCHEMA, VERSION):
        msg = (
            f"{path} holds {data.attrs.get('schema', 'no schema')!r}, this program reads {SCHEMA!r} version {VERSION}. "
            "Run the scenario again."
        )
        raise ResultsError(msg)
    return data


def stays_on_disk(path: Path) -> bool:
    """Tell whether the values of a netCDF file are read when they are used."""
    return path.stat().st_size > _LOADED


def others(path: Path, names: Sequence[str] = RECORDED) -> str:
    """Name the folders that hold one of some files, below a path or else beside it; nothing if there is none."""
    for place in (path, path.parent):
        files = [file for name in names for depth in ("", "*/", "*/*/") for file in place.glob(f"{depth}{name}")]
        found = sorted({file.parent for file in files} - {path}, key=lambda each: (len(each.parts), each))
        near = get_close_matches(path.name, [each.name for each in found])
        found.sort(key=lambda each: each.name not in near)
        if found:
            more = f", or another of the {len(found)} in {place}" if len(found) > MOST_NAMED else ""
            return f"Did you mean {' or '.join(map(str, found[:MOST_NAMED]))}{more}?"
    return ""


def results_in(folder: Path) -> Path:
    """Return the results in a folder: those that the page and the pictures beside them are of."""
    return folder / (UNFINISHED_NETCDF if _has_unfinished(folder) and not has_complete(folder) else NETCDF)


def _has_unfinished(folder: Path) -> bool:
    return (folder / UNFINISHED_NETCDF).is_file() and has_rows(folder / UNFINISHED_NETCDF)


def is_finished(ended: str) -> bool:
    """Tell whether a run came to its end, or an FMU ended it in peace, by the attribute ``ended`` of its results."""
    return ended == "complete" or " ended the simulation at t = " in ended


def has_complete(folder: Path) -> bool:
    """Tell whether a folder has results that nothing but complete ones may replace; a file that cannot be read has."""
    if not (folder / NETCDF).is_file():
        return False
    try:
        with load_results(folder / NETCDF) as data:
            return is_finished(str(data.attrs.get("ended", "")))
    except ResultsError:
        return True


def has_rows(path: Path) -> bool:
    """Tell whether a netCDF file has a record."""
    with path.open("rb") as file:
        return file.read(8)[4:] > b"\0\0\0\0"


def _load_netcdf(path: Path, *, on_disk: bool) -> xr.Dataset:
    """Read a netCDF file that we wrote: as xarray does, without what that needs for each of ten thousand variables.

    What stays on the disk is mapped only while it is read, for all that a mapping has shown counts as memory of the program.
    """
    import xarray as xr
    from scipy.io import netcdf_file
    from xarray.core.indexing import IndexingSupport, LazilyIndexedArray, explicit_indexing_adapter

    class OnDisk(xr.backends.BackendArray):
        """Values of one variable in the file."""

        def __init__(self, data: NDArray[Any], opened: _Opened) -> None:
            self._opened = opened
            self.shape, self.dtype = data.shape, data.dtype.newbyteorder("=")
            whole = data
            while isinstance(whole.base, np.ndarray):
                whole = whole.base
            offset = data.__array_interface__["data"][0] - whole.__array_interface__["data"][0]
            self._form: Any = {"shape": data.shape, "dtype": data.dtype, "strides": data.strides, "offset": offset}

        def read(self, key: tuple[Any, ...]) -> NDArray[Any]:
            if not key or not isinstance(key[0], slice | np.ndarray):
                return self._mapped(key)
            rows, *others = key
            places = range(*rows.indices(self.shape[0])) if isinstance(rows, slice) else rows
            places = places if isinstance(places, np.ndarray) or places.step > 0 else np.array(places)
            found = None
            for first, last in _near(places, self._form["strides"][0]):
                part = self._mapped((places[first:last], *others))
                found = np.empty((len(places), *part.shape[1:]), self.dtype) if found is None else found
                found[first:last] = part
            return self._mapped(key) if found is None else found

        def _mapped(self, key: tuple[Any, ...]) -> NDArray[Any]:
            alone = [not isinstance(k, slice | range | np.ndarray) for k in key]
            key = tuple(slice(k.start, k.stop, k.step) if isinstance(k, range) else k for k in key)
            key = tuple(slice(k, k + 1) if one else k for k, one in zip(key, alone, strict=True))  # else axes change places
            view: NDArray[Any] = np.ndarray(buffer=np.memmap(self._opened.file, mode="r"), **self._form)
            return np.asarray(view[key], dtype=self.dtype)[tuple(0 if one else slice(None) for one in alone)]

        def __getitem__(self, key: Any) -> Any:  # noqa: ANN401
            return explicit_indexing_adapter(key, self.shape, IndexingSupport.OUTER_1VECTOR, self.read)

    def attributes(of: Any) -> dict[str, Any]:  # noqa: ANN401
        return {k: v.decode("utf-8", "replace") if isinstance(v, bytes) else v for k, v in of._attributes.items()}

    def content(data: NDArray[Any], *, whole: bool) -> Any:  # noqa: ANN401
        if not on_disk:
            return data.astype(data.dtype.newbyteorder("="), copy=False)
        there = OnDisk(data, opened)
        if not whole:
            return LazilyIndexedArray(there)
        return there.read((slice(None),))

    with netcdf_file(path, mmap=on_disk) as file:
        if on_disk:
            opened = _Opened(path)  # it stays the same file, whatever takes its name
        made = {
            name: xr.Variable(
                each.dimensions, content(each.data, whole=each.dimensions == (name,) != ("time",)), attributes(each)
            )
            for name, each in file.variables.items()
        }
        dims = {name for each in made.values() for name in each.dims}
        coordinates = {name: made.pop(name) for name in [*made] if name in dims}
        # an index over time would read it whole
        if not on_disk:
            return xr.Dataset(made, coordinates, attributes(file))
        found = xr.Dataset(made, xr.Coordinates(coordinates, indexes={}), attributes(file))
        found.set_close(opened.file.close)
        return found


def _near(places: range | NDArray[np.intp], size: int) -> list[tuple[int, int]]:
    """Divide rows of some bytes each into pieces that stand near each other in the file: first and last + 1 of each."""
    if isinstance(places, range):
        many = max(1, _NEAR // (size * abs(places.step)))
        return [(first, min(first + many, len(places))) for first in range(0, len(places), many)]
    ends = np.flatnonzero(np.diff(places * size // _NEAR)) + 1
    return list(pairwise([0, *ends.tolist(), len(places)])) if len(places) else []


class _Opened:
    """A file that is open as long as something is read from it: it is closed when the last of its variables goes."""

    def __init__(self, path: Path) -> None:
        self.file = path.open("rb")
        weakref.finalize(self, self.file.close)

    def __deepcopy__(self, _: object) -> Self:
        """Return it: only read, the copies of its variables share it."""
        return self


def _load_csv(path: Path) -> xr.Dataset:
    with path.open(newline="", encoding="utf-8") as file:
        header = next(csv.reader(file))
    table = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    columns = []
    for title in header[1:]:
        name, _, unit = title.removesuffix("]").rpartition(" [")
        model = split_endpoint(name)[0].rstrip("0123456789")  # a table names no models
        columns.append(RecordedScalar(name, unit, "", model))
    return arrange(table[:, 0], table[:, 1:], columns)


LARGE = 2.0  # chi2 per sample of a window that the twin does not explain


def read_watch(folder: Path) -> dict[str, Any] | None:
    """Read what the twin found, if it watched the run."""
    try:
        content = json.loads((folder / WATCH).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None


def unexplained(watched: Mapping[str, Any]) -> list[int]:
    """List the windows, from 0, that the twin does not explain, but for those from an alarm until what began was found.

    Until then it has not taken up what began, or found the sensor that the alarm came from; after the last alarm it has not.
    """
    times, alarms, agreed = watched.get("time", []), watched.get("alarms", []), watched.get("agreed", [])
    spans = [(alarm, min([time for time in agreed if time >= alarm], default=alarm)) for alarm in alarms]
    spans = [span for span in spans if span[0] < max(times, default=0.0)]
    spans += [(fault["alarm"], fault["time"]) for fault in watched.get("faults", [])]
    begun = {k for k, time in enumerate(times) for first, last in spans if first <= time <= last}
    begun |= {k + 1 for k, time in enumerate(times) if time in alarms}
    return [k for k, misfit in enumerate(watched.get("misfit", [])) if misfit > LARGE and k not in begun]


def is_explained(watched: Mapping[str, Any]) -> bool:
    """Tell whether the twin explains every window that it watched, and what followed each alarm."""
    return bool(watched.get("misfit")) and not watched.get("withheld") and not unexplained(watched)


def sees_enough(watched: Mapping[str, Any]) -> bool:
    """Tell whether the twin would have seen in every zone of a watch what it has to."""
    return all(seen is not None and seen <= watched["see"] for seen in watched.get("sees", []))

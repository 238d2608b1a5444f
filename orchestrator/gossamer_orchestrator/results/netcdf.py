"""Results that grow row by row on the disk, as a netCDF 3 file.

The format is chosen for its simplicity. In a netCDF 3 file (the variant with 64-bit offsets [1]_) all variables over an
unlimited dimension are kept as records, one after the other behind the header, whose first number counts them. So a row is
appended by writing its bytes and then the count. Whatever kills the program, the file is at any time a whole netCDF
file of the rows counted so far, which any tool reads, and finishing it moves no data: attributes with room reserved are
written in place. HDF5, and so netCDF 4, may lose a file that was not closed; Zarr would be many small files, and a
conversion at the end.

References
----------
.. [1] R. Rew et al., The NetCDF Users Guide, appendix "File format specifications", Unidata, doi:10.5065/D6H70CW6.
"""

from __future__ import annotations

import json
import math
import os
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gossamer_files.options import option
from numpy.typing import NDArray

from ..errors import ResultsError, writing
from .dataset import UNFINISHED, RecordedScalar, group

_ROOM = 4000  # bytes for the reason why a run ended
_CHUNK = 8_000_000  # bytes that are converted at a time


class Layout(NamedTuple):
    """Where things stand in a file.

    Attributes
    ----------
    begin : int
        Place of the first record [byte].
    width : int
        Numbers in a record.
    cells : list of int
        Place in a record of the time and of each column.
    places : dict
        Place of the values of the attributes that are written at the end [byte].
    """

    begin: int
    width: int
    cells: list[int]
    places: dict[str, int]

    @property
    def record(self) -> int:
        """Size of a record [byte]."""
        return 8 * self.width


def make_file(columns: Sequence[RecordedScalar], attributes: Mapping[str, Any]) -> tuple[bytes, Layout]:
    """Make the header of a file without records, and its layout.

    SciPy's writer takes a time that grows with the square of the number of variables.
    """
    variables, labels = group(columns)
    room = 6 * len("".join(names := json.loads(attributes.get("fmus", "{}")))) + 100 * len(names)
    ending = {"ended": UNFINISHED.ljust(_ROOM, "\0"), "effort": "\0" * room, "wall_time": 0.0}
    ending |= {"not_finite": 0, "divided_steps": 0}
    dims = ["time", *labels]
    header = b"CDF\2" + _integer(0) + _list(_DIMENSION, [_name("time") + _integer(0), *(
        _name(dim) + _integer(len(labels[dim])) for dim in labels
    )])  # fmt: skip
    at, places = len(header) + len(_attributes(attributes)), dict[str, int]()  # a value may read like a name: no search
    for name, value in ending.items():
        places[name] = at + len(_name(name)) + 8
        at += len(_attributes({name: value})) - len(_attributes({}))
    header += _attributes({**attributes, **ending})
    fixed = [np.array(values, dtype=">i4").tobytes() for values in labels.values()]
    described = [
        _variable(dim, [i], {}, _INTEGER, len(data)) for i, (dim, data) in enumerate(zip(labels, fixed, strict=True), 1)
    ]
    sizes = [len(data) for data in fixed]
    cells, width = [0] * (1 + len(columns)), 1
    described.append(_variable("time", [0], {"units": "s", "long_name": "time"}, _DOUBLE, 8))
    sizes.append(8)
    for each in variables:
        about = {"units": each.unit, "long_name": each.description}
        described.append(_variable(each.name, [0, *map(dims.index, each.dims)], about, _DOUBLE, 8 * each.size))
        sizes.append(8 * each.size)
        for cell, column in zip(each.cells, each.columns, strict=True):
            cells[1 + column] = width + cell
        width += each.size
    begin = len(header) + 8 + sum(len(text) + 8 for text in described)
    begins = begin + np.cumsum([0, *sizes[:-1]])
    header += _list(_VARIABLE, [text + struct.pack(">q", place) for text, place in zip(described, begins, strict=True)])
    header += b"".join(fixed)
    return header, Layout(len(header), width, cells, places)


_INTEGER, _CHARACTERS, _DOUBLE = 4, 2, 6  # types of netCDF
_DIMENSION, _VARIABLE, _ATTRIBUTE = 10, 11, 12  # what a list is of


def _integer(value: int) -> bytes:
    return struct.pack(">I", min(value, 2**32 - 1))  # netCDF caps the size of a variable here


def _padded(data: bytes) -> bytes:
    return data.ljust(4 * math.ceil(len(data) / 4), b"\0")


def _name(name: str) -> bytes:
    data = name.encode("latin1", "xmlcharrefreplace")  # as SciPy reads it
    return _integer(len(data)) + _padded(data)


def _list(kind: int, items: Sequence[bytes]) -> bytes:
    return _integer(kind if items else 0) + _integer(len(items)) + b"".join(items)


def _attributes(attributes: Mapping[str, Any]) -> bytes:
    items = []
    for name, value in attributes.items():
        if isinstance(value, str):
            data = value.encode()
            content = _integer(_CHARACTERS) + _integer(len(data)) + _padded(data)
        else:
            kind, code = (_DOUBLE, ">d") if isinstance(value, float) else (_INTEGER, ">i")
            content = _integer(kind) + _integer(1) + struct.pack(code, value)
        items.append(_name(name) + content)
    return _list(_ATTRIBUTE, items)


def _variable(name: str, dims: Sequence[int], attributes: Mapping[str, Any], kind: int, size: int) -> bytes:
    """Describe a variable, but for its place."""
    places = b"".join(_integer(each) for each in dims)
    return _name(name) + _integer(len(dims)) + places + _attributes(attributes) + _integer(kind) + _integer(size)


class GrowingFile:
    """A netCDF file to which rows are appended.

    Parameters
    ----------
    path : Path
        Where it is.
    layout : Layout
        As ``make_file`` gave it.

    Attributes
    ----------
    count : int
        Rows in it.
    """

    def __init__(self, path: Path, layout: Layout) -> None:
        self.path, self.layout = path, layout
        with self._opened() as file:
            file.seek(4)
            self.count = struct.unpack(">i", file.read(4))[0]

    @classmethod
    def reopen(cls, path: Path, header: bytes, layout: Layout, count: int) -> GrowingFile:
        """Continue a file after so many of its rows.

        Raises
        ------
        ResultsError
            It is not there, has another header or fewer rows.
        """
        file = cls(path, layout)
        with file._opened() as opened:
            there = opened.read(layout.begin)
        first, last = layout.places["ended"], layout.places["divided_steps"] + 4
        file.resume(count, fits=(there[8:first], there[last:]) == (header[8:first], header[last:]))
        file.end(UNFINISHED, 0.0)
        return file

    def append(self, rows: NDArray[np.float64]) -> None:
        """Append rows of time and columns.

        Raises
        ------
        ResultsError
            They cannot be written; the file holds what it held before.
        """
        at_once = max(1, _CHUNK // self.layout.record)
        for first in range(0, len(rows), at_once):
            part = rows[first : first + at_once]
            records = np.full((len(part), self.layout.width), np.nan, dtype=">f8")
            records[:, self.layout.cells] = part
            self._write({self.layout.begin + self.count * self.layout.record: records.tobytes()})
            self.cut(self.count + len(part))

    def resume(self, count: int, *, fits: bool = True) -> None:
        """Go on after so many of the rows; raise ``ResultsError`` if there are fewer, or the file does not fit."""
        if not fits or self.count < count:
            left = option("resume", True)
            msg = f"{self.path} does not fit the state to resume from. Run it from its start, without {left}."
            raise ResultsError(msg)
        self.cut(count)

    def cut(self, count: int) -> None:
        """Let the file have so many of the rows that were written."""
        self._write({4: struct.pack(">i", count)})
        self.count = count

    def last_time(self) -> float:
        """Return the time of the last row [s]."""
        with self._opened() as file:
            file.seek(self.layout.begin + (self.count - 1) * self.layout.record)
            return float(struct.unpack(">d", file.read(8))[0])

    def end(
        self, ended: str, wall_time: float, counts: Sequence[int] = (0, 0), effort: Mapping[str, Any] | None = None
    ) -> None:
        """Write how the run ended and what its components took, and make sure that everything is on the disk.

        ``counts`` are how many values were not finite, and how many steps were divided.
        """
        text, spent = ended.encode()[:_ROOM].decode(errors="ignore").encode(), json.dumps(effort or {}).encode()
        places = self.layout.places
        room = places["wall_time"] - places["effort"] - len(_name("wall_time")) - 8
        contents = {
            places["ended"]: text.ljust(_ROOM, b"\0"),
            places["effort"]: (spent if len(spent) <= room else b"").ljust(room, b"\0"),
            places["wall_time"]: struct.pack(">d", wall_time),
            places["not_finite"]: struct.pack(">i", counts[0]),
            places["divided_steps"]: struct.pack(">i", counts[1]),
        }
        self._write(contents, sync=True)

    @contextmanager
    def _opened(self) -> Iterator[FileIO]:
        """Open it as long as it is read or written, and no longer: an FMU may write to every open file."""
        with writing(self.path, ResultsError), FileIO(self.path, "r+") as file:
            yield file

    def _write(self, contents: Mapping[int, bytes], *, sync: bool = False) -> None:
        with self._opened() as file:
            for place, data in contents.items():
                file.seek(place)
                left = memoryview(data)
                while left:
                    left = left[file.write(left) :]
            if sync:
                os.fsync(file.fileno())

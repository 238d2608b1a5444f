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

import math
import os
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gossamer_files.options import option
from numpy.typing import NDArray

from ..errors import ResultsError, writing
from .columns import UNFINISHED, Column, Variable, group

_DIMENSION, _VARIABLE, _ATTRIBUTE = 10, 11, 12
_CHAR, _INT, _DOUBLE = 2, 4, 6
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


def make_file(columns: Sequence[Column], attributes: Mapping[str, Any]) -> tuple[bytes, Layout]:
    """Make the header of a file without records, and its layout."""
    variables, labels = group(columns)
    ending = {"ended": UNFINISHED.encode().ljust(_ROOM, b"\0"), "wall_time": 0.0, "divided_steps": 0}
    size = len(_Header(variables, labels, {**attributes, **ending}, begin=0).data)
    header = _Header(variables, labels, {**attributes, **ending}, begin=size)
    cells = [0] * (1 + len(columns))
    width = 1
    for variable in variables:
        for cell, column in zip(variable.cells, variable.columns, strict=True):
            cells[1 + column] = width + cell
        width += variable.size
    data = bytes(header.data + header.fixed)
    return data, Layout(len(data), width, cells, {name: header.places[name] for name in ending})


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
        with writing(path, ResultsError):
            self._file = path.open("r+b", buffering=0)
            self._file.seek(4)
            self.count = struct.unpack(">i", self._file.read(4))[0]

    @classmethod
    def create(cls, path: Path, header: bytes, layout: Layout) -> GrowingFile:
        """Start a file without rows."""
        with writing(path, ResultsError):
            path.write_bytes(header)
        return cls(path, layout)

    @classmethod
    def reopen(cls, path: Path, header: bytes, layout: Layout, count: int) -> GrowingFile:
        """Continue a file after so many of its rows.

        Raises
        ------
        ResultsError
            It is not there, has another header or fewer rows.
        """
        file = cls(path, layout)
        file._file.seek(0)
        there = file._file.read(layout.begin)
        first, last = layout.places["ended"], layout.places["divided_steps"] + 4
        if (there[8:first], there[last:]) != (header[8:first], header[last:]) or file.count < count:
            file.close()
            msg = f"{path} does not fit the state to resume from. Run it from its start, without {option('resume', True)}."
            raise ResultsError(msg)
        file.cut(count)
        file.end(UNFINISHED, 0.0, 0)
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
            with writing(self.path, ResultsError):
                self._write(self.layout.begin + self.count * self.layout.record, records.tobytes())
            self.cut(self.count + len(part))

    def cut(self, count: int) -> None:
        """Let the file have so many of the rows that were written."""
        with writing(self.path, ResultsError):
            self._write(4, struct.pack(">i", count))
        self.count = count

    def last_time(self) -> float:
        """Return the time of the last row [s]."""
        self._file.seek(self.layout.begin + (self.count - 1) * self.layout.record)
        return float(struct.unpack(">d", self._file.read(8))[0])

    def end(self, ended: str, wall_time: float, divided_steps: int) -> None:
        """Write how the run ended, and make sure that everything is on the disk."""
        text = ended.encode()[:_ROOM].decode(errors="ignore").encode()
        with writing(self.path, ResultsError):
            self._write(self.layout.places["ended"], text.ljust(_ROOM, b"\0"))
            self._write(self.layout.places["wall_time"], struct.pack(">d", wall_time))
            self._write(self.layout.places["divided_steps"], struct.pack(">i", divided_steps))
            os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close it."""
        self._file.close()

    def _write(self, place: int, data: bytes) -> None:
        self._file.seek(place)
        left = memoryview(data)
        while left:
            left = left[self._file.write(left) :]


class _Header:
    """A header under construction; ``fixed`` are the values that follow it, ``places`` those of the run's attributes."""

    def __init__(
        self, variables: Sequence[Variable], labels: Mapping[str, list[int]], attributes: Mapping[str, Any], begin: int
    ) -> None:
        self.data, self.fixed = bytearray(b"CDF\x02"), bytearray()
        self.places: dict[str, int] = {}
        self._integers(0, _DIMENSION, 1 + len(labels))
        for dim, length in {"time": 0, **{dim: len(values) for dim, values in labels.items()}}.items():
            self._text(dim)
            self._integers(length)  # 0 is unlimited
        numbers = {dim: number for number, dim in enumerate(["time", *labels])}
        self.places = self._attributes(attributes)
        self._integers(_VARIABLE, len(labels) + 1 + len(variables))
        for dim, values in labels.items():
            self._variable(dim, [numbers[dim]], {}, _INT, 4 * len(values), begin + len(self.fixed))
            self.fixed += struct.pack(f">{len(values)}i", *values)
        place = begin + sum(4 * len(values) for values in labels.values())
        self._variable("time", [0], {"units": "s", "long_name": "time"}, _DOUBLE, 8, place)
        place += 8
        for each in variables:
            described = {"units": each.unit, "long_name": each.description}
            dims = [0, *(numbers[dim] for dim in each.dims)]
            self._variable(each.name, dims, described, _DOUBLE, 8 * each.size, place)
            place += 8 * each.size

    def _integers(self, *values: int) -> None:
        self.data += struct.pack(f">{len(values)}i", *values)

    def _padded(self, content: bytes) -> None:
        self.data += content.ljust(4 * math.ceil(len(content) / 4), b"\0")

    def _text(self, text: str) -> None:
        self._integers(len(text.encode()))
        self._padded(text.encode())

    def _attributes(self, attributes: Mapping[str, Any]) -> dict[str, int]:
        """Write attributes and return the places of their values."""
        places = {}
        self._integers(_ATTRIBUTE if attributes else 0, len(attributes))
        for name, value in attributes.items():
            self._text(name)
            content = value.encode() if isinstance(value, str) else value
            kind = _CHAR if isinstance(content, bytes) else _INT if isinstance(content, int) else _DOUBLE
            self._integers(kind, len(content) if isinstance(content, bytes) else 1)
            places[name] = len(self.data)
            self._padded(
                content if isinstance(content, bytes) else struct.pack(">i" if kind == _INT else ">d", content)
            )
        return places

    def _variable(
        self, name: str, dims: Sequence[int], attributes: Mapping[str, str], kind: int, size: int, begin: int
    ) -> None:
        self._text(name)
        self._integers(len(dims), *dims)
        self._attributes(attributes)
        self._integers(kind, min(size, 2**31 - 1))
        self.data += struct.pack(">q", begin)

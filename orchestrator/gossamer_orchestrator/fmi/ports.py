"""Groups of variables of one instance that are read or written together: Reals through a shared buffer, others as values."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .types import Value, c_type, suffix


class Port:
    """Real variables of one instance that are read or written together.

    Attributes
    ----------
    values : numpy.ndarray
        Their buffer, contiguous; may be a view into a larger array.
    arguments : tuple
        What the functions of FMI that get and set Reals are called with.
    """

    __slots__ = ("arguments", "size", "values")

    def __init__(
        self, component: ctypes.c_void_p, references: list[int], values: NDArray[np.float64], *, counted: bool
    ) -> None:
        self.size = len(values)
        self.values = values
        count = (ctypes.c_size_t(self.size),) if counted else ()  # FMI 3.0 counts the elements of arrays, too
        self.arguments = (
            component,
            (ctypes.c_uint32 * len(references))(*references),
            ctypes.c_size_t(len(references)),
            values.ctypes.data_as(ctypes.c_void_p),
            *count,
        )


class TypedPort:
    """Variables of one other type that are read or written together, as Python values.

    Parameters
    ----------
    kind : str
        Their type.
    component : ctypes.c_void_p
        The instance.
    references : list of int
        Their value references; an array of FMI 3.0 has one.
    size : int
        Number of values.
    version : int
        Of FMI, 2 or 3.
    """

    def __init__(self, kind: str, component: ctypes.c_void_p, references: list[int], size: int, version: int) -> None:
        self.kind = kind
        self.size = size
        self.suffix = suffix(kind, version)
        self._buffer = (c_type(kind, version) * size)()
        self._sizes = (ctypes.c_size_t * size)()
        self._kept: list[Any] = []
        sizes = (self._sizes,) if kind == "Binary" else ()
        count = (ctypes.c_size_t(size),) if version == 3 else ()
        self.arguments = (
            component,
            (ctypes.c_uint32 * len(references))(*references),
            ctypes.c_size_t(len(references)),
            *sizes,
            self._buffer,
            *count,
        )

    def get(self) -> list[Value]:
        """Return what the FMU has written into the buffer."""
        values: list[Any] = self._buffer[:]
        if self.kind == "String":
            return [(text or b"").decode("utf-8", "replace") for text in values]
        if self.kind == "Binary":
            return [ctypes.string_at(at, size) if at else b"" for at, size in zip(values, self._sizes, strict=True)]
        return [value != 0 for value in values] if self.kind == "Boolean" else values

    def put(self, values: list[Any]) -> None:
        """Write values into the buffer, for the FMU to read."""
        if self.kind == "String":
            values = [text.encode() for text in values]
        elif self.kind == "Binary":
            self._kept = [ctypes.create_string_buffer(data, max(len(data), 1)) for data in values]
            self._sizes[:] = [len(data) for data in values]
            values = [ctypes.addressof(data) for data in self._kept]
        self._buffer[:] = values

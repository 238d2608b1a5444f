"""The types and units of FMI's variables, and ports: variables of one instance and type that are read or written together.

FMI 2.0 and 3.0 have two names for one type: Real is Float64, and Integer is Int32. Here the first of each is used. Reals go
through a shared buffer, other types as Python values.

Two units agree if their SI exponents, factor and offset agree, whatever their names. A variable without a unit agrees with
everything, because FMI 2.0 does not require one. A unit's definition is FMPy's ``BaseUnit``, or None.
"""

from __future__ import annotations

import ctypes
import math
from typing import Any

import numpy as np
from fmpy.model_description import BaseUnit
from gossamer_files.measured.units import in_base_units
from numpy.typing import NDArray

from ..errors import require

SAME = {"Float64": "Real", "Int32": "Integer"}  # FMI 3.0's name: the one used here
FLOATS = ("Real", "Float32")
LARGEST_EXACT = 2**53  # integers up to here are exact as floats

_BITS = {"Int8": 8, "Int16": 16, "Integer": 32, "Int64": 64, "UInt8": -8, "UInt16": -16, "UInt32": -32, "UInt64": -64}
RANGES = {name: (0, 2**-bits - 1) if bits < 0 else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for name, bits in _BITS.items()}
RANGES["Enumeration"] = RANGES["Integer"]
INTEGERS = tuple(RANGES)
TEXTS = ("String", "Binary")
EXCHANGED_EXACTLY = ("Int64", "UInt64", *TEXTS)  # what a float may not hold
NUMBERS = (*FLOATS, *INTEGERS, "Boolean")

_HELD = {"Boolean": (0, 1), "Real": (-LARGEST_EXACT, LARGEST_EXACT), "Float32": (-(2**24), 2**24)} | RANGES


def holds(received: str, sent: str) -> bool:
    """Tell whether a type takes every value of another: floats agree, integers fit, a truth value is 0 or 1."""
    if sent == received or (sent in FLOATS and received in FLOATS):
        return True
    if received == "Boolean" or sent in FLOATS or not {sent, received} <= _HELD.keys():
        return False
    (low, high), (least, most) = _HELD[sent], _HELD[received]
    return bool(least <= low and high <= most)


Value = bool | int | float | str | bytes

_C_TYPES: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Float32": ctypes.c_float,
    "String": ctypes.c_char_p,
    "Binary": ctypes.c_void_p,
} | {name: getattr(ctypes, f"c_{'u' * (bits < 0)}int{abs(bits)}") for name, bits in _BITS.items()}


def c_type(kind: str, version: int) -> Any:  # noqa: ANN401
    """Return the C type of a variable in a version of FMI; truth values and enumerations differ between the two."""
    if kind == "Boolean":
        return ctypes.c_int if version == 2 else ctypes.c_bool
    if kind == "Enumeration":
        return ctypes.c_int32 if version == 2 else ctypes.c_int64
    return _C_TYPES[kind]


def suffix(kind: str, version: int) -> str:
    """Return what follows fmi2Get or fmi3Get in the name of the function for a type."""
    if kind == "Enumeration":
        return "Integer" if version == 2 else "Int64"
    return kind if version == 2 else {"Real": "Float64", "Integer": "Int32"}.get(kind, kind)


def parse(kind: str, text: str | None) -> Value:
    """Read a start value as a model description writes it; without one, the type's zero; ``ValueError`` if it is none."""
    if kind in FLOATS:
        return float(text or 0.0)
    if kind in INTEGERS:
        return int(text or 0)
    if kind == "Boolean":
        require(text in ("true", "1", "false", "0", "", None), f"{text!r} is neither true nor false", ValueError)
        return text in ("true", "1")
    return bytes.fromhex(text or "") if kind == "Binary" else text or ""


def cast(kind: str, value: float) -> Value:
    """Turn a float into the value of another type that is nearest to it; ``ValueError`` if there is none."""
    if kind in FLOATS:
        return value
    if kind == "Boolean":
        return value != 0.0
    low, high = RANGES[kind]
    require(low - 0.5 < value < high + 0.5, f"{value:.9g} is no {kind}", ValueError)
    return round(value)


class Port:
    """Variables of one instance and type that are read or written together.

    Parameters
    ----------
    library : ctypes.CDLL
        Of the instance, without FMPy's argument types.
    component : ctypes.c_void_p
        The instance.
    version : int
        Of FMI, 2 or 3.
    kind : str
        Their type.
    references : list of int
        Their value references; an array of FMI 3.0 has one.
    values : numpy.ndarray
        Buffer of Reals, contiguous; may be a view into a larger array. Of other types its length is their number.

    Attributes
    ----------
    get_them, set_them : callable
        Functions of FMI, to be called with ``arguments``.
    """

    def __init__(
        self,
        library: ctypes.CDLL,
        component: ctypes.c_void_p,
        version: int,
        kind: str,
        references: list[int],
        values: NDArray[np.float64],
    ) -> None:
        self.kind, self.values, self.size = kind, values, len(values)
        self.get_them, self.set_them = (library[f"fmi{version}{do}{suffix(kind, version)}"] for do in ("Get", "Set"))
        self._buffer = np.ctypeslib.as_ctypes(values) if kind == "Real" else (c_type(kind, version) * self.size)()
        self._sizes = (ctypes.c_size_t * self.size)()
        self._kept: list[Any] = []
        self.arguments = (
            component,
            (ctypes.c_uint32 * len(references))(*references),
            ctypes.c_size_t(len(references)),
            *((self._sizes,) if kind == "Binary" else ()),
            self._buffer,
            *((ctypes.c_size_t(self.size),) if version == 3 else ()),  # FMI 3.0 counts the elements of arrays, too
        )

    def get(self) -> list[Value]:
        """Return what the FMU has written into the buffer."""
        values: list[Any] = self._buffer[:]
        if self.kind == "String":
            return [(text or b"").decode("utf-8", "replace") for text in values]
        if self.kind == "Binary":
            return [ctypes.string_at(at, size) if at else b"" for at, size in zip(values, self._sizes, strict=True)]
        return [value != 0 for value in values] if self.kind == "Boolean" else values

    def put(self, values: list[Any]) -> Port:
        """Write values into the buffer, for the FMU to read, and return the port."""
        if self.kind == "String":
            values = [text.encode() for text in values]
        elif self.kind == "Binary":
            self._kept = [ctypes.create_string_buffer(data, max(len(data), 1)) for data in values]
            self._sizes[:] = [len(data) for data in values]
            values = [ctypes.addressof(data) for data in self._kept]
        self._buffer[:] = values
        return self


POWERS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


def powers(unit: Any) -> dict[str, int]:  # noqa: ANN401
    """Return the SI exponents of a unit that are not zero, by base unit."""
    return {name: getattr(unit, name) for name in POWERS if getattr(unit, name)}


def scale(unit: Any) -> dict[str, float]:  # noqa: ANN401
    """Return what defines a unit: its SI exponents, and its factor and offset if they change anything."""
    defined: dict[str, float] = {**powers(unit)}
    if unit.factor != 1.0:
        defined["factor"] = unit.factor
    if unit.offset:
        defined["offset"] = unit.offset
    return defined


def definition_of(name: str) -> BaseUnit | None:
    """Return what a unit is in SI, as pint knows it; None if it is none, or no factor and offset convert it."""
    found = in_base_units(name)
    return (
        BaseUnit(factor=found.factor, offset=found.offset, **found.powers)
        if found and set(found.powers) <= set(POWERS)
        else None
    )


def conversion(a: Any, b: Any) -> tuple[float, float] | None:  # noqa: ANN401
    """Return gain and bias that convert a value from unit ``a`` to unit ``b``; None if no finite numbers do."""
    if a is None or b is None or powers(a) != powers(b) or b.factor == 0.0:
        return None
    gain, bias = a.factor / b.factor, (a.offset - b.offset) / b.factor
    return (gain, bias) if gain != 0.0 and math.isfinite(gain) and math.isfinite(bias) else None


def mismatch(a_name: str | None, a: Any, b_name: str | None, b: Any) -> str | None:  # noqa: ANN401
    """Compare the units of the two ends of a connection.

    Parameters
    ----------
    a_name, b_name : str or None
        Unit names at both ends.
    a, b : fmpy.model_description.BaseUnit or None
        Their definitions.

    Returns
    -------
    str or None
        What differs; None if nothing does.
    """
    if a_name is None or b_name is None or ((a is None or b is None) and a_name == b_name):
        return None
    gain, bias = conversion(a, b) or (math.nan, math.nan)
    if math.isclose(gain, 1.0, rel_tol=1e-12) and math.isclose(bias, 0.0, abs_tol=1e-12):
        return None
    return f"{_text(a_name, a if b else None)} is not {_text(b_name, b if a else None)}"


def _text(name: str, unit: Any) -> str:  # noqa: ANN401
    """Write a unit with its definition if it has one, for instance ``'kPa' (1000 kg m-1 s-2)``."""
    if unit is None:
        return repr(name)
    exponents = [f"{base}{power if power != 1 else ''}" for base, power in powers(unit).items()]
    factor = [f"{unit.factor:g}"] if unit.factor != 1.0 or not exponents else []
    offset = [f"+ {unit.offset:g}"] if unit.offset else []
    return f"{name!r} ({' '.join(factor + exponents + offset)})"

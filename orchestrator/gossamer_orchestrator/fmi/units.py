"""Compare and convert the units of two variables of different FMUs.

Two units agree if their SI exponents, factor and offset agree, whatever their names. A variable without a unit agrees with
everything, because FMI 2.0 does not require one. A unit's definition is FMPy's ``BaseUnit``, or None.
"""

from __future__ import annotations

import math
from typing import Any

from fmpy.model_description import BaseUnit
from gossamer_files.measured.units import unit_registry

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


_BASES = {
    "kilogram": "kg",
    "meter": "m",
    "second": "s",
    "ampere": "A",
    "kelvin": "K",
    "mole": "mol",
    "candela": "cd",
    "radian": "rad",
}
_WIDE = 1000.0  # of a unit: apart from 0, so that rounding of an offset does not reach the factor


def definition_of(name: str) -> BaseUnit | None:
    """Return what a unit is in SI, as pint knows it; None if it is none, or no factor and offset convert it."""
    registry, errors = unit_registry()
    try:
        unit = registry.Unit(name)
        zero, one, many = (registry.Quantity(x, unit).to_base_units() for x in (0.0, 1.0, _WIDE))
    except errors:
        return None
    exponents = {_BASES.get(base, ""): int(power) for base, power in one.unit_items()}
    offset, factor = zero.magnitude, (many.magnitude - zero.magnitude) / _WIDE
    linear = math.isclose(one.magnitude, factor + offset, rel_tol=1e-12)
    return BaseUnit(factor=factor, offset=offset, **exponents) if linear and "" not in exponents else None


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

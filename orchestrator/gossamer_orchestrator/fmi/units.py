"""Compare the units of two variables of different FMUs.

Two units agree if their SI exponents, factor and offset agree, whatever their names. A variable without a unit agrees with
everything, because FMI 2.0 does not ask for one.
"""

from __future__ import annotations

import math
from typing import Any

POWERS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


def mismatch(origin: str | None, target: str | None, definitions: tuple[dict[str, Any], dict[str, Any]]) -> str | None:
    """Compare the units of the two ends of a connection.

    Parameters
    ----------
    origin, target : str or None
        Unit names at both ends.
    definitions : tuple of dict
        FMPy's ``BaseUnit`` (or None) by unit name, of both FMUs.

    Returns
    -------
    str or None
        What differs; None if nothing does.
    """
    if origin is None or target is None:
        return None
    a, b = definitions[0].get(origin), definitions[1].get(target)
    if a is None or b is None:
        return None if origin == target else f"{origin!r} is not {target!r}"
    if any(getattr(a, e) != getattr(b, e) for e in POWERS):
        return f"{_text(origin, a)} is not {_text(target, b)}"
    if not math.isclose(a.factor, b.factor, rel_tol=1e-12) or not math.isclose(a.offset, b.offset, abs_tol=1e-12):
        return f"{_text(origin, a)} is not {_text(target, b)}"
    return None


def factors(a: Any, b: Any) -> tuple[float, float] | None:  # noqa: ANN401
    """Return gain and bias that convert a value from unit ``a`` to unit ``b``; None if no finite numbers do."""
    if a is None or b is None or any(getattr(a, e) != getattr(b, e) for e in POWERS):
        return None
    if b.factor == 0.0:
        return None
    gain, bias = a.factor / b.factor, (a.offset - b.offset) / b.factor
    return (gain, bias) if gain != 0.0 and math.isfinite(gain) and math.isfinite(bias) else None


def conversion(
    origin: str | None, target: str | None, definitions: tuple[dict[str, Any], dict[str, Any]]
) -> str | None:
    """Write the manipulators that convert between two units of one dimension; None if no finite numbers do."""
    found = factors(definitions[0].get(origin or ""), definitions[1].get(target or ""))
    if found is None:
        return None
    gain, bias = found
    return f"gain = {gain:g}" + (f", bias = {bias:g}" if bias else "")


def _text(name: str, unit: Any) -> str:  # noqa: ANN401
    """Write a unit with its definition, for instance ``'kPa' (1000 kg m-1 s-2)``."""
    powers = [f"{e}{getattr(unit, e) if getattr(unit, e) != 1 else ''}" for e in POWERS if getattr(unit, e)]
    factor = [f"{unit.factor:g}"] if unit.factor != 1.0 or not powers else []
    offset = [f"+ {unit.offset:g}"] if unit.offset else []
    return f"{name!r} ({' '.join(factor + powers + offset)})"

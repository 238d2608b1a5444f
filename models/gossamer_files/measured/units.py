"""Units of time, strain and resistance, by the names that meters and spreadsheets give them.

Pint knows the units and their prefixes; ``SPELLINGS`` turns those that it lacks into its own. A prefix keeps its letter
case: ``MOhm`` is a million ohm and ``mOhm`` a thousandth.
"""

from __future__ import annotations

import math
import re
from functools import cache
from typing import Any, NamedTuple

SI = {"time": "s", "strain": "1", "resistance": "ohm"}  # units inside, by what a column holds
ANY_CASE = ("time", "strain")  # where the case of a letter makes no other unit that anyone uses
SPELLINGS = (
    (re.compile("ohms?|[Ω\N{OHM SIGN}]", re.IGNORECASE), "ohm"),
    (re.compile("meg(?=ohm)", re.IGNORECASE), "mega"),
    (re.compile("K(?=ohm)"), "k"),
    (re.compile("pct|per cent|per_cent"), "percent"),
)
STRAIN = re.compile(r"(µ|μ|u|micro|m|milli|) ?(ε|epsilon|strain)")
STRAIN_PREFIXES = {"µ": 1e-6, "μ": 1e-6, "u": 1e-6, "micro": 1e-6, "m": 1e-3, "milli": 1e-3, "": 1.0}
ONE_UNIT = re.compile(r"[^\W\d_]+|[%‰]|([µμ]?m+) ?/ ?m+")
NAMES = ("t", "r")  # of columns, though pint has units of these names
ANY_UNIT = re.compile(r"(1/)?°?[^\W\d_]+(\^?[23²³])?([ */·]°?[^\W\d_]+(\^?[23²³])?)*")
LENGTH = re.compile(r"[cmnuµμ]?m|inch(?:es)?|(?:milli|centi|micro)?met(?:er|re)s?")  # of a displacement
_WIDE = 1000.0  # of a unit: apart from 0, so that rounding of an offset does not reach the factor
ANGLES = ("radian", "degree", "turn", "bit", "count")  # without a dimension, yet no strains


@cache
def factor(text: str, what: str) -> float | None:
    """Return the factor from a unit to SI [1], or None if the text is no unit of such a column.

    Parameters
    ----------
    text : str
        Name of a unit, for instance ``kΩ``, ``ms`` or ``µε``.
    what : str
        ``time``, ``strain`` or ``resistance``; a signal that is linear in the resistance has the unit ``1`` or ``%``.
        Of a ``value`` any unit is one, and it stays.
    """
    text = text.strip()
    if what == "value":
        return 1.0 if is_unit(text) else None
    found = _factor(text, what)
    if found is None and what in ANY_CASE and text != text.lower():
        found = _factor(text.lower(), what)
    return found


def _factor(text: str, what: str) -> float | None:
    if text == "1":
        return None if what == "time" else 1.0
    if what == "strain" and (match := STRAIN.fullmatch(text)):
        return STRAIN_PREFIXES[match[1]]
    for pattern, name in SPELLINGS:
        text = pattern.sub(name, text)
    if not ONE_UNIT.fullmatch(text):
        return None
    registry, errors = unit_registry()
    try:
        unit = registry.Unit(text)
        if any(angle in str(unit) for angle in ANGLES):
            return None
        si = SI[what] if what == "time" or not unit.dimensionless else "dimensionless"
        return float(registry.Quantity(1.0, unit).to(si if what != "strain" else "dimensionless").magnitude)
    except errors:
        return None


@cache
def conversion(text: str, to: str) -> float | None:
    """Return the factor from a unit to another one, of any quantity, or None if there is none."""
    registry, errors = unit_registry()
    powers = re.compile(r"(?<=[^\W\d_])\^?([2-9])")  # m/s2
    try:
        units = [registry.Unit(powers.sub(r"**\1", each) if each != "1" else "dimensionless") for each in (text, to)]
        one, nothing = (registry.Quantity(value, units[0]).to(units[1]).magnitude for value in (1.0, 0.0))
        return float(one - nothing)  # a rise of temperature in degC is one in K
    except errors:
        return None


class InBaseUnits(NamedTuple):
    """A unit over SI base units: ``factor * value + offset``, with whole powers of base units by their symbols."""

    factor: float
    offset: float
    powers: dict[str, int]


@cache
def in_base_units(text: str) -> InBaseUnits | None:
    """Return what a unit is in base units; None if it is none, or no factor, offset and whole powers say it."""
    registry, errors = unit_registry()
    try:
        unit = registry.Unit(text if text != "1" else "dimensionless")
        zero, one, many = (registry.Quantity(value, unit).to_base_units() for value in (0.0, 1.0, _WIDE))
        powers = {registry.get_symbol(base): power for base, power in one.unit_items()}
    except errors:
        return None
    offset = float(zero.magnitude)
    factor = float((many.magnitude - offset) / _WIDE if offset else one.magnitude)
    linear = all(
        math.isclose(each.magnitude, size * factor + offset, rel_tol=1e-12) for each, size in ((one, 1.0), (many, _WIDE))
    )
    whole = all(power == int(power) for power in powers.values())
    return InBaseUnits(factor, offset, {base: int(power) for base, power in powers.items()}) if linear and whole else None


@cache
def is_unit(text: str) -> bool:
    """Tell whether a text is a unit, of any quantity; a letter that names a column of time or resistance is none."""
    if text.lower() in NAMES:
        return False
    if any(factor(text, what) is not None for what in SI):
        return True
    registry, errors = unit_registry()
    try:
        return ANY_UNIT.fullmatch(text) is not None and registry.Unit(text) is not None
    except errors:
        return False


@cache
def unit_registry() -> tuple[Any, tuple[type[Exception], ...]]:
    """Return pint's units and the errors by which it refuses a text; it takes a second, so only a reader makes it."""
    import pint

    return pint.UnitRegistry(), (pint.PintError, AssertionError, AttributeError, ValueError, SyntaxError, TypeError)

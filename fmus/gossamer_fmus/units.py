"""Unit symbols in SI base units, as FMI wants them."""

from __future__ import annotations

import re

from gossamer_models import ParameterError

# Symbols of SI base dimensions in pint, and attributes of <BaseUnit>.
_BASE = {
    "kilogram": "kg",
    "meter": "m",
    "second": "s",
    "ampere": "A",
    "kelvin": "K",
    "mole": "mol",
    "candela": "cd",
    "radian": "rad",
}


def base_unit(name: str) -> dict[str, str]:
    """Return the attributes of ``<BaseUnit>`` for a unit symbol: exponents of the SI base units and a factor.

    Raises
    ------
    ParameterError
        The unit is unknown, has an offset as degC has, or is no product of whole powers of base units.
    """
    import pint

    powers = re.sub(r"(?<=[A-Za-z])(?=-?\d)", "**", name)  # kg/m3 is kg/m**3
    registry = pint.application_registry
    try:
        quantity, twice = (registry.Quantity(value, powers).to_base_units() for value in (1.0, 2.0))
        items = {_BASE[str(unit)]: exponent for unit, exponent in quantity.unit_items()}
    except (pint.PintError, KeyError) as error:
        msg = f"unit {name!r} cannot be written in base units: {error}. Use another."
        raise ParameterError(msg) from error
    if twice.magnitude != 2.0 * quantity.magnitude or any(exponent != int(exponent) for exponent in items.values()):
        msg = f"unit {name!r} is no product of whole powers of SI base units. Use one that is."
        raise ParameterError(msg)
    attributes = {unit: str(int(exponent)) for unit, exponent in items.items()}
    if quantity.magnitude != 1.0:
        attributes["factor"] = repr(float(quantity.magnitude))
    return attributes

"""Unit symbols in SI base units, as FMI requires them."""

from __future__ import annotations

import re

from gossamer_models import ParameterError

_BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")  # attributes of <BaseUnit>


def base_unit(name: str) -> dict[str, str]:
    """Return the attributes of ``<BaseUnit>`` for a unit symbol: exponents of the SI base units and a factor.

    Raises
    ------
    ParameterError
        The unit is unknown, has an offset as degC has, or is not a product of integer powers of base units.
    """
    import pint

    expression = re.sub(r"(?<=[A-Za-z])(?=-?\d)", "**", name)  # kg/m3 is kg/m**3
    registry = pint.application_registry
    try:
        quantity, twice = (registry.Quantity(value, expression).to_base_units() for value in (1.0, 2.0))
    except pint.PintError as error:
        msg = f"unit {name!r} cannot be written in base units: {error}. Use another unit."
        raise ParameterError(msg) from error
    powers = {registry.get_symbol(unit): exponent for unit, exponent in quantity.unit_items()}
    whole = all(unit in _BASE and power == int(power) for unit, power in powers.items())
    if twice.magnitude != 2.0 * quantity.magnitude or not whole:
        msg = f"unit {name!r} is not a product of integer powers of SI base units. Use one that is."
        raise ParameterError(msg)
    attributes = {unit: str(int(power)) for unit, power in powers.items()}
    if quantity.magnitude != 1.0:
        attributes["factor"] = repr(float(quantity.magnitude))
    return attributes

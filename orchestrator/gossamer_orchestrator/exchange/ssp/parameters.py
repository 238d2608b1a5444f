"""Parameter bindings of an SSP: sets of values, inside the system structure or in a file, renamed by mappings."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from pyssp_standard.ssm import SSM, SSMElem
from pyssp_standard.ssv import SSV

from ...fmi.units import conversion
from ...scenario.schema import Value
from .files import SspFiles

logger = logging.getLogger(__name__)

_SET = "application/x-ssp-parameter-set"
_MAPPING = "application/x-ssp-parameter-mapping"


@dataclass(frozen=True)
class Given:
    """A value, the definition of its unit or None, and gain and bias of a Real whose unit is converted."""

    value: Value
    unit: Any = None
    gain: float = 1.0
    bias: float = 0.0

    def converted(self, unit: Any) -> float:  # noqa: ANN401
        """Return a Real for a receiver with a unit."""
        factor, offset = conversion(self.unit, unit) or (1.0, 0.0)
        return self.gain * (factor * float(self.value) + offset) + self.bias


def read_bindings(files: SspFiles, bindings: Iterable[Any] | None, owner: str) -> dict[str, Given]:
    """Return the values that the bindings of a component or system give, by name; later ones replace earlier ones."""
    found: dict[str, Given] = {}
    for binding in bindings or ():
        label = f"a parameter binding of {owner}"
        _check(files, binding, _SET, label)
        values = binding.ssv
        if binding.source:
            values = files.read(SSV, files.find(binding.source, f"the source of {label}")).ssv_elem
        if values is None:
            files.refuse(f"{label} has neither a source nor values", "Remove it")
        given = _parameters(files, values, binding.prefix or "", label)
        if binding.parameter_mapping is not None:
            given = _renamed(files, given, binding.parameter_mapping, label)
        found |= given
    return found


def definitions(files: SspFiles, units: Iterable[Any] | None) -> dict[str, Any]:
    """Return the definitions of units by name, with FMPy's defaults; refuse one that converts nothing."""
    found = {unit.name: unit.base_unit for unit in units or () if unit.base_unit is not None}
    for name, unit in found.items():
        unit.factor, unit.offset = 1.0 if unit.factor is None else unit.factor, unit.offset or 0.0
        if unit.factor == 0.0 or not math.isfinite(unit.factor) or not math.isfinite(unit.offset):
            files.refuse(f"unit {name!r} has the factor {unit.factor:g}, offset {unit.offset:g}", "Correct the unit")
    return found


def convert(kind: str, text: str) -> Value:
    """Read a value of one of FMI's types as XML writes it; ``ValueError`` or ``KeyError`` if it is none."""
    if kind == "Boolean":
        return {"true": True, "1": True, "false": False, "0": False}[text.strip()]
    types: dict[str, type[Value]] = {"Real": float, "Integer": int, "String": str, "Enumeration": str}
    return types[kind](text)


def _check(files: SspFiles, item: Any, kind: str, label: str) -> None:  # noqa: ANN401
    if item.type != kind:
        files.refuse(f"{label} has the type {item.type!r}", f"Give it as {kind!r}")
    if item.source_base != "SSD":
        files.refuse(f"{label} has its source inside the component", "Put that file into the archive")


def _parameters(files: SspFiles, values: Any, prefix: str, label: str) -> dict[str, Given]:  # noqa: ANN401
    units = definitions(files, values.units)
    found = {}
    for parameter in values.parameters:
        name, kind = prefix + parameter["name"], parameter["type_name"]
        content = parameter["type_value"].parameter or {}
        text = content.get("value")
        try:
            found[name] = Given(convert(kind, text or ""), units.get(content.get("unit") or ""))
        except (ValueError, KeyError):
            files.refuse(
                f"{label}: {name!r} is {text!r}, which is no {kind}", "Give a Real, Integer, Boolean or String"
            )
    return found


def _renamed(files: SspFiles, found: dict[str, Given], mapping: Any, label: str) -> dict[str, Given]:  # noqa: ANN401
    """Rename and transform values; what a mapping does not name keeps its name, as OMSimulator does it."""
    _check(files, mapping, _MAPPING, f"the mapping of {label}")
    if mapping.source:
        entries = files.read(SSM, files.find(mapping.source, f"the mapping of {label}")).ssm_elem.entries
    elif mapping.ssm is not None:
        entries = SSMElem.from_xml(mapping.ssm).entries
    else:
        files.refuse(f"the mapping of {label} is empty", "Remove it")
    renamed = {name: given for name, given in found.items() if name not in {entry.source for entry in entries}}
    for entry in entries:
        given = found.get(entry.source)
        if given is None:
            text = "%s: the mapping of %s gives %r to %r, but no such value is given; it is ignored"
            logger.warning(text, files.name, label, entry.source, entry.target)
            continue
        gain, bias = 1.0, 0.0
        if entry.transformation is not None:
            kind, numbers = entry.transformation.transformation_type, entry.transformation.transformation
            if kind != "LinearTransformation" or not isinstance(given.value, float):
                files.refuse(f"the mapping to {entry.target!r} has a {kind}", "Use a linear transformation of a Real")
            gain, bias = float(numbers.get("factor") or 1.0), float(numbers.get("offset") or 0.0)
        unit = None if entry.suppress_unit_conversion in (True, "true", "1") else given.unit
        renamed[entry.target] = Given(given.value, unit, gain, bias)
    return renamed

"""The files of an unpacked SSP, none of which is trusted, and the values in them.

Parameter bindings are sets of values, inside the system structure or in a file, renamed by mappings.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote

import xmlschema
from lxml import etree
from pyssp_standard.ssd import SSD
from pyssp_standard.ssm import SSM, SSMElem
from pyssp_standard.ssv import SSV
from pyssp_standard.standard import ModelicaStandard

from ..errors import ScenarioError
from ..fmi.archive import Kind
from ..fmi.types import conversion
from ..scenario.schema import Value

STRUCTURE = "SystemStructure.ssd"
SSP = Kind("SSP", STRUCTURE, ScenarioError)
ANNOTATION = "gossamer.scenario"  # type of the annotation that holds what SSP has no place for:
KEPT = {"master", "order", "groups", "record"}
_ROOTS = {SSD: "SystemStructureDescription", SSV: "ParameterSet", SSM: "ParameterMapping"}
_SCHEMAS = {  # by root element, of SSP 1.0 and 2.0
    "SystemStructureDescription": ("ssd11", "ssd2_11"),
    "ParameterSet": ("ssv", "ssv2"),
    "ParameterMapping": ("ssm", "ssm2"),
}


@dataclass(frozen=True)
class SspFiles:
    """Read the files of an SSP.

    Attributes
    ----------
    name : str
        Name of the archive, for messages.
    folder : Path
        Where it is unpacked.
    read_so_far : list of Path
        XML files that ``read`` has been asked for.
    """

    name: str
    folder: Path
    read_so_far: list[Path] = field(default_factory=list, repr=False)

    def refuse(self, what: str, advice: str) -> NoReturn:
        """Raise ``ScenarioError``."""
        msg = f"{self.name}: {what}. {advice}."
        raise ScenarioError(msg)

    def find(self, source: str, what: str) -> Path:
        """Return the file that a ``source`` attribute names; it must be in the archive."""
        path = (self.folder / unquote(source)).resolve()
        if not path.is_relative_to(self.folder.resolve()) or not path.is_file():
            self.refuse(f"{what} is {source!r}, which is not in the archive", "Put that file into it")
        return path

    def parse(self, path: Path) -> Any:  # noqa: ANN401
        """Return an XML file as lxml's tree. Nothing is expanded and no other file is read."""
        parser = etree.XMLParser(
            resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True, remove_pis=True
        )
        try:
            tree = etree.parse(path, parser)
        except (OSError, etree.XMLSyntaxError) as error:
            self.refuse(f"{path.name} is not XML: {error}", "Write the archive again")
        if tree.docinfo.internalDTD is not None:
            self.refuse(
                f"{path.name} has a document type definition, which can make a small file huge or read other files",
                "SSP needs none. The archive is not read; do not trust it",
            )
        return tree

    def read(self, kind: Any, path: Path) -> Any:  # noqa: ANN401
        """Read an XML file with one of pyssp-standard's classes.

        It is parsed here first and written back without what could do harm and what pyssp-standard 0.9 cannot read:
        comments, and a default experiment, which need not state both times.
        """
        tree = self.parse(path)
        wanted, found = _ROOTS[kind], etree.QName(tree.getroot()).localname
        if found != wanted:
            self.refuse(f"{path.name} is a {found!r}, not a {wanted!r}", "Correct it by SSP's schema")
        for experiment in tree.getroot().findall("{*}DefaultExperiment"):
            tree.getroot().remove(experiment)
        tree.write(path, encoding="utf-8", xml_declaration=True)
        if path not in self.read_so_far:
            self.read_so_far.append(path)
        try:
            return kind(path, mode="r")
        except Exception as error:
            # pyssp-standard trusts its files
            self.refuse_unread(error)

    def refuse_unread(self, error: Exception) -> NoReturn:
        """Refuse what pyssp-standard or the reader of the archive tripped over, by the file that departs from its schema."""
        # values and mappings are read between the parts of the structure
        for path in sorted(self.read_so_far, key=lambda path: path.name == STRUCTURE):
            reason = _schema_reason(path)
            if reason is not None:
                self.refuse(f"{path.name} cannot be understood: {reason}", "Correct it by SSP's schema")
        name = self.read_so_far[-1].name
        self.refuse(f"{name} cannot be understood, {error}", "Report it, for it follows SSP's schema")


def _schema_reason(path: Path) -> str | None:
    """Say where a file of an SSP first departs from SSP's schema; None if it does not."""
    root = etree.parse(path).getroot()
    name = etree.QName(root).localname
    kind = _SCHEMAS[name][root.get("version", "1.0").startswith("2")]
    schema = (xmlschema.XMLSchema11 if "11" in kind else xmlschema.XMLSchema10)(ModelicaStandard.schemas[kind])
    try:
        xmlschema.validate(path, schema, namespaces=ModelicaStandard.namespaces)
    except xmlschema.XMLSchemaException as error:
        return f"{getattr(error, 'reason', None) or error} (at {getattr(error, 'path', None) or name})"
    return None


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
            files.refuse(f"{label}: {name!r} is {text!r}, which is no {kind}", "Give a Real, Integer, Boolean or String")
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

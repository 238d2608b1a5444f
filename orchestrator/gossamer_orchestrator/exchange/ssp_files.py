"""The files of an unpacked SSP, none of which is trusted, and the values in them.

Parameter bindings are sets of values, inside the system structure or in a file, renamed by mappings. They are read as XML:
pyssp-standard 0.9, which writes an SSP and knows its schemas, reads no transformations.
"""

from __future__ import annotations

import logging
import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote

import xmlschema
from fmpy.model_description import BaseUnit
from lxml import etree
from pyssp_standard.standard import ModelicaStandard

from ..errors import ScenarioError
from ..fmi.archive import Kind
from ..fmi.types import conversion
from ..scenario.schema import Value

STRUCTURE = "SystemStructure.ssd"
SSP = Kind("SSP", STRUCTURE, ScenarioError)
ANNOTATION = "gossamer.scenario"  # type of the annotation that holds what SSP has no place for:
KEPT = {"master", "order", "groups", "record"}
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
        XML files that ``root`` has been asked for.
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

    def root(self, path: Path, wanted: str) -> Any:  # noqa: ANN401
        """Return the root of an XML file, which has a name. Nothing is expanded and no other file is read."""
        if path not in self.read_so_far:
            self.read_so_far.append(path)
        parser = etree.XMLParser(
            resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True, remove_pis=True
        )
        try:
            try:
                tree = etree.parse(path, parser)
            except etree.XMLSyntaxError:
                self._declare_prefixes(path)
                tree = etree.parse(path, parser)
        except (OSError, etree.XMLSyntaxError) as error:
            self.refuse(f"{path.name} is not XML: {error}", "Write the archive again")
        if tree.docinfo.internalDTD is not None:
            self.refuse(
                f"{path.name} has a document type definition, which can make a small file huge or read other files",
                "SSP needs none. The archive is not read; do not trust it",
            )
        if (found := etree.QName(tree.getroot()).localname) != wanted:
            self.refuse(f"{path.name} is a {found!r}, not a {wanted!r}", "Correct it by SSP's schema")
        return tree.getroot()

    def _declare_prefixes(self, path: Path) -> None:
        """Declare the prefixes that an unpacked XML file uses and does not declare, as in widely copied examples."""
        parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, recover=True)
        root = etree.parse(path, parser).getroot()
        found = [re.match(r"Namespace prefix (\S+) .* not defined", entry.message) for entry in parser.error_log]
        prefixes = list(dict.fromkeys(each[1] for each in found if each))
        if root is not None and prefixes:
            known = {**ModelicaStandard.namespaces, "xsi": "http://www.w3.org/2001/XMLSchema-instance"}
            more = "".join(f' xmlns:{each}="{known.get(each, f"urn:{each}")}"' for each in prefixes)
            begin = "<" + ":".join(filter(None, [root.prefix, root.tag.rpartition("}")[2]]))
            path.write_bytes(path.read_bytes().replace(begin.encode(), (begin + more).encode(), 1))
            text = "%s: %s does not declare the prefixes %s; they are taken as those of SSP"
            logger.warning(text, self.name, path.name, ", ".join(prefixes))

    def refuse_unread(self, error: Exception) -> NoReturn:
        """Refuse what the reader of the archive tripped over, by the file that departs from its schema."""
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
class BoundValue:
    """A value, the definition of its unit or None, and gain and bias of a Real whose unit is converted."""

    value: Value
    unit: Any = None
    gain: float = 1.0
    bias: float = 0.0

    def converted(self, unit: Any) -> float:  # noqa: ANN401
        """Return a Real for a receiver with a unit."""
        factor, offset = conversion(self.unit, unit) or (1.0, 0.0)
        return self.gain * (factor * float(self.value) + offset) + self.bias


def read_bindings(files: SspFiles, element: Any, owner: str) -> dict[str, BoundValue]:  # noqa: ANN401
    """Return the values that the bindings of a component or system give, by name; later ones replace earlier ones."""
    found: dict[str, BoundValue] = {}
    for binding in element.iterfind("{*}ParameterBindings/{*}ParameterBinding"):
        label = f"a parameter binding of {owner}"
        values = _content(files, binding, _SET, "{*}ParameterValues/{*}", "ParameterSet", label)
        if values is None:
            files.refuse(f"{label} has neither a source nor values", "Remove it")
        given = _parameters(files, values, binding.get("prefix", ""), label)
        for mapping in binding.iterfind("{*}ParameterMapping"):
            given = _renamed(files, given, mapping, label)
        found |= given
    return found


def definitions(files: SspFiles, element: Any) -> dict[str, Any]:  # noqa: ANN401
    """Return the definitions of the units that an element lists, by name; refuse one that converts nothing."""
    found = {}
    for base in element.iterfind("{*}Units/{*}Unit/{*}BaseUnit"):
        name = base.getparent().attrib["name"]
        numbers = {key: (float if key in ("factor", "offset") else int)(text) for key, text in base.items()}
        found[name] = unit = BaseUnit(**numbers)
        if unit.factor == 0.0 or not math.isfinite(unit.factor) or not math.isfinite(unit.offset):
            files.refuse(f"unit {name!r} has the factor {unit.factor:g}, offset {unit.offset:g}", "Correct the unit")
    return found


def transformation(element: Any) -> tuple[str, float, float, bool]:  # noqa: ANN401
    """Return a connection's or mapping's kind of transformation, "" for none, gain, bias, and whether it converts units."""
    converts = element.get("suppressUnitConversion") not in ("true", "1")
    for child in element:
        kind = etree.QName(child).localname
        if kind.endswith("Transformation"):
            return kind, float(child.get("factor", 1.0)), float(child.get("offset", 0.0)), converts
    return "", 1.0, 0.0, converts


def convert(kind: str, text: str) -> Value:
    """Read a value of one of FMI's types as XML writes it; ``ValueError`` or ``KeyError`` if it is none."""
    if kind == "Boolean":
        return {"true": True, "1": True, "false": False, "0": False}[text.strip()]
    types: dict[str, type[Value]] = {"Real": float, "Integer": int, "String": str, "Enumeration": str}
    return types[kind](text)


def _content(files: SspFiles, element: Any, kind: str, inside: str, wanted: str, label: str) -> Any:  # noqa: ANN401
    """Return the set or mapping that an element holds or that its source is; None without either."""
    if (found := element.get("type", kind)) != kind:
        files.refuse(f"{label} has the type {found!r}", f"Give it as {kind!r}")
    if element.get("sourceBase", "SSD") != "SSD":
        files.refuse(f"{label} has its source inside the component", "Put that file into the archive")
    if source := element.get("source"):
        return files.root(files.find(source, f"the source of {label}"), wanted)
    return element.find(inside + wanted)


def _parameters(files: SspFiles, values: Any, prefix: str, label: str) -> dict[str, BoundValue]:  # noqa: ANN401
    units = definitions(files, values)
    found = {}
    for parameter in values.iterfind("{*}Parameters/{*}Parameter"):
        content = parameter[0]
        name, kind, text = prefix + parameter.attrib["name"], etree.QName(content).localname, content.get("value")
        try:
            found[name] = BoundValue(convert(kind, text or ""), units.get(content.get("unit", "")))
        except (ValueError, KeyError):
            files.refuse(f"{label}: {name!r} is {text!r}, which is no {kind}", "Give a Real, Integer, Boolean or String")
    return found


def _renamed(files: SspFiles, found: dict[str, BoundValue], mapping: Any, label: str) -> dict[str, BoundValue]:  # noqa: ANN401
    """Rename and transform values; what a mapping does not name keeps its name, as OMSimulator does it."""
    entries = _content(files, mapping, _MAPPING, "{*}", "ParameterMapping", f"the mapping of {label}")
    if entries is None:
        files.refuse(f"the mapping of {label} is empty", "Remove it")
    pairs = [(entry, entry.attrib["source"], entry.attrib["target"]) for entry in entries.iterfind("{*}MappingEntry")]
    renamed = {name: given for name, given in found.items() if name not in {source for _, source, _ in pairs}}
    for entry, source, target in pairs:
        if (given := found.get(source)) is None:
            text = "%s: the mapping of %s gives %r to %r, but no such value is given; it is ignored"
            logger.warning(text, files.name, label, source, target)
            continue
        kind, gain, bias, converts = transformation(entry)
        if kind and (kind != "LinearTransformation" or not isinstance(given.value, float)):
            files.refuse(f"the mapping to {target!r} has a {kind}", "Use a linear transformation of a Real")
        renamed[target] = BoundValue(given.value, given.unit if converts else None, gain, bias)
    return renamed

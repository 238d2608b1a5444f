"""The files of an unpacked SSP. None of them is trusted."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote

import xmlschema
from lxml import etree
from pyssp_standard.ssd import SSD
from pyssp_standard.ssm import SSM
from pyssp_standard.ssv import SSV
from pyssp_standard.standard import ModelicaStandard

from ...errors import ScenarioError
from ...fmi.archive import Kind

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

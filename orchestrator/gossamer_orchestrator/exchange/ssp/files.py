"""The files of an unpacked SSP. None of them is trusted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote

from lxml import etree
from pyssp_standard.ssd import SSD

from ...errors import ScenarioError
from ...fmi.archive import Kind

STRUCTURE = "SystemStructure.ssd"
SSP = Kind("SSP", STRUCTURE, ScenarioError)
ANNOTATION = "gossamer.scenario"  # type of the annotation that holds what SSP has no place for:
KEPT = {"master", "order", "record"}


@dataclass(frozen=True)
class SspFiles:
    """Read the files of an SSP.

    Attributes
    ----------
    name : str
        Name of the archive, for messages.
    folder : Path
        Where it is unpacked.
    """

    name: str
    folder: Path

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
        for experiment in tree.getroot().findall("{*}DefaultExperiment"):
            tree.getroot().remove(experiment)
        tree.write(path, encoding="utf-8", xml_declaration=True)
        try:
            return kind(path, mode="r")
        except Exception as error:
            # pyssp-standard trusts its files
            self.refuse(f"{path.name} cannot be read: {type(error).__name__}: {error}", "Correct it by SSP's schema")

    def schema_reason(self, path: Path) -> str | None:
        """Say where a system structure first departs from SSP's schema; None if it does not."""
        try:
            SSD(path, mode="r").__check_compliance__()
        except Exception as error:
            # xmlschema's errors have a reason and a place, pyssp-standard's neither
            return f"{getattr(error, 'reason', None) or error} (at {getattr(error, 'path', None) or path.name})"
        return None

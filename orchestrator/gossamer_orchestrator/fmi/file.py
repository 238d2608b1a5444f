"""An FMU file: its model description, and its folder once it is unpacked."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import fmpy

from ..errors import FmuError
from .archive import check_archive, unpack


class FmuFile:
    """One FMI 2.0 co-simulation FMU on disk, shared by all its instances.

    Parameters
    ----------
    path : Path
        The ``.fmu`` file.

    Attributes
    ----------
    description : fmpy.model_description.ModelDescription
        As read by FMPy.
    variables : dict
        FMPy's ``ModelVariable`` by name.
    corrupt : bool
        An instance returned fmi2Fatal: by FMI 2.0 no function of any instance may be called any more.

    Raises
    ------
    FmuError
        No archive, a dangerous one, no valid model description, or no FMI 2.0 for co-simulation.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        check_archive(self.path)
        try:
            description = fmpy.read_model_description(str(self.path))
        except Exception as error:
            # FMPy raises bare exceptions, lxml its own
            advice = f"Check it with 'gossamer verify {self.path.name}'."
            msg = f"{self.path}: its modelDescription.xml is not valid: {error}. {advice}"
            raise FmuError(msg) from error
        if description.fmiVersion != "2.0" or description.coSimulation is None:
            kind = "co-simulation" if description.coSimulation else "model exchange"
            three = description.fmiVersion.startswith("3")
            msg = (
                f"{self.path} is FMI {description.fmiVersion} for {kind}; this program runs FMI 2.0 for co-simulation. "
                f"{'Build it without --fmi 3.' if three else 'Export it as FMI 2.0 for co-simulation.'}"
            )
            raise FmuError(msg)
        self.description: Any = description
        self.variables: dict[str, Any] = {v.name: v for v in description.modelVariables}
        self.corrupt = False
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    @property
    def name(self) -> str:
        """File name without its ending."""
        return self.path.stem

    @property
    def can_repeat(self) -> bool:
        """True if instances can restore their state and repeat a step in parts."""
        can = self.description.coSimulation
        return bool(can.canGetAndSetFMUstate and can.canHandleVariableCommunicationStepSize)

    def names(self, *causalities: str, kind: str | None = None) -> list[str]:
        """List variables of some causalities, and of one type if given, in the order of the model description."""
        return [v.name for v in self.variables.values() if v.causality in causalities and kind in (None, v.type)]

    def unit(self, name: str) -> str | None:
        """Return a variable's unit, its own or that of its declared type."""
        variable = self.variables[name]
        declared = variable.declaredType.unit if variable.declaredType is not None else None
        return variable.unit or declared

    def unit_definition(self, name: str) -> Any:  # noqa: ANN401
        """Return FMPy's ``BaseUnit`` of a variable's unit, or None."""
        unit = self.unit(name)
        return next((each.baseUnit for each in self.description.unitDefinitions if each.name == unit), None)

    def feedthrough(self) -> dict[str, list[str]]:
        """List, for each output, the inputs it depends on at the same instant; undeclared means all of them."""
        inputs = self.names("input")
        declared = {
            unknown.variable.name: unknown.dependencies
            for unknown in self.description.outputs
            if unknown.variable is not None
        }
        through = {}
        for output in self.names("output"):
            on = declared.get(output)
            through[output] = inputs if on is None else [v.name for v in on if v.causality == "input"]
        return through

    def folder(self) -> Path:
        """Unpack it into a temporary folder, once."""
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="gossamer-", ignore_cleanup_errors=True)
            unpack(self.path, Path(self._folder.name))
        return Path(self._folder.name)

    def close(self) -> None:
        """Remove the temporary folder."""
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None


def library_path(folder: Path, description: Any) -> Path:  # noqa: ANN401
    """Return where an unpacked FMU, FMI 2.0 or 3.0 for co-simulation, has its binary for this machine."""
    platform = fmpy.platform if description.fmiVersion.startswith("2") else fmpy.platform_tuple
    name = f"{description.coSimulation.modelIdentifier}{fmpy.sharedLibraryExtension}"
    return folder / "binaries" / str(platform) / name


def platforms(folder: Path) -> list[str]:
    """List the platforms for which an unpacked FMU has a binary."""
    return sorted(p.name for p in (folder / "binaries").glob("*") if p.is_dir())


def explain_platforms(folder: Path, library: Path) -> str:
    """Explain which binary an unpacked FMU lacks, and which it has."""
    there = platforms(folder)
    has = f"binaries for {', '.join(there)}" if there else "no binaries"
    return f"It has no {library.relative_to(folder).as_posix()}, which this machine needs; it has {has}."

"""Sizes of the arrays of FMI 3.0, which a component gives by structural parameters."""

from __future__ import annotations

from ..fmi.file import FmuFile
from .schema import Component


def resized(file: FmuFile, component: Component, *, validate: bool = True) -> FmuFile:
    """Return the FMU with arrays of the sizes that a component gives; raise ``FmuError`` if they are absurd."""
    sizes = {v: component.parameters.get(v) for v in file.names("structuralParameter")}
    given = {v: size for v, size in sizes.items() if type(size) is int and size >= 0}
    return FmuFile(file.path, given, validate=validate) if given else file

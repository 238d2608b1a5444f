"""What a check is, and how one is registered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..fmi.slave import Log
from .findings import FAILED, NOT_APPLICABLE
from .subject import Subject

Outcome = tuple[str, str]  # verdict and sentence


class Context:
    """What a check may inspect."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.path = path
        self.folder = folder
        self.log = Log()

    @cached_property
    def subject(self) -> Subject:
        """The FMU; raises what FMPy raises if its model description cannot be read."""
        return Subject(self.folder, self.log)


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """A check of the FMU (``Subject``) or of its files (``Context``).

    Attributes
    ----------
    needs : tuple of str
        Capabilities without which it is not applicable.
    gate : bool
        If it fails, no check after it means anything.
    """

    function: Callable[[Any], Outcome]
    files: bool
    needs: tuple[str, ...]
    gate: bool

    def __call__(self, context: Context) -> Outcome:
        """Check."""
        missing = [name for name in self.needs if not getattr(context.subject.can, name)]
        if missing:
            return NOT_APPLICABLE, f"It does not declare {', '.join(missing)}."
        try:
            return self.function(context if self.files else context.subject)
        except Exception as error:  # FMPy, lxml and xmlschema raise exceptions of any class
            return FAILED, f"{' '.join(str(error).split()) or type(error).__name__}.{context.log.tail()}"


class Checks(dict[str, Check]):
    """Checks by name, in the order of the report; an instance is the decorator that adds one."""

    def __call__(
        self, name: str, *, files: bool = False, needs: tuple[str, ...] = (), gate: bool = False
    ) -> Callable[[Callable[[Any], Outcome]], Callable[[Any], Outcome]]:
        """Add a check."""

        def add(function: Callable[[Any], Outcome]) -> Callable[[Any], Outcome]:
            self[name] = Check(function=function, files=files, needs=needs, gate=gate)
            return function

        return add


def listed(items: list[str], most: int = 4) -> str:
    """Join words, the first few of them."""
    return ", ".join(items[:most]) + (f" and {len(items) - most} more" if len(items) > most else "")

"""What a check is, how one is registered, and what it finds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..fmi.slave import Log
from .subject import Subject

PASSED, FAILED, REMARK, NOT_APPLICABLE = "passed", "failed", "remark", "not applicable"
Outcome = tuple[str, str]  # verdict and sentence
Function = Callable[[Any], Outcome]


@dataclass(frozen=True, slots=True)
class Finding:
    """Outcome of one check.

    Attributes
    ----------
    check : str
        Its name.
    verdict : str
        "passed", "failed", "remark" (allowed, but worth knowing) or "not applicable".
    why : str
        A sentence.
    """

    check: str
    verdict: str
    why: str


@dataclass(frozen=True, slots=True)
class Check:
    """A check of an FMU.

    Attributes
    ----------
    function : callable
        Takes the ``Subject``. An exception means that the check has failed.
    needs : tuple of str
        Capabilities without which it is not applicable.
    gate : bool
        If it fails, no check after it means anything.
    runs : bool
        It steps the FMU, so that must be for co-simulation.
    """

    function: Function
    needs: tuple[str, ...]
    gate: bool
    runs: bool

    def __call__(self, subject: Callable[[], Subject], log: Log) -> Outcome:
        """Check what ``subject`` returns; it raises what FMPy raises if the model description cannot be read."""
        try:
            if self.runs and subject().exchange:
                return NOT_APPLICABLE, "It is for model exchange."
            missing = [name for name in self.needs if not getattr(subject().can, name)]
            if missing:
                return NOT_APPLICABLE, f"It does not declare {', '.join(missing)}."
            return self.function(subject())
        except Exception as error:  # FMPy, lxml and xmlschema raise exceptions of any class
            return FAILED, f"{sentence(str(error) or type(error).__name__)}{log.tail()}"


CHECKS: dict[str, Check] = {}  # by name, in the order of the report


def check(
    name: str, *, needs: tuple[str, ...] = (), gate: bool = False, runs: bool = False
) -> Callable[[Function], Function]:
    """Register a check, as a decorator of its function."""

    def add(function: Function) -> Function:
        CHECKS[name] = Check(function, needs, gate, runs)
        return function

    return add


def sentence(text: str) -> str:
    """Return a text on one line with one full stop at its end."""
    return " ".join(text.split()).rstrip(".") + "."


def none_of(wrong: list[str], complaint: str, good: str, *, verdict: str = FAILED) -> Outcome:
    """Pass if nothing is wrong; otherwise give the verdict, with the first few items after the complaint."""
    if not wrong:
        return PASSED, good
    more = f" and {len(wrong) - 4} more" if len(wrong) > 4 else ""
    return verdict, sentence(f"{complaint}: {', '.join(wrong[:4])}{more}")

"""What a check is, how one is registered, what it finds, and the checks of the files in the archive.

To add a check, write its function, decorated with ``check``, here, or in ``behaviour_checks`` if it needs a running FMU.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..fmi.file import explain_platforms, platforms
from ..fmi.slave import Log, collect_errors, slave_class
from ..words import first_few
from .subject import REALS, Subject

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
        Unless it passes, no check after it means anything.
    misuse : bool
        In it the host breaks the rules of FMI, so whatever the FMU does, even a crash, is a remark.
    runs : bool
        It steps the FMU, so that must be for co-simulation.
    """

    function: Function
    needs: tuple[str, ...]
    gate: bool
    misuse: bool
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
            return self.bad, f"{sentence(str(error) or type(error).__name__)}{log.tail()}"

    @property
    def bad(self) -> str:
        """Verdict where it cannot be made to its end."""
        return REMARK if self.misuse else FAILED


CHECKS: dict[str, Check] = {}  # by name, in the order of the report


def check(
    name: str, *, needs: tuple[str, ...] = (), gate: bool = False, misuse: bool = False, runs: bool = False
) -> Callable[[Function], Function]:
    """Register a check, as a decorator of its function."""

    def add(function: Function) -> Function:
        CHECKS[name] = Check(function, needs, gate, misuse, runs)
        return function

    return add


def sentence(text: str) -> str:
    """Return a text on one line with one full stop at its end."""
    return " ".join(text.split()).rstrip(".") + "."


def none_of(wrong: list[str], complaint: str, good: str, *, verdict: str = FAILED) -> Outcome:
    """Pass if nothing is wrong; otherwise give the verdict, with the first few items after the complaint."""
    if not wrong:
        return PASSED, good
    return verdict, sentence(f"{complaint}: {first_few(wrong)}")


@check("model description", gate=True)
def _description(subject: Subject) -> Outcome:
    version = subject.description.fmiVersion
    if subject.version not in (2, 3) or subject.can is None:
        kind = "" if subject.can else " for scheduled execution"
        what = "only FMI 2.0 and 3.0 for co-simulation and model exchange are checked"
        return NOT_APPLICABLE, f"It is FMI {version}{kind}; {what}."
    tool = subject.description.generationTool or "an unnamed tool"
    kind = "model exchange" if subject.exchange else "co-simulation"
    return PASSED, f"FMI {version} for {kind}, {len(subject.variables)} variables, made by {tool}."


@check("rules, by FMPy")
def _rules(subject: Subject) -> Outcome:
    from fmpy.validation import validate_fmu

    problems = [" ".join(str(problem).split()) for problem in validate_fmu(str(subject.path))]
    return none_of(problems, "FMPy reports", "FMPy finds no problem.")


@check("rules, by fmutool")
def _fmutool(subject: Subject) -> Outcome:
    from fmu_manipulation_toolbox.checker import OperationGenericCheck, OperationSemanticCheck
    from fmu_manipulation_toolbox.operations import FMU

    with collect_errors() as problems, FMU(str(subject.path)) as fmu:
        for operation in (OperationGenericCheck(), OperationSemanticCheck()):
            fmu.apply_operation(operation)
    return none_of(problems, "fmutool reports", "fmutool finds no problem.")


@check("units")
def _units(subject: Subject) -> Outcome:
    reals = [v for v in subject.variables if v.type in REALS and v.causality in ("input", "output", "parameter")]
    bare = [v.name for v in reals if not (v.unit or (v.declaredType is not None and v.declaredType.unit))]
    if not reals:
        return NOT_APPLICABLE, "It has no Real inputs, outputs or parameters."
    what = f"of {len(reals)} Real inputs, outputs and parameters have"
    return none_of(bare, f"{len(bare)} {what} no unit", f"{len(reals)} {what} one.", verdict=REMARK)


@check("platform", gate=True)
def _platform(subject: Subject) -> Outcome:
    if not subject.library.is_file():
        return FAILED, explain_platforms(subject.folder, subject.library)
    there = ", ".join(platforms(subject.folder))
    return PASSED, f"Binaries for {there}; this machine is {subject.library.parent.name}."


@check("exported functions", gate=True)
def _functions(subject: Subject) -> Outcome:
    prefix = f"fmi{subject.version}"
    wanted = [name for name in dir(slave_class(subject.description)) if name.startswith(prefix)]
    try:
        library = subject.calls.make(ctypes.CDLL, str(subject.library))
    except OSError as error:
        return FAILED, sentence(f"Its binary cannot be loaded: {error}")
    missing = [name for name in wanted if not hasattr(library, name)]
    return none_of(missing, "Its binary lacks", f"All {len(wanted)} {prefix} functions are there.")

"""Checks of the files in the archive."""

from __future__ import annotations

import ctypes

from ..fmi.file import explain_platforms, platforms
from ..fmi.slave import collect_errors
from .registry import FAILED, NOT_APPLICABLE, PASSED, REMARK, Outcome, check, none_of, sentence
from .subject import REALS, Subject


@check("model description", gate=True)
def _description(subject: Subject) -> Outcome:
    version = subject.description.fmiVersion
    if subject.version not in (2, 3) or subject.can is None:
        kind = "" if subject.can else " for scheduled execution"
        return (
            FAILED,
            f"It is FMI {version}{kind}; only FMI 2.0 and 3.0 for co-simulation and model exchange are checked.",
        )
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
    from fmpy import fmi2, fmi3

    prefix = f"fmi{subject.version}"
    kinds = (fmi2.FMU2Model, fmi3.FMU3Model) if subject.exchange else (fmi2.FMU2Slave, fmi3.FMU3Slave)
    kind = kinds[subject.version - 2]
    wanted = [name for name in dir(kind) if name.startswith(prefix)]
    try:
        library = subject.calls.make(ctypes.CDLL, str(subject.library))
    except OSError as error:
        return FAILED, sentence(f"Its binary cannot be loaded: {error}")
    missing = [name for name in wanted if not hasattr(library, name)]
    return none_of(missing, "Its binary lacks", f"All {len(wanted)} {prefix} functions are there.")

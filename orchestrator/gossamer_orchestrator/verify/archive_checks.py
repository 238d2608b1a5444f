"""Checks of the files in the archive."""

from __future__ import annotations

import ctypes
import logging

from ..fmi.file import explain_platforms
from .findings import FAILED, NOT_APPLICABLE, PASSED, REMARK
from .registry import Checks, Context, Outcome, listed
from .subject import REALS, Subject

check = Checks()


@check("model description", gate=True, files=True)
def _description(context: Context) -> Outcome:
    subject = context.subject
    version = subject.description.fmiVersion
    if subject.version not in (2, 3) or subject.can is None:
        kind = "" if subject.can else " without co-simulation"
        return FAILED, f"It is FMI {version}{kind}; only FMI 2.0 and 3.0 for co-simulation are checked."
    tool = subject.description.generationTool or "an unnamed tool"
    return PASSED, f"FMI {version} for co-simulation, {len(subject.variables)} variables, made by {tool}."


@check("rules, by FMPy", files=True)
def _rules(context: Context) -> Outcome:
    from fmpy.validation import validate_fmu

    problems = validate_fmu(str(context.path))
    if problems:
        return FAILED, listed([" ".join(str(p).split()) for p in problems], 2)
    return PASSED, "FMPy finds no problem."


@check("rules, by fmutool", files=True)
def _fmutool(context: Context) -> Outcome:
    from fmu_manipulation_toolbox.checker import OperationGenericCheck, OperationSemanticCheck
    from fmu_manipulation_toolbox.operations import FMU

    texts: list[str] = []
    handler = logging.Handler(logging.ERROR)
    handler.emit = lambda record: texts.append(record.getMessage())  # type: ignore[method-assign]
    logging.getLogger("fmu_manipulation_toolbox").addHandler(handler)
    with FMU(str(context.path)) as fmu:
        for operation in (OperationGenericCheck(), OperationSemanticCheck()):
            fmu.apply_operation(operation)
    if texts:
        return FAILED, listed(texts, 2)
    return PASSED, "fmutool finds no problem."


@check("units")
def _units(subject: Subject) -> Outcome:
    reals = [v for v in subject.variables if v.type in REALS and v.causality in ("input", "output", "parameter")]
    bare = [v.name for v in reals if not (v.unit or (v.declaredType is not None and v.declaredType.unit))]
    if bare:
        return REMARK, f"{len(bare)} of {len(reals)} Real inputs, outputs and parameters have no unit: {listed(bare)}."
    if not reals:
        return NOT_APPLICABLE, "It has no Real inputs, outputs or parameters."
    return PASSED, f"All {len(reals)} Real inputs, outputs and parameters have one."


@check("platform", gate=True)
def _platform(subject: Subject) -> Outcome:
    there = sorted(p.name for p in (subject.folder / "binaries").glob("*") if p.is_dir())
    if not subject.library.is_file():
        return FAILED, explain_platforms(subject.folder, subject.library)
    return PASSED, f"Binaries for {', '.join(there)}; this machine is {subject.library.parent.name}."


@check("exported functions", gate=True)
def _functions(subject: Subject) -> Outcome:
    from fmpy import fmi2, fmi3

    prefix = f"fmi{subject.version}"
    kind = fmi2.FMU2Slave if subject.version == 2 else fmi3.FMU3Slave
    wanted = [name for name in dir(kind) if name.startswith(prefix)]
    try:
        library = ctypes.CDLL(str(subject.library))
    except OSError as error:
        return FAILED, f"Its binary cannot be loaded: {error}."
    missing = [name for name in wanted if not hasattr(library, name)]
    if missing:
        return FAILED, f"Its binary lacks {listed(missing)}."
    return PASSED, f"All {len(wanted)} {prefix} functions are there."

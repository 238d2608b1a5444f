"""An FMU whose mathematics runs on an emulated Cortex-M7, one emulator for each instance.

It is a native FMU with ``processor.h`` in place of what CasADi writes: each step sends a sample through a pipe to the
component that ``gossamer flight`` wrote, compiled for the board, and waits for its answer. The FMU holds::

    binaries/<platform>/<name>.<so|dylib>
    resources/<name>.elf                     the program of the board
    resources/processor.txt                  how it is started
"""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import casadi as ca
from gossamer_files import write_archive
from gossamer_models import ParameterError, StepModel, Variable

from .build import identifier
from .c_code import sources, with_guid
from .compiler import choose_platforms, compile_library
from .description import model_description
from .flight import HEALTH
from .flight_budgets import require_tools, run_tool
from .page import documents
from .reference import references

_PROCESSOR = """# Seconds that an answer may take, then the program and its arguments, a line each.
30
qemu-system-arm
-M
mps2-an500
-display
none
-monitor
none
-serial
none
-semihosting-config
enable=on,target=native
-kernel
{{resources}}/{name}.elf
"""
_SOURCES = ("fmi2.c", "stepper.h", "state.h", "instance.h", "resources.h")
_WITHOUT = (
    "canHandleVariableCommunicationStepSize",
    "canGetAndSetFMUstate",
    "canSerializeFMUstate",
    "providesDirectionalDerivative",
)


def write_fmu_in_the_loop(model: StepModel, name: str, folder: Path) -> Path:
    """Write the FMU of a component beside its sources.

    Parameters
    ----------
    model : StepModel
        That of the component.
    name : str
        Of the component.
    folder : Path
        As ``gossamer flight`` writes it.

    Returns
    -------
    Path
        Of the FMU, ``<name>.fmu`` in the folder.

    Raises
    ------
    ParameterError
        FMI 2.0 or the emulator's pipes do not have this platform.
    FlightError
        A tool is missing, or the compiler refuses the code.
    ModuleNotFoundError
        The compiler of FMUs is not installed.
    """
    require_tools("a run with the processor in the loop needs")
    (platform,) = choose_platforms((), 2)
    if platform == "win64":
        msg = "an FMU with the processor in the loop is for Linux and macOS. Build the native FMU instead."
        raise ParameterError(msg)
    described = _with_health(model)
    code = _sources(described, name, folder)
    with TemporaryDirectory() as temporary:
        copy = Path(temporary) / "flight"
        shutil.copytree(folder, copy)
        run_tool(["make", "-s", "pipe.elf"], copy)
        program = (copy / "pipe.elf").read_bytes()
    members = documents(described, None) | references(model, 2)
    members |= {f"resources/{name}.elf": program, "resources/processor.txt": _PROCESSOR.format(name=name).encode()}
    guid = identifier(members | code | {"modelDescription.xml": _description(described, "")})
    members["modelDescription.xml"] = _description(described, guid)
    members |= compile_library(with_guid(code, guid), described.name, 2, platform)
    path = folder / f"{name}.fmu"
    write_archive(path, dict(sorted(members.items(), key=lambda item: (item[0] != "modelDescription.xml", item[0]))))
    return path


def _with_health(model: StepModel) -> StepModel:
    """Return what describes the FMU: a model's variables with ``health`` after the outputs. It computes nothing."""
    first_local = len(model.variables) - model.count("local")
    meaning = ", ".join(f"{1 << k} {label.lower()}" for k, (label, _) in enumerate(HEALTH))
    health = Variable(
        "output", "health", "1", f"What the component says of its step, a sum of {meaning}", minimum=0.0, maximum=0.0,
        discrete=True, advice="The page of flight code says what its bits mean.",
    )  # fmt: skip
    variables = (*model.variables[:first_local], health, *model.variables[first_local:])
    parameters, inputs, results = model.slices()
    x, u, p, h = (
        ca.MX.sym(label, n) for label, n in zip("xuph", (1, inputs.stop - inputs.start, parameters.stop, 1), strict=True)
    )
    y = ca.repmat(ca.sum1(u) + ca.sum1(p), results.stop - results.start + 1, 1)
    init, step = ca.Function("init", [u, p], [ca.DM.zeros(1), y]), ca.Function("step", [x, u, p, h], [x, y])
    return replace(
        model, variables=variables, init=init, step=step, step_limit=None, residual=None, compiled=None, at_rest=None
    )


def _sources(described: StepModel, name: str, folder: Path) -> dict[str, bytes]:
    here = Path(__file__).parent / "native"
    files = {each: (here / each).read_bytes() for each in _SOURCES}
    files["fmi2.c"] = b"#define _POSIX_C_SOURCE 200809L\n" + files["fmi2.c"]
    last = described.count("output") - 1
    more = f"#undef HAS_TABLES\n#define HAS_TABLES 1\n#define HEALTH {last}\n".encode()
    files["model.h"] = sources(described, "", 2)["model.h"] + more
    files["functions.h"] = b"/* see tables.h */\n"
    files["tables.h"] = (here / "processor.h").read_bytes()
    named = ((name, "component"), (name.upper(), "COMPONENT"))
    for each in (f"{name}.h", "pipe.h"):
        text = (folder / each).read_text(encoding="utf-8")
        for old, new in named:
            text = text.replace(old, new)
        files[each.replace(name, "component")] = text.encode()
    return files


def _description(described: StepModel, guid: str) -> bytes:
    text = model_description(described, guid, fmi=2, native=True).decode()
    for capability in _WITHOUT:
        text = text.replace(f'{capability}="true"', f'{capability}="false"')
    return text.replace('needsExecutionTool="false"', 'needsExecutionTool="true"').encode()

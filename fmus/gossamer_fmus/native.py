"""Turn a step model into C and compile it for any platform with zig.

The sources of an FMU are, in one translation unit::

    fmi2.c or fmi3.c    the FMI functions
    stepper.h           initialize, step, derivatives, states; the same for every model
    model.h             the table of variables and sizes, written here
    functions.h         init, step and their derivatives, written by CasADi

The headers of the FMI standard come from whoever compiles, as the standard asks; here from FMPy.

One compiler for all platforms keeps the numbers the same: IEEE arithmetic in the order of the expressions, no contraction
to fused multiply-adds, no reordering. Only ``sin`` and its like come from each platform's C library.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import casadi as ca
from gossamer_models import ParameterError, StepModel

from .arrays import arrays_of

FmiVersion = Literal[2, 3]


@dataclass(frozen=True, slots=True, kw_only=True)
class Platform:
    """Where a binary runs.

    Attributes
    ----------
    folder : str or None
        Folder below ``binaries/`` in FMI 2.0, which knows no Linux on Arm; its platforms may hold several architectures.
    suffix : str
        Of a shared library.
    targets : dict
        zig's target by folder below ``binaries/`` in FMI 3.0.
    """

    folder: str | None
    suffix: str
    targets: dict[str, str]


PLATFORMS = {
    "linux64": Platform(folder="linux64", suffix=".so", targets={"x86_64-linux": "x86_64-linux-gnu.2.17"}),
    "win64": Platform(folder="win64", suffix=".dll", targets={"x86_64-windows": "x86_64-windows-gnu"}),
    "darwin64": Platform(
        folder="darwin64",
        suffix=".dylib",
        targets={"x86_64-darwin": "x86_64-macos.11.0", "aarch64-darwin": "aarch64-macos.11.0"},
    ),
    "aarch64-linux": Platform(folder=None, suffix=".so", targets={"aarch64-linux": "aarch64-linux-gnu.2.17"}),
}
FLAGS = (
    "-std=c11",
    "-O2",
    "-fPIC",
    "-fvisibility=hidden",
    "-ffp-contract=off",
    "-fno-math-errno",  # inline square roots; nobody reads errno
)


def chosen(names: Iterable[str], fmi: FmiVersion) -> list[str]:
    """Return the platforms that a user means: those named, all of them, or by default the one this program runs on.

    Raises
    ------
    ParameterError
        A platform is unknown, or has no place in this version of the standard.
    """
    names = list(names) or [_this_platform()]
    possible = [name for name, platform in PLATFORMS.items() if fmi == 3 or platform.folder]
    for name in names:
        if name != "all" and name not in possible:
            msg = f"FMUs of FMI {fmi}.0 cannot be built for {name!r}; there are {', '.join(possible)} and all."
            if name in PLATFORMS:
                msg = f"FMUs can be built for {name!r} only with --fmi 3."
            raise ParameterError(msg)
    return possible if "all" in names else names


def _this_platform() -> str:
    import platform

    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    folder = f"{machine}-{platform.system().lower()}"
    return next((name for name, each in PLATFORMS.items() if folder in each.targets), folder)


def sources(model: StepModel, guid: str, fmi: FmiVersion) -> dict[str, bytes]:
    """Return the C sources by file name; ``fmi2.c`` or ``fmi3.c`` is the one to compile.

    Parameters
    ----------
    model : StepModel
        Best built with ``compiled=True`` where it has that choice.
    guid : str
        Identifier that the host must give.
    fmi : {2, 3}
        Version of the standard.
    """
    here = Path(__file__).parent / "native"
    files = {name: (here / name).read_bytes() for name in (f"fmi{fmi}.c", "stepper.h")}
    functions = [model.init, model.step, derivative(model), initial_derivative(model)]
    files["model.h"] = _model_header(model, guid, functions).encode()
    generator = ca.CodeGenerator("functions", {"with_header": False, "verbose": False, "indent": 1})
    for function in functions:
        generator.add(function)
    files["functions.h"] = generator.dump().encode()
    return files


def with_guid(files: dict[str, bytes], guid: str) -> dict[str, bytes]:
    """Return ``sources`` written without a guid with that guid; what CasADi wrote is not written again."""
    header = files["model.h"].replace(_guid_line("").encode(), _guid_line(guid).encode(), 1)
    return files | {"model.h": header}


def derivative(model: StepModel) -> ca.Function:
    """Return ``derivative(x, u, p, h, dx, du) -> (dx_next, dy)``: how a step changes with its state and inputs."""
    arguments = [ca.MX.sym(name, model.step.nnz_in(i)) for i, name in enumerate("xuph")]
    x, u = arguments[:2]
    dx, du = ca.MX.sym("dx", x.numel()), ca.MX.sym("du", u.numel())
    result = ca.vertcat(*model.step.call(arguments, True, False))  # inlined: else parameters are differentiated too
    change = ca.jtimes(result, ca.vertcat(x, u), ca.vertcat(dx, du))
    return ca.Function("derivative", [*arguments, dx, du], ca.vertsplit(change, [0, x.numel(), change.numel()]))


def initial_derivative(model: StepModel) -> ca.Function:
    """Return ``initial_derivative(u, p, du) -> dy``: how the results of the initialization change with the inputs."""
    arguments = [ca.MX.sym(name, model.init.nnz_in(i)) for i, name in enumerate("up")]
    du = ca.MX.sym("du", arguments[0].numel())
    _, y = model.init.call(arguments, True, False)
    return ca.Function("initial_derivative", [*arguments, du], [ca.jtimes(y, arguments[0], du)])


def fmi_headers() -> Path:
    """Return the folder of the FMI standard's headers."""
    return Path(str(find_spec("fmpy").origin)).parent / "c-code"  # type: ignore[union-attr]


def compile_library(files: dict[str, bytes], name: str, fmi: FmiVersion, platform: str) -> dict[str, bytes]:
    """Compile C sources for one platform.

    Parameters
    ----------
    files : dict
        As from ``sources``.
    name : str
        Of the library, without ending.
    fmi : {2, 3}
        Version of the standard.
    platform : str
        A key of ``PLATFORMS``; see ``chosen``.

    Returns
    -------
    dict
        Libraries by path below ``binaries/``; the same sources and compiler give the same bytes.

    Raises
    ------
    ModuleNotFoundError
        The compiler is not installed.
    """
    place = PLATFORMS[platform]
    if find_spec("ziglang") is None:
        msg = "native FMUs need the compiler ziglang. Install it with make, or: pip install -e '.[native]'"
        raise ModuleNotFoundError(msg)
    file = f"{name}{place.suffix}"
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for source, content in files.items():
            (folder / source).write_bytes(content)
        built = {key: _compile(folder, f"fmi{fmi}.c", file, target) for key, target in place.targets.items()}
    if fmi == 2:
        return {f"{place.folder}/{file}": universal(built.values()) if len(built) > 1 else next(iter(built.values()))}
    return {f"{key}/{file}": content for key, content in built.items()}


def universal(libraries: Iterable[bytes]) -> bytes:
    """Join Mach-O libraries for several processors into one file.

    Notes
    -----
    Apple's ``fat_header`` (mach-o/fat.h): big-endian magic and count, then processor type and subtype, offset, size and
    alignment of each library; the types are the second and third word of a Mach-O file.
    """
    libraries, align = list(libraries), 14
    head = bytearray((0xCAFEBABE).to_bytes(4, "big") + len(libraries).to_bytes(4, "big"))
    place, body = 1 << align, b""
    for library in libraries:
        for number in (library[7:3:-1], library[11:7:-1]):
            head += number
        for value in (place, len(library), align):
            head += value.to_bytes(4, "big")
        padded = library + bytes(-len(library) % (1 << align))
        body += padded
        place += len(padded)
    return bytes(head).ljust(1 << align, b"\0") + body


def _compile(folder: Path, source: str, library: str, target: str) -> bytes:
    windows = "windows" in target
    compiler = [sys.executable, "-m", "ziglang", "cc", "-target", target]
    command = [*compiler, *FLAGS, "-I", str(fmi_headers()), "-g0", "-s", "-shared", "-o", library, source]
    if not windows:
        command.append("-lm")
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        msg = f"the compiler failed for {target}:\n{done.stderr[-2000:]}"
        raise RuntimeError(msg)
    return (folder / library).read_bytes()


def _model_header(model: StepModel, guid: str, functions: list[ca.Function]) -> str:
    """Write the table of variables and all sizes as C."""
    parameters, inputs, results = model.slices()
    place = {name: i for i, name in enumerate(model.names)}
    digest = ", ".join(f"0x{byte:02x}" for byte in bytes.fromhex(model.digest)[:16])
    sizes = {
        "N_VARIABLES": len(model.variables),
        "N_PARAMETERS": parameters.stop,
        "N_INPUTS": inputs.stop - inputs.start,
        "N_RESULTS": results.stop - results.start,
        "N_STATES": model.n_states,
        "SIZE_ARG": max(f.sz_arg() for f in functions),
        "SIZE_RES": max(f.sz_res() for f in functions),
        "SIZE_IW": max(1, *(f.sz_iw() for f in functions)),
        "SIZE_W": max(1, *(f.sz_w() for f in functions)),
        "STEP_LIMIT": -1 if model.step_limit is None else place[model.step_limit],
    }
    lines = [
        f"/* Model {model.name}: {model.description}. */",
        f"#define MODEL_NAME {_c_text(model.name)}",
        _guid_line(guid),
        f"#define MODEL_ADVICE {_c_text(model.advice)}",
        f"#define MODEL_DIGEST {digest}",
        "#define CASADI_CODEGEN_PREFIX",
        f"#define CODEGEN_PREFIX {model.name}_",
        *(f"#define {name} {value}" for name, value in sizes.items()),
        "",
        "/* name, unit, start, minimum, maximum */",
        "static const Variable VARIABLES[N_VARIABLES] = {",
        *(
            f" {{{_c_text(v.name)}, {_c_text(v.unit)}, {v.start or 0.0!r}, "
            f"{'-DBL_MAX' if v.minimum is None else repr(float(v.minimum))}, "
            f"{'DBL_MAX' if v.maximum is None else repr(float(v.maximum))}}},"
            for v in model.variables
        ),
        "};",
        "",
        "/* arrays of FMI 3.0: first variable and size */",
        f"#define N_ARRAYS {len(arrays_of(model))}",
        "static const Array ARRAYS[N_ARRAYS] = {",
        *(f" {{{array.first}, {array.size}}}," for array in arrays_of(model)),
        "};",
    ]
    return "\n".join(lines) + "\n"


def _guid_line(guid: str) -> str:
    return f"#define MODEL_GUID {_c_text(guid)}"


def _c_text(text: str) -> str:
    quoted = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{quoted}"'

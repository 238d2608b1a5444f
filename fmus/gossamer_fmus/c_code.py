"""Write a step model as C.

The sources of an FMU are one translation unit::

    fmi2.c or fmi3.c    the FMI functions
    stepper.h           initialize, step, derivatives; the same for every model
    state.h             saved states; the same for every model
    instance.h          where instances lie; the same for every model
    model.h             the table of variables and sizes, written here
    functions.h         init, step and their derivatives, written by CasADi
    loop.h, sum.h       of a model with tables: its sums over elements
    loops.h             sizes and constants of all loops, written here
    elements.h          each element's function, written by CasADi and made safe for lanes, and the table of loops; compiled
                        for each set of instructions
    tables.h            how it reads the numbers that are too many for its text, ``resources/tables.bin`` of the FMU
    resources.h         where that is
"""

from __future__ import annotations

import json
import re
import zlib
from pathlib import Path

import casadi as ca
import gossamer_models.batch
import numpy as np
from gossamer_models import StepModel
from gossamer_models.batch.code import internal_name, safe_for_lanes, with_loops
from gossamer_models.element_loop import LANES, Tables

from .a2l import VALUES_OFFSET, first_instance
from .description import FmiVersion, arrays_of

TABLES_FILE = "tables.bin"
_ALWAYS = ("stepper.h", "state.h", "instance.h")
_LONG, _MANY = 1_000, 100_000  # numbers of a list, and of all such lists, that text and every library need not repeat
_FACTORS = re.compile(r"^( *)(casadi_real lt\[\d+\], d\[\d+\], w\[\d+\];)$", re.MULTILINE)
_LIST = re.compile(r"static const casadi_real (casadi_c\d+)\[\d+\] =\s*\{([^}]*)\};")
INTERFACE = re.compile(r"^CASADI_SYMBOL_EXPORT .*?\n\}\n\n?", re.DOTALL | re.MULTILINE)
_CONSTANT_MACRO = re.compile(r"#define casadi_c\d+ .*\n")
_CONSTANT = re.compile(r"\bcasadi_(c\d+)")
_SPREAD = re.compile(r"static const double element_c.*?\n\}\n", re.DOTALL)


def sources(model: StepModel, guid: str, fmi: FmiVersion) -> dict[str, bytes]:
    """Return the C sources by file name, and ``tables.bin`` if they read one; ``fmi2.c`` or ``fmi3.c`` is to be compiled.

    Parameters
    ----------
    model : StepModel
        Model, created with ``compiled=True`` if it has that option.
    guid : str
        Identifier that the host must pass.
    fmi : {2, 3}
        Version of the standard.
    """
    here = Path(__file__).parent / "native"
    files = {name: (here / name).read_bytes() for name in (f"fmi{fmi}.c", *_ALWAYS)}
    functions = [model.init, model.step]
    expression = model if model.tables is None else model.expression and model.expression()
    if expression is not None:
        functions += [derivative(expression), initial_derivative(expression)]
    generator = ca.CodeGenerator("functions", {"with_header": False, "verbose": False, "indent": 1})
    for function in [*functions, *(loop.stand_in for loop in (model.tables.loops if model.tables else ()))]:
        generator.add(function)
    if model.tables is None:
        code, tables = _long_lists_read(generator.dump())
        sizes: dict[str, int | str] = {"N_NUMBERS": len(tables) // 8, "N_PLACES": 0}
    else:
        code, tables = with_loops(generator.dump(), model.tables.loops), model.tables.content()
        files |= loop_sources(model.name, model.tables)
        sizes = table_sizes(model.tables)
    if tables:
        sizes |= {"TABLES_FILE": f'"{TABLES_FILE}"', "TABLES_CHECKSUM": zlib.crc32(tables)}
        files |= {name: (here / name).read_bytes() for name in ("tables.h", "resources.h")} | {TABLES_FILE: tables}
    # factors of large membranes do not fit on the stack of a host's thread
    files["functions.h"] = _FACTORS.sub(r"\1static _Thread_local \2", code).encode()
    return files | {"model.h": _model_header(model, guid, functions, sizes).encode()}


def _long_lists_read(code: str) -> tuple[str, bytes]:
    """Let code take long lists of constants, as of networks, from a file if together they are many."""
    lists = {m[1]: np.array(m[2].split(","), dtype="<f8") for m in _LIST.finditer(code) if m[2].count(",") >= _LONG}
    if sum(map(len, lists.values())) < _MANY:
        return code, b""
    begin = dict(zip(lists, np.cumsum([0, *map(len, lists.values())]).tolist(), strict=False))

    def read(found: re.Match[str]) -> str:
        name = found[1]
        return f"#undef {name}\n#define {name} (tables + {begin[name]})" if name in begin else found[0]

    return _LIST.sub(read, code), np.concatenate([*lists.values()]).tobytes()


def with_guid(files: dict[str, bytes], guid: str) -> dict[str, bytes]:
    """Insert a guid into ``sources`` that were written without one; the files of CasADi are not written again."""
    header = files["model.h"].replace(_guid_line("").encode(), _guid_line(guid).encode(), 1)
    return files | {"model.h": header}


def derivative(model: StepModel) -> ca.Function:
    """Return ``derivative(x, u, p, h, dx, du) -> (dx_next, dy)``: how a step changes with its state and inputs."""
    arguments = [ca.MX.sym(name, model.step.nnz_in(i)) for i, name in enumerate("xuph")]
    x, u = arguments[:2]
    dx, du = ca.MX.sym("dx", x.numel()), ca.MX.sym("du", u.numel())
    result = ca.vertcat(*model.step.call(arguments, True, False))  # inlined: else parameters are differentiated too
    change = ca.densify(ca.jtimes(result, ca.vertcat(x, u), ca.vertcat(dx, du)))  # also where nothing can change
    return ca.Function("derivative", [*arguments, dx, du], ca.vertsplit(change, [0, x.numel(), change.numel()]))


def initial_derivative(model: StepModel) -> ca.Function:
    """Return ``initial_derivative(u, p, du) -> dy``: how the results of the initialization change with the inputs."""
    arguments = [ca.MX.sym(name, model.init.nnz_in(i)) for i, name in enumerate("up")]
    du = ca.MX.sym("du", arguments[0].numel())
    _, y = model.init.call(arguments, True, False)
    return ca.Function("initial_derivative", [*arguments, du], [ca.densify(ca.jtimes(y, arguments[0], du))])


def _model_header(model: StepModel, guid: str, functions: list[ca.Function], tables: dict[str, int | str]) -> str:
    """Write the table of variables and all sizes as C."""
    parameters, inputs, results = model.slices()
    digest = ", ".join(f"0x{byte:02x}" for byte in bytes.fromhex(model.digest)[:16])
    sizes = {
        "N_VARIABLES": len(model.variables),
        "N_PARAMETERS": parameters.stop,
        "N_INPUTS": inputs.stop - inputs.start,
        "N_RESULTS": results.stop - results.start,
        "N_STATES": model.n_states,
        "VALUES_OFFSET": VALUES_OFFSET,
        "N_RESTARTED": model.restarted,
        "SIZE_ARG": max(f.sz_arg() for f in functions),
        "SIZE_RES": max(f.sz_res() for f in functions),
        "SIZE_IW": max(1, *(f.sz_iw() for f in functions)),
        "SIZE_W": max(1, *(f.sz_w() for f in functions)),
        "RESIDUAL": -1 if model.residual is None else model.residual,
        "STEP_LIMIT": -1 if model.step_limit is None else model.names.index(model.step_limit),
        "HAS_LOOPS": int(model.tables is not None),
        "HAS_DERIVATIVES": int(model.tables is None or model.expression is not None),
        "HAS_TABLES": int("TABLES_FILE" in tables),
    } | tables
    lines = [
        f"/* Model {model.name}: {model.description.replace('*/', '* /')}. */",
        f"#define MODEL_NAME {_c_text(model.name)}",
        _guid_line(guid),
        f"#define MODEL_ADVICE {_c_text(model.advice)}",
        f"#define MODEL_DIGEST {digest}",
        f"#define FIRST_INSTANCE {first_instance(model)}",
        "#define CASADI_CODEGEN_PREFIX",
        f"#define CODEGEN_PREFIX {model.name}_",
        *(f"#define {name} {value}" for name, value in sizes.items()),
        "",
        "/* name, unit, start, minimum, maximum, advice */",
        "static const Variable VARIABLES[N_VARIABLES] = {",
        *(
            f" {{{_c_text(v.name)}, {_c_text(v.unit)}, {v.start or 0.0!r}, "
            f"{'-DBL_MAX' if v.minimum is None else repr(float(v.minimum))}, "
            f"{'DBL_MAX' if v.maximum is None else repr(float(v.maximum))}, {_c_text(v.advice)}}},"
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
    return json.dumps(text, ensure_ascii=False)  # quotes and escapes as C does


def loop_sources(model: str, tables: Tables) -> dict[str, bytes]:
    """Return the C sources of the loops by file name; names in them begin with that of the model."""
    here = Path(__file__).parent / "native"
    lanes = Path(gossamer_models.batch.__file__).with_name("lanes.h")
    files = {"lanes.h": lanes.read_bytes()} | {name: (here / name).read_bytes() for name in ("loop.h", "sum.h")}
    generator = ca.CodeGenerator("elements", {"with_header": False, "verbose": False, "indent": 1})
    for loop in tables.loops:
        generator.add(loop.function)
    code = safe_for_lanes(generator.dump())
    internal = [internal_name(code, loop.function.name()) for loop in tables.loops]
    # constants are there once: what spreads them over the lanes runs on any processor
    code = _CONSTANT.sub(r"element_\1", _CONSTANT_MACRO.sub("", INTERFACE.sub("", code)))
    constants = "".join(_SPREAD.findall(code))
    files["loops.h"] = f"{_sizes(model, tables)}\n{constants}".encode()
    files["elements.h"] = f"{_SPREAD.sub('', code)}\n{_table(tables, internal)}".encode()
    return files


def table_sizes(tables: Tables) -> dict[str, int | str]:
    """Return the macros of ``tables.h`` and ``loop.h`` for the numbers of a model with loops."""
    return {
        "N_NUMBERS": tables.numbers.size + sum(loop.numbers().size for loop in tables.loops),
        "N_PLACES": sum(loop.places().size for loop in tables.loops),
        "BLOCK": LANES,
    }


def _sizes(model: str, tables: Tables) -> str:
    """Write the sizes that hold for all loops, their numbers, and the prefixes of names."""
    loops = tables.loops
    sizes = {
        "BASELINE": f"{model}_baseline_",
        "AVX2": f"{model}_avx2_",
        "MOST_NODES": max(loop.nodes.shape[1] for loop in loops),
        "MOST_SHARED": max(loop.function.nnz_in(1) for loop in loops),
        "MOST_OWN": max(loop.own.shape[1] for loop in loops),
        "MOST_REDUCTIONS": max(len(loop.reductions) for loop in loops),
        "MOST_ARG": max(loop.function.sz_arg() for loop in loops),
        "MOST_RES": max(loop.function.sz_res() for loop in loops),
        "MOST_IW": max(1, *(loop.function.sz_iw() for loop in loops)),
        "MOST_W": max(1, *(loop.function.sz_w() for loop in loops)),
        "EACH_LOOP": " ".join(f"LOOP({k})" for k in range(len(loops))),
    }
    return "".join(f"#define {name} {value}\n" for name, value in sizes.items())


def _table(tables: Tables, internal: list[str]) -> str:
    """Write the table of loops."""
    lines = ["static const Loop CASADI_PREFIX(loops)[] = {"]
    numbers, places = tables.numbers.size, 0
    for function, loop in zip(internal, tables.loops, strict=True):
        n, m = loop.nodes.shape
        kinds = "".join(kind[0] for kind in loop.reductions)
        lines.append(
            f" {{{function}, {n}, {m}, {loop.function.nnz_in(1)}, {loop.columns}, {loop.own.shape[1]}, "
            f'{loop.forces}, {3 * loop.n_forces}, "{kinds}", {numbers}, {places}}},'
        )
        numbers, places = numbers + loop.numbers().size, places + loop.places().size
    return "\n".join([*lines, "};", ""])

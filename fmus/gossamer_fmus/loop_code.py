"""Write the loops over elements of a model as C; see ``native/loop.h``.

loops.h       sizes and constants of all loops
elements.h    each element's function, written by CasADi and made safe for lanes, and the table of loops; compiled for each
              set of instructions
"""

from __future__ import annotations

import re
from pathlib import Path

import casadi as ca
import gossamer_models.batch
from gossamer_models.batch.code import internal_name, safe_for_lanes
from gossamer_models.element_loop import LANES, Tables

_INTERFACE = re.compile(r"^CASADI_SYMBOL_EXPORT .*?\n\}\n\n?", re.DOTALL | re.MULTILINE)
_CONSTANT_MACRO = re.compile(r"#define casadi_c\d+ .*\n")
_CONSTANT = re.compile(r"\bcasadi_(c\d+)")
_SPREAD = re.compile(r"static const double element_c.*?\n\}\n", re.DOTALL)


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
    code = _CONSTANT.sub(r"element_\1", _CONSTANT_MACRO.sub("", _INTERFACE.sub("", code)))
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
    """Write the sizes that hold for all loops, and the prefixes of names."""
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

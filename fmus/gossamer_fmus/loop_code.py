"""Write the loops over elements of a model as C; see ``native/loop.h``.

elements.h    each element's function, written by CasADi and made safe for lanes
loops.h       the table of loops, written here
"""

from __future__ import annotations

import re
import zlib
from pathlib import Path

import casadi as ca
import gossamer_models.batch
from gossamer_models.batch.code import safe_for_lanes
from gossamer_models.element_loop import LANES, ElementLoop, Tables

FILE = "tables.bin"
_FUNCTION = r"static int {name}\(const casadi_real\*\* arg, [^)]*\) \{{"
_ZEROS = re.compile(r"(static const casadi_real casadi_zeros\[\d+\]) =\s*\{[0., \n]*\};")
_EXPOSED = r"CASADI_SYMBOL_EXPORT int {name}\([^)]*\)\s*\{{\s*return (casadi_f\d+)\("


def loop_sources(tables: Tables) -> dict[str, bytes]:
    """Return the C sources of the loops by file name."""
    here = Path(__file__).parent / "native"
    lanes = Path(gossamer_models.batch.__file__).with_name("lanes.h")
    files = {"lanes.h": lanes.read_bytes()} | {name: (here / name).read_bytes() for name in ("loop.h", "tables.h")}
    generator = ca.CodeGenerator("elements", {"with_header": False, "verbose": False, "indent": 1})
    for loop in tables.loops:
        generator.add(loop.function)
    files["elements.h"] = safe_for_lanes(generator.dump()).encode()
    files["loops.h"] = _loops(tables).encode()
    return files


def table_sizes(tables: Tables) -> dict[str, int | str]:
    """Return the macros of ``tables.h`` and ``loop.h``."""
    content = tables.content()
    places = sum(loop.places().size for loop in tables.loops)
    return {
        "N_NUMBERS": (len(content) - 4 * places) // 8,
        "N_PLACES": places,
        "N_POSITIONS": 3 * tables.loops[0].n_nodes,
        "TABLES_FILE": f'"{FILE}"',
        "TABLES_CHECKSUM": zlib.crc32(content),
        "LANES": LANES,
    }


def with_loops(code: str, loops: tuple[ElementLoop, ...]) -> str:
    """Let the functions that stand in for loops run them, and leave out long lists of zeros.

    Parameters
    ----------
    code : str
        From CasADi's generator, to which the ``stand_in`` of each was added.
    loops : tuple of ElementLoop
        The loops.
    """
    for number, loop in enumerate(loops):
        exposed = re.search(_EXPOSED.format(name=loop.name), code)
        if exposed is None:
            msg = f"CasADi wrote no function {loop.name!r}; its generator must have changed"
            raise RuntimeError(msg)
        begin = re.search(_FUNCTION.format(name=exposed[1]), code)
        if begin is None:
            msg = f"CasADi wrote no body of {loop.name!r}; its generator must have changed"
            raise RuntimeError(msg)
        end = code.index("\n}\n", begin.end())
        code = f"{code[: begin.end()]}\n return run_loop({number}, arg, res);{code[end:]}"
    return _ZEROS.sub(r"\1;", code)  # zero anyway


def _loops(tables: Tables) -> str:
    """Write the table of loops, and the sizes that hold for all of them."""
    loops = tables.loops
    sizes = {
        "MOST_NODES": max(loop.nodes.shape[1] for loop in loops),
        "MOST_SHARED": max(loop.function.nnz_in(1) for loop in loops),
        "MOST_OWN": max(loop.own.shape[1] for loop in loops),
        "MOST_REDUCTIONS": max(len(loop.reductions) for loop in loops),
        "MOST_ARG": max(loop.function.sz_arg() for loop in loops),
        "MOST_RES": max(loop.function.sz_res() for loop in loops),
        "MOST_IW": max(1, *(loop.function.sz_iw() for loop in loops)),
        "MOST_W": max(1, *(loop.function.sz_w() for loop in loops)),
    }
    lines = [f"#define {name} {value}" for name, value in sizes.items()]
    lines += ["", "static const Loop LOOPS[] = {"]
    numbers, places = tables.numbers.size, 0
    for loop in loops:
        n, m = loop.nodes.shape
        kinds = "".join(kind[0] for kind in loop.reductions)
        lines.append(
            f" {{{loop.function.name()}, {n}, {m}, {loop.function.nnz_in(1)}, {loop.own.shape[1]}, "
            f'{str(loop.forces).lower()}, "{kinds}", {numbers}, {places}}},'
        )
        numbers, places = numbers + loop.numbers().size, places + loop.places().size
    return "\n".join([*lines, "};", ""])

"""Write ``init`` and ``step`` of a model as C whose numbers are eight cases at once.

The sources of a kernel are one translation unit::

    batch.c        the time loop; the same for every model
    lanes.h        eight numbers as one; the same for every model
    loop.h         a sum over the elements of a mesh; the same for every model
    sizes.h        sizes of the model, written here
    functions.h    init and step, written by CasADi and made safe for lanes here
    loops.h        of a model with tables: the numbers of its mesh, and its loops over them

Each function, and that of one element of a mesh, is expanded to scalar operations where that is possible and gives at most
``MAX_EXPANDED`` of them: straight code without memory between operations is faster, two to five times for small models.
Where not (a sparse solve, a table that is looked up, a fine mesh), CasADi's loops over arrays are compiled, whose time to
compile does not grow with the model. Sums over elements stay loops.
"""

import re
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

import casadi as ca
import numpy as np

from ..element_loop import ElementLoop, Tables
from ..step_model import StepModel

MAX_EXPANDED = 100_000  # half a minute of compiling
MAX_BESIDE_LOOPS = 12_000  # the step of the square of order 4 is below: as loops it takes 20 to 35 % longer
MAX_ONCE = 1_000  # beside loops, of what is run once a case
MAX_ELEMENT = 10_000  # of one element's function


def sources(model: StepModel, results: Sequence[str]) -> dict[str, bytes]:
    """Return the C sources by file name; ``batch.c`` is the one to compile.

    Parameters
    ----------
    model : StepModel
        Model; of one that has a form with loops, this form.
    results : sequence of str
        Outputs and locals to record.
    """
    begin = model.at_rest.begin if model.at_rest is not None and model.at_rest.finder is not None else model.init
    functions = [_with_results(*pair, model, results) for pair in (("init", begin), ("step", model.step))]
    loops = () if model.tables is None else model.tables.loops
    if model.tables is not None:
        functions = [_with_numbers(function, model.tables) for function in functions]
    most = (MAX_ONCE, MAX_BESIDE_LOOPS) if loops else (MAX_EXPANDED, MAX_EXPANDED)
    functions = [_expanded(function, size) for function, size in zip(functions, most, strict=True)]
    elements = [_expanded(loop.function, MAX_ELEMENT) for loop in loops]
    generator = ca.CodeGenerator("functions", {"with_header": False, "verbose": False, "indent": 0})
    for function in [*functions, *elements, *(loop.stand_in for loop in loops)]:
        generator.add(function)
    code = with_loops(safe_for_lanes(generator.dump()), loops)
    for function in [*functions, *elements]:
        code = _with_all_arguments(code, function.name())
    return {
        **own_sources(),
        "sizes.h": _sizes(model, results, functions, elements).encode(),
        "functions.h": code.encode(),
        "loops.h": _loops(loops).encode(),
    }


def own_sources() -> dict[str, bytes]:
    """Return the C sources that are the same for every model, by file name."""
    return {name: (Path(__file__).parent / name).read_bytes() for name in ("batch.c", "lanes.h", "loop.h")}


def recorded(model: StepModel, results: Sequence[str]) -> list[str]:
    """Return the results that a kernel computes: those to record and, last, the step limit if it is a result."""
    limit = model.step_limit
    is_result = limit is not None and model.names.index(limit) >= model.slices()[2].start
    return [*results, *([limit] if limit is not None and is_result else [])]


def _with_results(name: str, function: ca.Function, model: StepModel, results: Sequence[str]) -> ca.Function:
    """Keep the state and some of the results, in pieces of one array each, so that no other is computed."""
    first = model.slices()[2].start
    names = recorded(model, results)
    rows = [model.names.index(name) - first for name in names]
    pieces = groupby(range(len(rows)), lambda i: (names[i].partition("[")[0], rows[i] - i))
    symbols = function.mx_in()
    x, y = function.call(symbols, True, False)
    parts = [y[rows[i[0]] : rows[i[-1]] + 1] for i in (list(places) for _, places in pieces)]
    return ca.Function(name, symbols, [x, ca.vertcat(*parts)])


def _with_numbers(function: ca.Function, tables: Tables) -> ca.Function:
    """Take the numbers of the tables as constants rather than as the last input."""
    symbols = function.mx_in()[:-1]
    return ca.Function(function.name(), symbols, function.call([*symbols, ca.MX(ca.DM(tables.numbers))], True, False))


def _expanded(function: ca.Function, most: int) -> ca.Function:
    """Write a function as scalar operations, each once, if that is possible and they are not too many."""
    try:
        expanded = function.expand()
    except RuntimeError:
        return function
    symbols = expanded.sx_in()
    expanded = ca.Function(function.name(), symbols, ca.cse(expanded.call(symbols)))
    return expanded if expanded.n_instructions() <= most else function


_FUNCTION = r"static int {name}\(const casadi_real\*\* arg, [^)]*\) \{{"
_EXPOSED = r"CASADI_SYMBOL_EXPORT int {name}\([^)]*\)\s*\{{\s*return (casadi_f\d+)\("
_ZEROS = re.compile(r"(static const casadi_real casadi_zeros\[\d+\]) =\s*\{[0., \n]*\};")


def with_loops(code: str, loops: Sequence[ElementLoop]) -> str:
    """Let the functions that stand in for loops run them, and leave out long lists of zeros.

    Parameters
    ----------
    code : str
        From CasADi's generator, to which the ``stand_in`` of each was added.
    loops : sequence of ElementLoop
        The loops.
    """
    for number, loop in enumerate(loops):
        begin, end = _body(code, loop.name)
        code = f"{code[:begin]}\n return run_loop({number}, arg, res);{code[end:]}"
    return _ZEROS.sub(r"\1;", code)  # zero anyway


def internal_name(code: str, name: str) -> str:
    """Return the name that CasADi gave the function behind one that it exposes."""
    exposed = re.search(_EXPOSED.format(name=name), code)
    if exposed is None:
        msg = f"CasADi wrote no function {name!r}; its generator must have changed"
        raise RuntimeError(msg)
    return exposed[1]


def _body(code: str, name: str) -> tuple[int, int]:
    """Return where the body of the function behind an exposed one begins and ends."""
    begin = re.search(_FUNCTION.format(name=internal_name(code, name)), code)
    if begin is None:
        msg = f"CasADi wrote no body of {name!r}; its generator must have changed"
        raise RuntimeError(msg)
    return begin.end(), code.index("\n}\n", begin.end())


def _with_all_arguments(code: str, name: str) -> str:
    """Leave out what a function does without an argument: here it has all, and thousands of branches compile slowly."""
    begin, end = _body(code, name)
    return code[:begin] + _GIVEN.sub(r"\1;", code[begin:end]) + code[end:]


def _loops(loops: Sequence[ElementLoop]) -> str:
    """Write the tables of the mesh, and what runs the loops over them."""
    text, cases = [], []
    for number, loop in enumerate(loops):
        n, m = loop.nodes.shape
        places = np.column_stack([3 * loop.nodes, loop.shared * loop.function.nnz_in(1)])
        text += [
            f"static const int32_t places_{number}[] = {{{','.join(map(str, places.ravel().tolist()))}}};",
            f"static const double numbers_{number}[] = {{{','.join(map(repr, loop.own.ravel().tolist()))}}};",
        ]
        sizes = f"{n}, {m}, {loop.own.shape[1]}, {loop.forces}, {3 * loop.n_forces}"
        kinds = "".join(kind[0] for kind in loop.reductions)
        cases.append(
            f"case {number}: return sum_over({loop.function.name()}, {sizes}, "
            f'"{kinds}", places_{number}, numbers_{number}, arg, res);'
        )
    text += [
        "static int run_loop(int which, const lanes **arg, lanes **res) {",
        "switch (which) {",
        *cases,
        "}",
        "return 1;",
        "}",
    ]
    return "\n".join([*text, ""])


def _sizes(
    model: StepModel, results: Sequence[str], functions: Sequence[ca.Function], elements: Sequence[ca.Function]
) -> str:
    parameters, inputs, _ = model.slices()
    n_p, n_u, n_y = parameters.stop, inputs.stop - inputs.start, len(recorded(model, results))
    limit = -1 if model.step_limit is None else model.names.index(model.step_limit)
    loops = () if model.tables is None else model.tables.loops
    sizes = {
        "N_PARAMETERS": n_p,
        "N_INPUTS": n_u,
        "N_STATES": model.n_states,
        "N_RESTARTED": model.restarted,
        "N_RESULTS": len(results),
        "N_CHECKED": n_y,
        "N_P": max(1, n_p),  # no array is empty
        "N_U": max(1, n_u),
        "N_X": max(1, model.n_states),
        "N_Y": max(1, n_y),
        "LIMIT_PARAMETER": limit if 0 <= limit < n_p else -1,
        "LIMIT_INPUT": limit - n_p if n_p <= limit < n_p + n_u else -1,
        "LIMIT_RESULT": n_y - 1 if limit >= n_p + n_u else -1,
        "MOST_REDUCTIONS": max([1, *(len(loop.reductions) for loop in loops)]),
    }
    for begin, each in (("SIZE", functions), ("MOST", elements)):
        for what in ("ARG", "RES", "IW", "W"):
            sizes[f"{begin}_{what}"] = max([1, *(getattr(f, f"sz_{what.lower()}")() for f in each)])
    return "".join(f"#define {name} {value}\n" for name, value in sizes.items())


_OPERATORS = {"<": "is_less", "<=": "is_at_most", "==": "is_equal", "!=": "is_different", "&&": "holds_both", "||": "either"}
_VALUE = r"\(?\*?\w+(?:\+\+|\[\w+\])?\)?"  # w12, a012, *cs++, (*cr++), cs[i]
_BINARY = re.compile(rf"(=\s*)\(({_VALUE})\s*(<=?|==|!=|&&|\|\|)\s*({_VALUE})\)")
_NOT = re.compile(rf"(=\s*)\(!\s*({_VALUE})\s*\)")
_SELECT = re.compile(rf"(=\s*)\(({_VALUE})\?({_VALUE}):0\)")
_LOOK_UP = re.compile(r"\{ i=\(int\) \*cr\+\+; \*rr = i>=0 && i<(\d+) \? (\w+)\[i\] : casadi_nan; \}")
_ARGUMENT = re.compile(r"(arg\[\d+\])\s*\?\s*(arg\[\d+\]\[\d+\])\s*:\s*0;")
_GIVEN = re.compile(r"arg\[\d+\] \? (arg\[\d+\]\[\d+\]) : \(lanes\)\(0\.0\);")  # of _ARGUMENT, made safe
_CONSTANTS = re.compile(r"static const casadi_real (casadi_c\d+)\[(\d+)\] =\s*(\{[^}]*\});")
_FACTORS = re.compile(r"(casadi_real lt\[\d+\], d\[\d+\], w\[\d+\];)")  # too large for the stack of a thread
_SIGN = re.compile(r"casadi_real casadi_sign\(casadi_real x\) \{[^}]*\}")


def safe_for_lanes(code: str) -> str:
    """Replace what the operators of C cannot do with vectors; what is overlooked does not compile."""
    code = _BINARY.sub(lambda m: f"{m[1]}{_OPERATORS[m[3]]}({m[2]}, {m[4]})", code)
    code = _NOT.sub(r"\1is_not(\2)", code)
    code = _SELECT.sub(r"\1where_holds(\2, \3)", code)
    code = _LOOK_UP.sub(r"*rr = looked_up(\2, \1, *cr++);", code)
    code = _ARGUMENT.sub(r"\1 ? \2 : (lanes)(0.0);", code)
    code = _FACTORS.sub(r"static _Thread_local \1", code)
    code = _SIGN.sub("casadi_real casadi_sign(casadi_real x) { return lanes_sign(x); }", code)
    return _CONSTANTS.sub(_spread, code)


def _spread(constants: re.Match[str]) -> str:
    """Keep a table of constants as doubles and spread it over the lanes when the library is loaded."""
    name, size, values = constants.groups()
    return (
        f"static const double {name}_values[{size}] = {values};\nstatic lanes {name}[{size}];\n"
        f"__attribute__((constructor)) static void {name}_spread(void) {{\n"
        f"for (int i=0; i<{size}; i++) {name}[i] = {name}_values[i];\n}}"
    )

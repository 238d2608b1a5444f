"""Write the mathematics of a component: what CasADi writes for the native FMU, made fit for a flight processor.

No derivatives, casts that are checked, work space without holes, and a table of the constants with their checksums. What is
rewritten is recognised by patterns; code in which one is missing is refused, for CasADi's generator must have changed.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Sequence
from typing import Literal, NamedTuple

import casadi as ca
import numpy as np
from gossamer_models import StepModel
from gossamer_models.batch.code import internal_name
from numpy.typing import NDArray

from .c_code import INTERFACE
from .flight_slices import TABLES, Slices, call_code, table_code, tables

FloatBits = Literal[32, 64]
_MOST_WORDS = 1 << 16  # constants that are checked before every step; where there are more, a list of them in a step
_FUNCTIONS = (
    "exp",
    "expm1",
    "log",
    "log1p",
    "pow",
    "sqrt",
    "sin",
    "cos",
    "tan",
    "floor",
    "ceil",
    "fabs",
    "fmax",
    "fmin",
    "fmod",
    "tanh",
)

_DEFINED = re.compile(r"#define casadi_\w+ CASADI_PREFIX\(\w+\)\n")
_HELPER = re.compile(r"^(casadi_real|casadi_int|void) (casadi_\w+\()", re.MULTILINE)
_LIST = re.compile(r"static const (casadi_real|casadi_int) (casadi_\w+)\[(\d+)\] =\s*\{([^}]*)\};")
_NUMBER = re.compile(r"(?<![\w.])(\d+\.\d*(?:e[+-]?\d+)?)(?![\w.])")
_INDEX = re.compile(r"\((?:casadi_)?int\) ?(\*c[rs](?:\+\+)?|\w+\[\w+\]|w\d+\b|x\b)")
_LOW = re.compile(r"^  switch \(lookup_mode\) \{.*?default:\n *\{\n(.*?)      \}\n  \}\n", re.DOTALL | re.MULTILINE)
_FUNCTION = re.compile(r"/\* (\w+):[^\n]*\*/\nstatic int (casadi_f\d+)\(.*?\n\}\n", re.DOTALL)
_NOT = re.compile(r"\(! ([^()]+?) *\)")
_CONDITION = r"(\(\*c[rs]\+\+\)|[\w\[\]]+)"
_IF, _BOTH = re.compile(rf"\({_CONDITION}\?"), re.compile(rf"\({_CONDITION}(&&|\|\|){_CONDITION}\)")
_BEGIN = re.compile(r"^(static int casadi_f\d+\(.*\{)$", re.MULTILINE)
_PLACE = re.compile(r"\*w(\d+)=w\+(\d+)")
_CALL = re.compile(r"\b(casadi_f\d+)\([^()]*, iw, w, 0\)")


_AS_INDEX = (
    "/* A place in a list; -1, which is in none, for what is no number or too large. */",
    "static casadi_int casadi_index(casadi_real x) { return x > -1 && x < 1000000000 ? (casadi_int)x : -1; }",
    "",
)


class _List(NamedTuple):
    """A list of constants: its name in C, its bytes, and whether they are those of reals."""

    name: str
    content: bytes
    is_real: bool

    @property
    def words(self) -> NDArray[np.uint32]:
        return np.frombuffer(self.content, dtype="<u4")

    @property
    def line(self) -> str:
        folded = int(np.bitwise_xor.reduce(self.words))
        return f" {{{self.name}, {self.words.size}U, {int(self.is_real)}, 0x{folded:08x}U}},"


def mathematics(model: StepModel, bits: FloatBits, slices: Slices | None = None) -> tuple[str, str, dict[str, int]]:
    """Return what CasADi writes of init, step and slices, the table of its lists of constants, and sizes of work space."""
    parts = [] if slices is None else slices.all
    of_parts = [each.function for each in parts if each.function is not None]
    functions = (model.init, model.step if slices is None else slices.step, *of_parts)
    generator = ca.CodeGenerator("functions", {"with_header": False, "verbose": False, "indent": 1})
    for function in functions:
        generator.add(function)
    code = generator.dump()
    names = {each.name(): internal_name(code, each.name()) for each in functions}
    code = _HELPER.sub(r"static \1 \2", _DEFINED.sub("", INTERFACE.sub("", code)))
    code, size = _without_holes(code, functions)
    code = _INDEX.sub(r"casadi_index(\1)", _LOW.sub(r"  (void)lookup_mode; /* always 0 */\n\1", code))
    code = code.replace("= casadi_low(", "= (casadi_real)casadi_low(")
    code = _BEGIN.sub(r"\1\n (void)arg, (void)res, (void)iw, (void)w, (void)mem;", code)
    # numbers as conditions are conversions, of which clang warns
    code = _BOTH.sub(r"(\1 != 0.0 \2 \3 != 0.0)", _IF.sub(r"(\1 != 0.0 ? ", _NOT.sub(r"(\1 == 0.0)", code)))
    if bits == 32:
        code = _NUMBER.sub(lambda found: f"{_in_float(float(found[1]))!r}f", code)
    bodies = {found[2]: found[0] for found in _FUNCTION.finditer(code)}
    _check_rewritten(code, len(bodies))
    apart = {names["init"], *(names[each.name()] for each in of_parts)}
    read = _lists_in("".join(body for name, body in bodies.items() if name not in apart))
    of_each = [_lists_in(bodies[names[each.function.name()]]) if each.function else set[str]() for each in parts]
    if any(each.shape is not None and len(own) != 1 for each, own in zip(parts, of_each, strict=True)):
        msg = "CasADi wrote the constant of a product otherwise than as a list; its generator must have changed"
        raise RuntimeError(msg)
    later = set[str]().union(*of_each)
    of_step, of_slices, of_init = list[_List](), list[_List](), list[_List]()
    for kind, name, count, values in _LIST.findall(code):
        is_real = kind == "casadi_real"
        numbers = np.array(values.replace("f", "").split(","), dtype=f"<f{bits // 8}" if is_real else "<i4")
        if int(count) != numbers.size:
            msg = f"CasADi wrote {numbers.size} numbers in {name}[{count}]; its generator must have changed"
            raise RuntimeError(msg)
        of = of_step if name in read else of_slices if name in later else of_init
        of.append(_List(name, numbers.tobytes(), is_real))
    of_step.sort(key=lambda each: each.is_real)  # indices first
    every = [*([_List(name, b"", is_real=False) for name in TABLES] if slices else []), *of_step, *of_slices, *of_init]
    number_of = {each.name: k for k, each in enumerate(every)}
    of_tables = [] if slices is None else tables(slices, [sorted(number_of[name] for name in each) for each in of_each])
    for k, content in enumerate(of_tables):
        every[k] = every[k]._replace(content=content.tobytes())
    of_step = every[: len(of_tables) + len(of_step)]
    checksum = zlib.crc32(b"".join(each.content for each in every))
    indices = sum(not each.is_real for each in of_step)
    reals = max(1, len(of_step) - indices)  # where a step reads none, it checks the first of a slice
    code = _LIST.sub(lambda found: found[0].replace("static const", "static COMPONENT_CONST", 1), code)
    few = sum(each.words.size for each in of_step) <= _MOST_WORDS
    table = [
        *(table_code(of_tables) if slices else ()),
        f"#define COMPONENT_N_LISTS {len(every)}U",
        f"#define COMPONENT_N_USED_LISTS {len(of_step + of_slices)}U",
        f"#define COMPONENT_N_STEP_LISTS {indices + reals}U",
        f"#define COMPONENT_N_INDEX_LISTS {indices}U",
        f"#define COMPONENT_N_REAL_LISTS {reals}U",
        f"#define COMPONENT_LISTS_PER_STEP {reals if few else 1}U",
        f"#define COMPONENT_CONSTANTS_CRC 0x{checksum:08x}U",
        f"#define COMPONENT_INIT {names['init']}",
        f"#define COMPONENT_STEP {names['step']}",
        "/* those that a step reads first, indices before reals, then those of slices and of init alone */",
        "static const component_list COMPONENT_LISTS[COMPONENT_N_LISTS] = {",
        *(each.line for each in every),
        "};",
    ]
    if slices is not None:
        table += call_code([names[each.function.name()] if each.function and each.shape is None else None for each in parts])
        for each in parts:
            if each.function and each.shape is not None:  # a constant; what multiplies with it is in component.c
                code = code.replace(bodies[names[each.function.name()]], "")
    head = [
        "/* Written by CasADi from the model, as for its native FMU; see component.c. */",
        f"#define casadi_real {'float' if bits == 32 else 'double'}",
        "#define casadi_int int",
        "#define casadi_nan ((casadi_real)NAN)",
        "#define casadi_inf ((casadi_real)INFINITY)",
        *(f"#define {each} {each}f" for each in _FUNCTIONS if bits == 32),
        "#ifndef COMPONENT_CONST",
        "#define COMPONENT_CONST const /* a test of upsets lets them be written */",
        "#endif",
        "",
        *(_AS_INDEX if "casadi_index(" in code else ()),
    ]
    sizes = {
        "ARG": max(f.sz_arg() for f in functions),
        "RES": max(f.sz_res() for f in functions),
        "IW": max(1, *(f.sz_iw() for f in functions)),
        "W": max(1, size),
    }
    return "\n".join(head) + code, "\n".join(table), sizes


def _lists_in(code: str) -> set[str]:
    """Return the lists of constants that code reads."""
    return set(re.findall(r"\bcasadi_[cs]\d+\b", code))


def _check_rewritten(code: str, bodies: int) -> None:
    """Refuse code in which a cast to an index or a function was not recognised."""
    written = len(re.findall(r"^static int casadi_f\d+\([^;]*\{$", code, re.MULTILINE))
    if re.search(r"\((?:casadi_)?int\)", code) or bodies != written:
        msg = f"CasADi wrote a cast or a function that is not known ({bodies} of {written}); its generator must have changed"
        raise RuntimeError(msg)


def _in_float(value: float) -> float:
    """Return a number that stands in single precision for one that it cannot hold."""
    if value and abs(value) < 1e-37:
        return 1e-37
    return min(value, float(np.finfo(np.float32).max))


def _without_holes(code: str, functions: Sequence[ca.Function]) -> tuple[str, int]:
    """Let the columns of CasADi's work space follow each other; return its size, too.

    A function of CasADi's reserves a place for each of its values and declares those that it writes, ``*w05=w+19``; numbers,
    constants and arguments are used where they are. What lies before the first place serves the functions that are called.
    """
    known = {each.name(): each for f in functions for each in (*f.find_functions(), f)}
    new: dict[str, int] = {}

    def close(found: re.Match[str]) -> str:
        body = found[0]
        called = max((new[each] for each in _CALL.findall(body)), default=0)
        sizes = _places(known[found[1]]) if found[1] in known else []
        written = {int(k): int(begin) for k, begin in _PLACE.findall(body)}
        before = known[found[1]].sz_w() - sum(sizes) if sizes else 0
        if any(begin != before + sum(sizes[:k]) for k, begin in written.items()):
            msg = f"CasADi's function {found[2]} has another work space than it says; its generator must have changed"
            raise RuntimeError(msg)
        if not re.search(r"\bw[,)]", _CALL.sub("", body[body.index("{") :])):
            before = called
        begin = {k: before + sum(sizes[each] for each in written if each < k) for k in written}
        new[found[2]] = before + sum(sizes[k] for k in written)
        return _PLACE.sub(lambda place: f"*w{place[1]}=w+{begin[int(place[1])]}", body)

    code = _FUNCTION.sub(close, code)
    return code, max(new.values())


def _places(function: ca.Function) -> list[int]:
    """Return the number of elements of each value of a function in its work space."""
    sizes: dict[int, int] = {}
    for k in range(function.n_instructions() if function.is_a("MXFunction") else 0):
        places, kind = function.instruction_output(k), function.instruction_id(k)
        for i, place in enumerate(places if kind != ca.OP_OUTPUT else []):
            value = function.instruction_MX(k)
            size = (value.get_output(i) if kind == ca.OP_CALL or len(places) > 1 else value).nnz()
            sizes[place] = max(sizes.get(place, 0), size)
    return [sizes.get(place, 0) for place in range(max(sizes, default=-1) + 1)]

"""Cut what a detector computes at the end of a window into slices, one in each step after it, so that no step is long.

The step of a detector calls one function of several when a window ends. The graph of this is cut: products with a large
constant into parts of their sums, all else into functions of values that were computed before. The operations and their
order are those of the model, so are the bits.

Symbols: ``x`` state, ``u`` inputs, ``p`` parameters, ``h`` step [s], as of a step model.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import NamedTuple

import casadi as ca
import numpy as np
from gossamer_models import StepModel
from numpy.typing import NDArray

MOST = 8192  # multiplications of a part of a product
_LARGE = 1024  # numbers of a constant that is worth a part of its own
_COSTLY = {ca.OP_EXP: (ca.exp, 80), ca.OP_TANH: (ca.tanh, 120)}  # instructions of an element, about
_USUAL, _MULTIPLICATION = 6, 6  # of any other, of a term of a sum
_SPLIT = 400  # elements of a costly operation at once


class Value(NamedTuple):
    """Numbers that slices give each other: where they begin, how many they are, and where their checksum is."""

    place: int
    size: int
    fold: int


@dataclass(frozen=True, kw_only=True)
class Slice:
    """Work of one step, or of several where it has parts.

    Attributes
    ----------
    takes, gives : sequence of Value
        What the first slice takes, it copies; ``place`` of this is 0 to 3 for x, u, p and h.
    function : casadi.Function or None
        Of what it takes; gives what it gives. Of a product: gives its constant. None where nothing is computed.
    shape : tuple of int or None
        Of a product: rows, terms of each sum and columns.
    is_left : bool
        Whether the constant of a product is on its left.
    each, parts : int
        Terms, or columns where the constant is on the right, in a step; steps.
    """

    takes: Sequence[Value] = ()
    gives: Sequence[Value] = ()
    function: ca.Function | None = None
    shape: tuple[int, int, int] | None = None
    is_left: bool = False
    each: int = 0
    parts: int = 1


@dataclass(frozen=True, kw_only=True)
class Slices:
    """A step that begins to judge a window, and the slices that go on.

    Attributes
    ----------
    step : casadi.Function
        ``step(x, u, p, h, judged, is_judged) -> (x_next, y, window)``; ``window`` is -1 where none ends.
    windows : sequence of sequence of Slice
        Of each window; the first slice takes x, u, p and h, and is part of the step in which the window ends. The last one
        gives what the step takes as ``judged``, at place 0.
    size, folds : int
        Places of the values in between, and of their checksums.
    """

    step: ca.Function
    windows: Sequence[Sequence[Slice]]
    size: int
    folds: int

    @property
    def all(self) -> list[Slice]:
        """Those of the windows after each other."""
        return [each for window in self.windows for each in window]

    @property
    def count(self) -> int:
        """Parts of slices of a window, of all windows."""
        return sum(each.parts for each in self.windows[0])


def slices_of(model: StepModel) -> Slices | None:
    """Cut the step of a detector; None for other models."""
    if "window_length" not in model.names:
        return None
    arguments = dict(zip("xuph", model.step.mx_in(), strict=True))
    results = model.step.call(list(arguments.values()), True, False)
    (call,) = (n for n in _nodes(results) if n.is_call() and n.which_function().class_name() == "Switch")
    given = _before(call)
    names = [next(name for name, symbol in arguments.items() if _same(symbol, each)) for each in given[1:]]
    functions = {each.name(): each for each in call.which_function().find_functions(0)}
    (otherwise,) = functions["f_default"].call(given[1:], True, False)
    judged, is_judged = ca.MX.sym("judged", otherwise.shape), ca.MX.sym("is_judged")
    latest = ca.if_else(is_judged, judged, otherwise)
    step = ca.Function(
        "step", [*arguments.values(), judged, is_judged], [*(_with(latest, call, n) for n in results), given[0]]
    )
    cases = sorted((name for name in functions if name.startswith("f_case")), key=lambda name: int(name[6:]))
    windows = [_cut(functions[name], f"window{k}", ["xuph".index(each) for each in names]) for k, name in enumerate(cases)]
    count = max(sum(each.parts for each in window) for window in windows)
    for window in windows:
        if idle := count - sum(each.parts for each in window):
            window.insert(-1, Slice(parts=idle))
    values = [value for window in windows for each in window for value in each.gives]
    size, folds = max(v.place + v.size for v in values), 1 + max(v.fold for v in values)
    return Slices(step=step, windows=windows, size=size, folds=folds)


_KINDS = ("NOTHING", "FUNCTION", "LEFT", "RIGHT")
_FIELDS = (
    "kind",
    "parts",
    "each",
    "rows",
    "terms",
    "columns",
    "first_value",
    "takes",
    "gives",
    "first_list",
    "lists",
    "next",
)
TABLES = ("COMPONENT_WINDOWS", "COMPONENT_VALUES", "COMPONENT_SLICE_LISTS", "COMPONENT_PARTS")


def tables(slices: Slices, lists: Sequence[Sequence[int]]) -> list[NDArray[np.uint32]]:
    """Return what ``TABLES`` hold: numbers of 32 bits, a row for each item.

    Parameters
    ----------
    slices : Slices
        All of them.
    lists : sequence of sequence of int
        Numbers of the lists of constants that each reads.
    """
    rows, pool, numbers = list[tuple[int, ...]](), list[Value](), list[int]()
    ends = set(accumulate(map(len, slices.windows)))
    for k, (each, own) in enumerate(zip(slices.all, lists, strict=True)):
        kind = "NOTHING" if each.function is None else "FUNCTION"
        if each.shape is not None:
            kind = "LEFT" if each.is_left else "RIGHT"
        following = len(slices.all) if k + 1 in ends else k + 1
        values = (len(pool), len(each.takes), len(each.gives))
        size = (each.parts, each.each, *(each.shape or (0, 0, 0)))
        rows.append((_KINDS.index(kind), *size, *values, len(numbers), len(own), following))
        pool += [*each.takes, *each.gives]
        numbers += own
    return [np.array(each, dtype="<u4") for each in ([0, *sorted(ends)[:-1]], pool, numbers, rows)]


def table_code(contents: Sequence[NDArray[np.uint32]]) -> list[str]:
    """Return lines of C that declare the tables of slices."""
    structures = {
        "COMPONENT_VALUES": ("component_value", ("place", "size", "fold")),
        "COMPONENT_PARTS": ("component_part", _FIELDS),
    }
    lines = [
        *(f"#define COMPONENT_{kind} {k}U" for k, kind in enumerate(_KINDS)),
        f"#define COMPONENT_N_WINDOWS {len(contents[0])}U",
    ]
    for name, content in zip(TABLES, contents, strict=True):
        of, fields = structures.get(name, ("uint32_t", ()))
        if fields:
            lines += ["", "typedef struct {", *(f"  uint32_t {each};" for each in fields), f"}} {of};", ""]
        rows = [", ".join(f"{n}U" for n in np.atleast_1d(row)) for row in content]
        lines += [
            f"static COMPONENT_CONST {of} {name}[{len(content)}] = {{",
            *(f" {{{row}}}," if fields else f" {row}," for row in rows),
            "};",
        ]
    return lines


def call_code(functions: Sequence[str | None]) -> list[str]:
    """Return lines of C that call the function of a slice, by their names; None where there is none."""
    cases = [f"  case {k}U: failed = {name}(arg, res, iw, w, 0); break;" for k, name in enumerate(functions) if name]
    return [
        "static int component_call(uint32_t slice, const component_real **arg, component_real **res, int *iw,",
        "                          component_real *w) {",
        "  int failed = 1;",
        "  switch (slice) {",
        *cases,
        "  default: break;",
        "  }",
        "  return failed;",
        "}",
    ]


def _same(one: ca.MX, other: ca.MX) -> bool:
    return bool(one.__hash__() == other.__hash__())


def _with(latest: ca.MX, call: ca.MX, result: ca.MX) -> ca.MX:
    """Put something in the place of a call, which a result has unchanged among its parts."""
    if result.is_output() and _same(result.dep(0), call):
        return latest
    if result.op() == ca.OP_VERTCAT:
        return ca.vertcat(*(_with(latest, call, each) for each in _before(result)))
    if any(_same(node, call) for node in _nodes([result])):
        msg = f"a result computes with what its windows give: {result}. Let it be what they give."
        raise RuntimeError(msg)
    return result


def _before(node: ca.MX) -> list[ca.MX]:
    """Return what a value is computed from; an output of a node has what the node has."""
    of = node.dep(0) if node.is_output() else node
    return [of.dep(i) for i in range(of.n_dep())]


def _nodes(results: Iterable[ca.MX]) -> list[ca.MX]:
    """Return all nodes of expressions, each after those that it is computed from."""
    found: dict[int, ca.MX] = {}
    left = [(node, False) for node in results]
    while left:
        node, is_ready = left.pop()
        if is_ready:
            found.setdefault(node.__hash__(), node)
        elif node.__hash__() not in found:
            left.append((node, True))
            left += [(node.dep(i), False) for i in range(node.n_dep())]
    return list(found.values())


def _in_pieces(result: ca.MX) -> ca.MX:
    """Let costly operations take some elements at once."""
    while costly := [n for n in _nodes([result]) if n.op() in _COSTLY and n.numel() > _SPLIT]:
        node = costly[0]
        pieces = ca.vertsplit(ca.vec(node.dep(0)), [*range(0, node.numel(), _SPLIT), node.numel()])
        done = ca.vertcat(*map(_COSTLY[node.op()][0], pieces))
        (result,) = ca.graph_substitute([result], [node], [ca.reshape(done, node.shape)])
    return result


def _is_product(node: ca.MX) -> bool:
    """Tell whether a node is a product with a large constant, which begins at zero."""
    if node.op() != ca.OP_MTIMES:
        return False
    begin, left, right = _before(node)
    constant, other = (left, right) if left.is_constant() else (right, left)
    is_plain = constant.is_constant() and constant.is_dense() and other.is_dense() and not other.is_constant()
    is_plain = is_plain and not other.is_output()  # which would be a part of what was computed before
    return bool(is_plain and begin.is_zero() and constant.nnz() > _LARGE and _multiplications(node) > MOST // 2)


def _multiplications(node: ca.MX) -> int:
    _, left, right = _before(node)
    return int(left.nnz() * right.size2())


def _cost(node: ca.MX) -> int:
    """Return the instructions of a node, about."""
    if node.op() == ca.OP_MTIMES:
        return _MULTIPLICATION * _multiplications(node)
    return int(node.numel()) * (_COSTLY[node.op()][1] if node.op() in _COSTLY else _USUAL)


def _cut(function: ca.Function, name: str, arguments: Sequence[int]) -> list[Slice]:
    """Return the slices of what a window says; of its arguments the numbers among x, u, p and h are given."""
    symbols = function.mx_in()
    result = _in_pieces(function.call(symbols, True, False)[0])
    values = [n for n in _nodes([result]) if not (n.is_output() or n.is_constant() or n.is_symbolic() or n.n_out() > 1)]
    groups, cost = [symbols, list[ca.MX]()], 0
    for node in values:
        cost += _cost(node)
        if _is_product(node):
            groups += [[node], []]
            cost = 0
        elif cost > _MULTIPLICATION * MOST:
            groups.append([node])
            cost = _cost(node)
        else:
            groups[-1].append(node)
    groups = [group for group in groups if group]
    made = {n.__hash__(): k for k, group in enumerate(groups) for n in group}
    taken = [_taken(group, made, k) for k, group in enumerate(groups)]
    last_use = {n.__hash__(): k for k, nodes in enumerate(taken) for n in nodes} | {result.__hash__(): len(groups)}
    given = [[n for n in group if last_use.get(n.__hash__(), -1) > k] for k, group in enumerate(groups)]
    places = _places(given, last_use, result)
    copied = [
        (Value(number, n.nnz(), 0), places[n.__hash__()])
        for number, n in zip(arguments, symbols, strict=True)
        if n.__hash__() in places
    ]
    slices = [Slice(takes=[one for one, _ in copied], gives=[other for _, other in copied])]
    for k, group in enumerate(groups[1:], start=1):
        takes, gives = ([places[n.__hash__()] for n in nodes] for nodes in (taken[k], given[k]))
        label = f"{name}_{k}"
        if _is_product(group[0]):
            _, left, right = _before(group[0])
            is_left = left.is_constant()
            constant = ca.Function(label, [], [left if is_left else right])
            shape, sums = (left.size1(), left.size2(), right.size2()), left.size2() if is_left else right.size2()
            each = max(MOST * sums // _multiplications(group[0]), 1)
            part = {"shape": shape, "is_left": is_left, "each": each, "parts": -(-sums // each)}
            slices.append(Slice(takes=takes, gives=gives, function=constant, **part))
        else:
            inputs = [n if n.is_symbolic() else ca.MX.sym("v", n.sparsity()) for n in taken[k]]
            outputs = ca.graph_substitute(given[k], taken[k], inputs)
            slices.append(Slice(takes=takes, gives=gives, function=ca.Function(label, inputs, outputs)))
    return slices


def _taken(group: Sequence[ca.MX], made: dict[int, int], k: int) -> list[ca.MX]:
    """Return the values of earlier groups that a group takes."""
    found: dict[int, ca.MX] = {}
    left, seen = list(group), set[int]()
    while left:
        node = left.pop()
        if node.__hash__() in seen:
            continue
        seen.add(node.__hash__())
        if made.get(node.__hash__(), k) < k:
            found[node.__hash__()] = node
        elif not node.is_symbolic():
            left += _before(node)
    return list(found.values())


def _places(given: Sequence[Sequence[ca.MX]], last_use: dict[int, int], result: ca.MX) -> dict[int, Value]:
    """Return the place of each value, which no other has from the slice that gives it to the last that takes it.

    The result has place 0, which nothing else has.
    """
    found, first = dict[int, Value](), result.nnz()
    held: list[tuple[Value, int]] = []  # with the last slice that takes it
    for k, nodes in enumerate(given):
        held = sorted(each for each in held if each[1] >= k)
        for node in nodes:
            begin, count = (0 if _same(node, result) else first), node.nnz()
            for value, _ in held:
                if begin + count <= value.place:
                    break
                begin = max(begin, value.place + value.size)
            fold = 0 if begin == 0 else next(i for i in range(1, len(held) + 2) if i not in {v.fold for v, _ in held})
            found[node.__hash__()] = Value(begin, count, fold)
            held = sorted([*held, (found[node.__hash__()], last_use[node.__hash__()])])
    return found

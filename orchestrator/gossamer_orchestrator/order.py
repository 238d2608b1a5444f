"""The order in which components step, and circles among them that no order can resolve."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING

from .fmu import FmuFile
from .graph import find_cycle
from .names import suggest
from .scenario import Scenario
from .source import Problems

if TYPE_CHECKING:
    from .plan import Wire


def find_loop(files: Mapping[str, FmuFile], wires: Mapping[str, list[Wire]]) -> list[tuple[str, str]]:
    """Find a circle of signals in which every value depends on itself at the same instant."""
    signals: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for receiver, arriving in wires.items():
        for wire in arriving:
            signals.setdefault((wire.sender, wire.origin), []).append((receiver, wire.target))
    for name, fmu in files.items():
        for output, inputs in fmu.feedthrough().items():
            for source in inputs:
                signals.setdefault((name, source), []).append((name, output))
    return find_cycle(signals)


def refuse_loop(loop: list[tuple[str, str]], scenario: Scenario, problems: Problems) -> None:
    """Report an algebraic loop with its path, at the first of its connections."""
    path = [".".join(node) for node in loop]
    edges = list(pairwise(path))
    first = next(i for i, c in enumerate(scenario.connections) if (c.origin, c.target) in edges)
    problems.add(
        ("connections", first),
        f"algebraic loop: {' -> '.join(path)}. Cut one of these connections, or declare in an FMU that its output does not "
        "depend on that input at the same instant.",
    )


def check_order(
    scenario: Scenario, feeds: Mapping[str, list[str]], problems: Problems, *, known_loop: bool
) -> list[str] | None:
    """Return the stepping order that the scenario states, if it states one."""
    order = scenario.order
    if order is None:
        cycle = [] if known_loop else find_cycle(feeds)
        if cycle and scenario.master == "gauss-seidel":
            problems.add(
                ("master",),
                f"components feed each other in a circle: {' -> '.join(cycle)}. Name them in 'order'; "
                "the connection from a later to an earlier one delays by one step.",
            )
        return None
    if scenario.master == "jacobi":
        problems.add(("order",), "'order' has no meaning for master = \"jacobi\". Remove it.")
    for name in order:
        if name not in feeds:
            problems.add(("order",), f"'order' names a component {name!r} that is not there. {suggest(name, feeds)}")
    if sorted(order) != sorted(feeds):
        missing = [name for name in feeds if name not in order]
        what = f"; missing: {', '.join(missing)}" if missing else ""
        problems.add(("order",), f"'order' must name every component once{what}.")
    return order

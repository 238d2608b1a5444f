"""The graph of a scenario: who feeds whom, in which order to step, and loops that no order can resolve."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from graphlib import CycleError, TopologicalSorter
from typing import TypeVar

Node = TypeVar("Node", bound=Hashable)


def find_cycle(edges: Mapping[Node, Iterable[Node]]) -> list[Node]:
    """Find a cycle of a directed graph.

    Parameters
    ----------
    edges : mapping of node to its successors
        Nodes that only appear as successors need no entry.

    Returns
    -------
    list of node
        The nodes along a cycle, the first one repeated at the end; empty if there is none.
    """
    try:
        TopologicalSorter(edges).prepare()
    except CycleError as error:
        cycle: list[Node] = error.args[1]
        return cycle[::-1]  # the sorter takes successors for predecessors
    return []


def sort_components(names: Iterable[str], edges: Mapping[str, Iterable[str]]) -> list[str]:
    """Order components so that each stands after those that feed it; ties keep the order of ``names``.

    Within a cycle, which must not be an algebraic loop, the component written first goes first.
    """
    waiting = list(names)
    order: list[str] = []
    while waiting:
        fed = {target for name in waiting for target in edges.get(name, ()) if target != name}
        ready = [name for name in waiting if name not in fed] or waiting[:1]
        order += ready[:1]
        waiting.remove(ready[0])
    return order

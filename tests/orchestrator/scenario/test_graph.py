"""Cycles and orders: of random graphs, against NumPy's matrix powers, and of scenarios."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from gossamer_orchestrator import ScenarioError, make_plan, parse_scenario
from gossamer_orchestrator.scenario.graph import find_cycle, sort_components
from hypothesis import given
from hypothesis import strategies as st

NODES = "abcdef"
graphs = st.dictionaries(st.sampled_from(NODES), st.lists(st.sampled_from(NODES), unique=True))


def has_cycle(edges: dict[str, list[str]]) -> bool:
    A = np.zeros((6, 6), dtype=int)
    for node, successors in edges.items():
        for successor in successors:
            A[NODES.index(node), NODES.index(successor)] = 1
    return any(np.trace(np.linalg.matrix_power(A, k)) > 0 for k in range(1, 7))


@given(graphs)
def test_a_cycle_is_found_exactly_if_there_is_one(edges):
    cycle = find_cycle(edges)
    assert bool(cycle) == has_cycle(edges)
    if cycle:
        assert cycle[0] == cycle[-1]
        assert all(b in edges[a] for a, b in pairwise(cycle))


@given(graphs)
def test_an_order_holds_every_node_once_and_respects_the_edges_of_an_acyclic_graph(edges):
    order = sort_components(NODES, edges)
    assert sorted(order) == list(NODES)
    if not has_cycle(edges):
        assert all(order.index(a) < order.index(b) for a, successors in edges.items() for b in successors)


RING = """
step = 0.5
stop = 2.0
[components]
a = {{ fmu = "{fmu}"{inputs} }}
b = {{ fmu = "gain", inputs = {{ "offset[*]" = 0.0 }} }}
[[connections]]
from = "a.{output}"
to = "b.u"
[[connections]]
from = "b.y"
to = "a.u"
"""


def test_an_algebraic_loop_is_refused_with_its_path(fmus):
    text = RING.format(fmu="gain", output="y", inputs=', inputs = { "offset[*]" = 0.0 }')
    for master in ("", 'master = "jacobi"\n'):
        with pytest.raises(
            ScenarioError, match=r":\d+: algebraic loop: a.y -> b.u -> b.y -> a.u -> a.y. Cut one[^\n]*$"
        ):
            make_plan(parse_scenario(master + text), fmus)


def test_a_circle_without_feedthrough_needs_an_order(fmus):
    text = RING.format(fmu="delay", output="last_u", inputs="")
    with pytest.raises(
        ScenarioError, match=r"components feed each other in a circle: a -> b -> a. Name them in 'order'"
    ):
        make_plan(parse_scenario(text), fmus)

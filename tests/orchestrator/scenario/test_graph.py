"""Cycles and orders: of random graphs, against NumPy's matrix powers, and of scenarios."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from gossamer_orchestrator import make_plan, parse_scenario, run_scenario
from gossamer_orchestrator.scenario.connections import find_cycle, sort_components
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


def test_a_component_behind_a_cycle_stands_after_it():
    """c takes from a cycle of a and b, which is not to delay what c gets."""
    assert sort_components("cab", {"a": ["b", "c"], "b": ["a", "c"]}) == ["a", "b", "c"]
    assert sort_components("dcab", {"a": ["b"], "b": ["a", "c"], "c": ["d"], "d": ["c"]}) == ["a", "b", "d", "c"]


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


def test_under_gauss_seidel_a_loop_is_cut_by_a_delay_and_it_is_said_where(fmus, caplog):
    text = RING.format(fmu="gain", output="y", inputs=', inputs = { "offset[*]" = 0.0 }')
    make_plan(parse_scenario(text), fmus)
    assert [record.getMessage() for record in caplog.records] == [
        "scenario:10: algebraic loop a.y -> b.u -> b.y -> a.u -> a.y: the connection b.y -> a.u delays by one step. "
        "State another 'order', a smaller 'step', or a group"
    ]


def test_a_circle_without_feedthrough_delays_too_unless_the_order_is_stated(fmus, caplog):
    text = RING.format(fmu="delay", output="last_u", inputs="")
    make_plan(parse_scenario(text), fmus)
    assert "scenario:10: components feed each other: the connection b.y -> a.u delays by one step" in caplog.text
    caplog.clear()
    make_plan(parse_scenario('order = ["b", "a"]\n' + text), fmus)
    assert caplog.text == ""


def test_jacobi_refuses_no_loop_and_warns_of_none(fmus, caplog):
    """a = 2 b + 1 and b = a / 4, each of the last step: they tend to 2 and 0.5, twice as close after two steps."""
    text = RING.format(fmu="gain", output="y", inputs=', parameters = { factor = 2.0 }, inputs = { "offset[*]" = 0.5 }')
    text = text.replace('b = { fmu = "gain"', 'b = { fmu = "gain", parameters = { factor = 0.25 }').replace(
        "2.0\n[", "20.0\n["
    )
    data = run_scenario(parse_scenario('master = "jacobi"\n' + text), fmus)
    assert caplog.text == ""
    assert data["a.y"].values[-1] == pytest.approx(2.0, abs=1e-5)
    assert data["b.y"].values[-1] == pytest.approx(0.5, abs=1e-5)
    error = abs(data["a.y"].values[3:21:2] - 2.0)
    assert error[1:] / error[:-1] == pytest.approx(0.5)

"""What a run would do: components, connections and sizes, as another process can read it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..results.columns import group, plan_columns
from ..scenario.plan import ComponentPlan, Plan
from ..scenario.schema import Connection


@dataclass(frozen=True, kw_only=True)
class Outline:
    """A run that can start.

    Attributes
    ----------
    start, stop, step : float
        First and last time, and communication step [s].
    master : {"gauss-seidel", "jacobi"}
        How the components are stepped.
    components : list of dict
        In stepping order: ``component``, ``fmu``, ``fmi``, ``every``, and how many inputs are ``connected``.
    connections : list of dict
        One per scalar: ``from`` and ``to`` with their units, ``from_unit`` and ``to_unit``; ``gain`` and ``bias`` where the
        scenario states them or units are converted.
    variables, scalars, points : int
        How many variables are recorded, arrays whole as results hold them; how many scalars these are, each element of an
        array one; and at how many instants at least.
    warnings : list of str
        What the run would warn of before its first step.
    """

    start: float
    stop: float
    step: float
    master: str
    components: list[dict[str, Any]]
    connections: list[dict[str, Any]]
    variables: int
    scalars: int
    points: int
    warnings: list[str] = field(default_factory=list)


def outline(plan: Plan) -> Outline:
    """Say what a run would do."""
    scenario = plan.scenario
    return Outline(
        start=scenario.start,
        stop=scenario.seconds(scenario.ticks),
        step=scenario.step,
        master=scenario.master,
        components=[_component(each) for each in plan.components],
        connections=[_connection(each, plan) for each in plan.connections],
        variables=len(group(plan_columns(plan))[0]),
        scalars=len(plan.columns),
        points=scenario.ticks // scenario.record.every + 1,
    )


def _component(planned: ComponentPlan) -> dict[str, Any]:
    return {
        "component": planned.name,
        "fmu": planned.fmu.path.name,
        "fmi": planned.fmu.description.fmiVersion,
        "every": planned.every,
        "connected": len(planned.connections),
    }


def _connection(wired: Connection, plan: Plan) -> dict[str, Any]:
    return {
        "from": wired.origin,
        "from_unit": plan.component(wired.sender).fmu.unit(wired.output),
        "to": wired.target,
        "to_unit": plan.component(wired.receiver).fmu.unit(wired.input),
        "gain": wired.gain,
        "bias": wired.bias,
    }

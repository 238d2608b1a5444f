"""Run a scenario in the process of the test."""

from __future__ import annotations

from pathlib import Path

import xarray as xr
from gossamer_orchestrator import Recorder, Scenario, Simulation, make_plan
from gossamer_orchestrator.results.dataset import make_dataset


def simulate(scenario: Scenario, fmus: Path) -> xr.Dataset:
    """Return what a run records."""
    plan = make_plan(scenario, fmus)
    recorder = Recorder(plan)
    with Simulation(plan) as simulation:
        simulation.run([recorder])
    return make_dataset(plan, recorder.time, recorder.table, divided_steps=simulation.divided)

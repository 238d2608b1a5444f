"""Co-simulation of FMUs: scenarios, master, results.

``__init__.pyi`` says the same to type checkers.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOMES = {
    # from a scenario to results
    "scenario.schema": ("Scenario",),
    "scenario.load": ("load_scenario", "parse_scenario"),
    "run.runner": ("run_scenario",),
    "results.files": ("load_results", "save_results"),
    # to and from other tools
    "exchange.ssp.writer": ("export_ssp",),
    "exchange.ssp.reader": ("open_ssp",),
    "exchange.container": ("build_container",),
    # step by step
    "fmi.file": ("FmuFile",),
    "scenario.plan": ("Plan", "make_plan"),
    "run.master": ("Simulation", "Observer"),
    "run.recorder": ("Recorder",),
    "run.progress": ("ProgressBar",),
    # what the detector found
    "results.judgements": ("Judgement", "judge"),
    # errors
    "errors": ("OrchestratorError", "ScenarioError", "FmuError", "SimulationError", "ResultsError"),
}

__all__ = [name for names in _HOMES.values() for name in names]


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Import a public name when it is first used, so that ``gossamer --help`` loads neither FMPy nor xarray."""
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f".{home}", __name__), name)
    msg = f"module {__name__!r} has no attribute {name!r}"
    raise AttributeError(msg)

"""Co-simulation of FMUs: scenarios, master, results."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .errors import FmuError, OrchestratorError, ResultsError, ScenarioError, SimulationError
    from .exchange.container import build_container
    from .exchange.ssp.reader import open_ssp
    from .exchange.ssp.writer import export_ssp
    from .fmi.file import FmuFile
    from .results.files import load_results, save_results
    from .results.judgements import Judgement, judge
    from .run.master import Observer, Simulation
    from .run.progress import ProgressBar
    from .run.recorder import Recorder
    from .run.runner import run_scenario
    from .scenario.load import load_scenario, parse_scenario
    from .scenario.plan import Plan, make_plan
    from .scenario.schema import Scenario

__all__ = [
    # from a scenario to results
    "Scenario",
    "load_scenario",
    "parse_scenario",
    "run_scenario",
    "load_results",
    "save_results",
    # to and from other tools
    "export_ssp",
    "open_ssp",
    "build_container",
    # step by step
    "FmuFile",
    "Plan",
    "make_plan",
    "Simulation",
    "Observer",
    "Recorder",
    "ProgressBar",
    # what the detector found
    "Judgement",
    "judge",
    # errors
    "OrchestratorError",
    "ScenarioError",
    "FmuError",
    "SimulationError",
    "ResultsError",
]

_HOMES = {
    "errors": ("OrchestratorError", "ScenarioError", "FmuError", "SimulationError", "ResultsError"),
    "exchange.container": ("build_container",),
    "exchange.ssp.reader": ("open_ssp",),
    "exchange.ssp.writer": ("export_ssp",),
    "fmi.file": ("FmuFile",),
    "results.files": ("load_results", "save_results"),
    "results.judgements": ("Judgement", "judge"),
    "run.master": ("Observer", "Simulation"),
    "run.progress": ("ProgressBar",),
    "run.recorder": ("Recorder",),
    "run.runner": ("run_scenario",),
    "scenario.load": ("load_scenario", "parse_scenario"),
    "scenario.plan": ("Plan", "make_plan"),
    "scenario.schema": ("Scenario",),
}


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Import a public name when it is first used, so that ``gossamer --help`` loads neither FMPy nor xarray."""
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f".{home}", __name__), name)
    msg = f"module {__name__!r} has no attribute {name!r}"
    raise AttributeError(msg)

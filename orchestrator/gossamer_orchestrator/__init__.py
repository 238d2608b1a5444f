"""Co-simulation of FMUs: scenarios, master, results."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .container import build_container
    from .errors import FmuError, OrchestratorError, ResultsError, ScenarioError, SimulationError
    from .fmu import FmuFile
    from .master import Observer, Simulation
    from .plan import Plan, make_plan
    from .progress import ProgressBar
    from .recorder import Recorder
    from .report import Judgement, judge
    from .results import load_results, save_results
    from .run import run_scenario
    from .scenario import Scenario, load_scenario, parse_scenario
    from .ssp import export_ssp
    from .ssp_reader import open_ssp

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
    "container": ("build_container",),
    "errors": ("OrchestratorError", "ScenarioError", "FmuError", "SimulationError", "ResultsError"),
    "fmu": ("FmuFile",),
    "master": ("Observer", "Simulation"),
    "plan": ("Plan", "make_plan"),
    "progress": ("ProgressBar",),
    "recorder": ("Recorder",),
    "report": ("Judgement", "judge"),
    "results": ("load_results", "save_results"),
    "run": ("run_scenario",),
    "scenario": ("Scenario", "load_scenario", "parse_scenario"),
    "ssp": ("export_ssp",),
    "ssp_reader": ("open_ssp",),
}


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Import a public name when it is first used, so that ``gossamer --help`` loads neither FMPy nor xarray."""
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f".{home}", __name__), name)
    msg = f"module {__name__!r} has no attribute {name!r}"
    raise AttributeError(msg)

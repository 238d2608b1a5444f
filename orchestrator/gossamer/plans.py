"""What detectors are trained and judged on: the campaign of a file, a scenario, a setup, or of what a detector carries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from gossamer_files.options import option
from gossamer_orchestrator.errors import OrchestratorError, ScenarioError
from gossamer_orchestrator.scenario.source import Source, find_scenario, parse_toml, read_text, shipped_scenarios

from .arguments import AnyPath, Values, assigned
from .options import PlanOptions
from .records import numbers_by_name
from .working import need_setup

if TYPE_CHECKING:
    from gossamer_models.campaign import CampaignPlan, Mesh

NOMINAL = "detector_nominal"
WINDOW = 0.2532  # [s] of the shipped detectors
DRIFT = 2  # steps that cover how the phase of the load drifts from window to window
EXAMPLE = "for instance pressure_amplitude=100"


def given(plan: Mapping[str, object]) -> bool:
    """Tell whether something is said of what is simulated."""
    return any(value is not None for value in plan.values())


def planned(source: AnyPath | None, window: float | None, **plan: Unpack[PlanOptions]) -> tuple[CampaignPlan, Source, str]:
    """Return the campaign of a file, a scenario or a setup, the text that its mistakes are in, and its name."""
    from gossamer_models.campaign import Distribution, MeasurementNoise, Mesh, campaign_of_setup
    from gossamer_models.campaign.defaults import CASES, NOISE
    from gossamer_models.twin import read_loads

    from .descriptions import load_campaign, setup_of

    setup, cases, noise = plan.get("setup"), plan.get("cases"), plan.get("noise")
    constants = numbers_by_name(assigned(plan.get("set")), EXAMPLE)
    run = source is not None and is_scenario(str(source))
    if setup is not None:
        file = find_scenario(str(setup), "membrane")
        if source is not None and not run:
            msg = f"{source} says what is simulated, and so does {option('setup')}. Leave one of them out."
            raise OrchestratorError(msg)
        membrane = Mesh(setup=setup_of(file, plan.get("mesh")))
        if (load := plan.get("load")) is not None:
            membrane = replace(membrane, load=read_loads(Path(load), membrane.structure))
        if run:
            found, length = membrane_of(find_scenario(str(source)), membrane)
            membrane, window = found, window or length
        membrane = replace(membrane, parameters={**membrane.parameters, **constants})
        wanted = campaign_of_setup(
            membrane, cases=CASES if cases is None else cases, noise=NOISE if noise is None else noise, window=window
        )
        return wanted, Source(file.name, ""), file.stem
    need_setup(mesh=plan.get("mesh"), load=plan.get("load"))
    file = find_scenario(str(source or NOMINAL), "scenario" if run else "campaign")
    wanted, text = load_campaign(find_scenario(NOMINAL, "campaign") if run else file)
    if run:
        membrane, length = membrane_of(file, wanted.membrane)
        window = window or length or WINDOW
        steps = 3 * 4 * max(round(window / wanted.step) // 4, 1) + DRIFT
        wanted = replace(wanted, membrane=membrane, stop=steps * wanted.step, window=window)
    wanted = replace(
        wanted,
        cases=wanted.cases if cases is None else cases,
        membrane=replace(wanted.membrane, parameters={**wanted.membrane.parameters, **constants}),
        noise=wanted.noise if noise is None else MeasurementNoise(strain=Distribution(normal=noise)),
    )
    return wanted, text, file.stem


def is_scenario(source: str) -> bool:
    """Tell a scenario, which has components, from a campaign, by content or by the name of a shipped one."""
    if not Path(source).is_file():
        return source in shipped_scenarios() and source not in shipped_scenarios("campaign")
    return "components" in parse_toml(read_text(Path(source), "scenario"), source, "scenario")


def membrane_of(file: Path, mesh: Mesh) -> tuple[Mesh, float | None]:
    """Return a membrane with the parameters and constant inputs of a scenario's, and the length of its windows [s]."""
    from fnmatch import fnmatchcase

    from gossamer_orchestrator import load_scenario

    scenario = load_scenario(file)
    found = [c for c in scenario.components.values() if Path(c.fmu).stem == "membrane"]
    fed = {c.target.partition(".")[2].partition("[")[0] for c in scenario.connections}
    loads = {name.partition("[")[0] for name, row in mesh.settable.items() if row.causality == "input"}
    if len(found) != 1 or (fed & loads and mesh.load is None):
        msg = (
            f"{file.name} does not hold one membrane under its built-in pressure, so there is no campaign for it. Write a "
            f"campaign file, or name its setup and a table of its loads with {option('setup')} and {option('load')}."
        )
        raise ScenarioError(msg)
    constants: dict[str, float] = {}
    for pattern, value in {**found[0].parameters, **found[0].inputs}.items():
        if isinstance(value, int | float) and not pattern.startswith("damage"):
            names = [name for name in mesh.settable if fnmatchcase(name, pattern.replace("[", "[[]"))]
            constants |= dict.fromkeys(names or [pattern], float(value))
    detectors = [c for c in scenario.components.values() if Path(c.fmu).stem == "detector"]
    lengths = [c.parameters.get("window_length") for c in detectors]
    length = next((float(value) for value in lengths if isinstance(value, int | float)), None)
    return replace(mesh, parameters=constants), length


def judged_on(
    artifacts: Sequence[Path], setup: AnyPath | None, mesh: AnyPath | None, constants: Values | None
) -> CampaignPlan | None:
    """Return what detectors are judged on, with windows, steps and noise of the first; None for the thesis' square.

    Parameters
    ----------
    artifacts : sequence of Path
        Of detectors.
    setup, mesh : path or None
        Membrane in place of the one that the first carries.
    constants : mapping of str to float or None
        Parameters and constant inputs in place of those of its training.

    Raises
    ------
    OrchestratorError
        There is a setup and no detector for it, or there are constants and no setup.
    """
    from gossamer_models.campaign import Mesh, campaign_of_setup
    from gossamer_models.detector import PosteriorArtifact, read_detector
    from gossamer_models.membrane import read_structure

    from .descriptions import setup_of

    if setup is not None and not artifacts:
        msg = f"no detector that ships is trained for a setup. Train one, and name its file with {option('artifact')}."
        raise OrchestratorError(msg)
    trained = read_detector(artifacts[0]) if artifacts else PosteriorArtifact.default()
    if setup is not None:
        membrane = Mesh(setup=setup_of(setup, mesh))
    else:
        need_setup(mesh=mesh, set=None if trained.structure else constants or None)
        if not trained.structure:
            return None
        membrane = Mesh(setup=read_structure(trained.structure).setup, carried=trained.structure)
    if not isinstance(trained, PosteriorArtifact):
        msg = f"{artifacts[0]} is a detector of the thesis, for its square alone. Leave out {option('setup')}."
        raise OrchestratorError(msg)
    trained.require_structure(membrane.structure, str(artifacts[0]))
    values = trained.parameters | numbers_by_name(assigned(constants), EXAMPLE)
    membrane = replace(membrane, parameters=values, load=trained.load)
    plan = campaign_of_setup(membrane, cases=1, noise=trained.noise, window=trained.window_length)
    return replace(plan, step=trained.sampling_step, stop=trained.samples * trained.sampling_step)

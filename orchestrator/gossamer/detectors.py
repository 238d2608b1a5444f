"""Detectors of damage: simulate for them, train them, judge them."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack

from gossamer_files.options import option
from gossamer_files.tables import TableText
from gossamer_orchestrator.errors import OrchestratorError, ScenarioError

from .arguments import Address, AnyPath, Count, File, Folder, Seconds, assigned, command
from .options import PlanOptions
from .records import numbers_by_name
from .results import Saved, by_label
from .terminal import progress_bar
from .writing import json_file, keep_inputs, save_page

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_models.campaign import CampaignPlan, Mesh, Summary
    from gossamer_models.detector import DetectorArtifact, PosteriorArtifact
    from gossamer_orchestrator.scenario.source import Source

Method = Literal["neuro-fuzzy", "perceptron", "thesis"]
NOMINAL = "detector_nominal"
WINDOW = 0.2532  # [s] of the shipped detectors
DRIFT = 2  # steps that cover how the phase of the load drifts from window to window

logger = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, repr=False)
class Campaign(Saved):
    """Many simulations.

    Attributes
    ----------
    files : list of Path
        The store, and its page if it could be written.
    title : str
        Of the campaign.
    summary : gossamer_models.campaign.Summary
        How many cases there are, how many of them this call simulated, how many failed, and the time it took [s].
    data : xarray.Dataset
        Damage by ``case`` and ``zone``, what else was drawn by ``case``, histories over ``time`` [s]; it stays on the disk
        until it is used.
    """

    title: str
    summary: Summary
    data: xr.Dataset

    @property
    def sentence(self) -> str:
        """How many cases there are."""
        return f"{self.summary.cases} cases, {self.summary.simulated} of them simulated now."

    def doubts(self) -> list[str]:
        """Return how many cases broke."""
        from gossamer_orchestrator.words import counted

        failed = counted(self.summary.failed, "case")
        text = f"{failed} broke: 'failed' is 1 there, and the histories are not a number."
        return [text] if self.summary.failed else []

    def more(self) -> list[str]:
        """Return how many cases broke, and where the store is."""
        return [*self.doubts(), f"The store is {self}."]

    @property
    def size(self) -> int:
        """Size of the store [byte]."""
        return sum(each.stat().st_size for each in self.path.rglob("*") if each.is_file())

    def tables(self) -> list[TableText]:
        """Return what was simulated."""
        s = self.summary
        head = ("cases", "of them now", "failed", "seconds", "cases per second", "size [MB]")
        cells = (s.cases, s.simulated, s.failed, f"{s.seconds:.1f}", f"{s.simulated / s.seconds:.0f}")
        return [TableText(head, [(*map(str, cells), f"{self.size / 1e6:.1f}")], self.title)]

    def to_json(self) -> dict[str, Any]:
        """Return what was simulated."""
        s = self.summary
        found = {"cases": s.cases, "simulated": s.simulated, "failed": s.failed, "wall_time_s": s.seconds}
        return {"store": self.path, "page": self.page, **found, "size_bytes": self.size}


@command
def campaign(
    campaign: AnyPath | None = None,
    *,
    out: Folder | None = None,
    workers: Count | None = None,
    scheduler: Address | None = None,
    **plan: Unpack[PlanOptions],
) -> Campaign:
    """Simulate the cases of a campaign: random damage, load, material and sensors.

    Called again, it goes on after an interruption: finished chunks are kept, and the numbers depend on the file alone.
    Writes the store, and report.html, the page of the campaign.

    Parameters
    ----------
    campaign
        A campaign file, or the name of a shipped campaign; not needed with a setup.
    out
        Folder of the store; out/campaigns/NAME.zarr by default.
    workers
        Processes; all cores by default.
    scheduler
        Run on the Dask cluster of this scheduler, tcp://host:8786.
    **plan
        What is simulated, see ``PlanOptions``.

    Returns
    -------
    Campaign
        What was drawn, and the histories; a path of the store; displayed in a notebook.

    Examples
    --------
    >>> gossamer.train(gossamer.campaign("training"))

    On the command line::

        gossamer campaign training

        gossamer campaign my_campaign.toml --out out/mine.zarr --scheduler tcp://192.168.0.5:8786

        gossamer campaign --setup reflector --cases 200
    """
    from gossamer_models.campaign import read_campaign, run_campaign

    from .descriptions import locating
    from .pages.campaign import campaign_page

    if out is not None:
        keep_inputs([campaign, plan.get("setup"), plan.get("mesh")], [Path(out)])
    wanted, source, name = _planned(campaign, None, **plan)
    store = Path("out/campaigns") / f"{name}.zarr" if out is None else Path(out)
    bar = progress_bar(name)
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # a lost scheduler is one sentence here
    try:
        with locating(source), bar:
            bar.update(text="compiling,")
            summary = run_campaign(
                wanted,
                store,
                workers=workers,
                scheduler=scheduler,
                source=source.text,
                progress=lambda done, total: bar.update(done, total, f"{done} of {total} cases,"),
            )
    except KeyboardInterrupt:
        msg = "Interrupted; finished chunks are kept. Run the same command again to go on."
        raise KeyboardInterrupt(msg) from None
    title = wanted.title or name
    # not inside the store, where programs that read Zarr would warn of it
    folder = store.with_suffix("") if store.suffix else store.with_name(f"{store.name}_page")
    pages = save_page(lambda: campaign_page(title, read_campaign(store), summary), folder)
    return Campaign(files=[store, *pages], title=title, summary=summary, data=read_campaign(store))


@dataclass(frozen=True, kw_only=True, repr=False)
class TrainedDetector(Saved):
    """A detector that was trained.

    Attributes
    ----------
    files : list of Path
        Its artifact, and its page if it could be written.
    artifact : gossamer_models.detector.PosteriorArtifact or DetectorArtifact
        What was trained, and over which ranges; the latter of the thesis.
    held_out : dict of str to dict of str to float
        Errors by kind of record, as ``data`` has them.
    """

    artifact: PosteriorArtifact | DetectorArtifact
    held_out: dict[str, dict[str, float]]

    @property
    def data(self) -> xr.Dataset:
        """Errors by kind of record, ``cases``: see ``gossamer_models.assessment.figures``."""
        return by_label(("cases",), (((kind,), row) for kind, row in self.held_out.items()))

    @property
    def sentence(self) -> str:
        """The mean error."""
        first = next(each for each in self.held_out if each != "always 0")
        return f"The mean absolute error over all zones is {self.held_out[first]['all zones']:.2g} % damage ({first})."

    def more(self) -> list[str]:
        """Return where the artifact is."""
        return [f"The artifact is {self.path}."]

    def tables(self) -> list[TableText]:
        """Return the errors."""
        from gossamer_models.assessment.tables import error_table

        return [error_table(self.held_out)]

    def to_json(self) -> dict[str, Any]:
        """Return the errors."""
        units = {"all zones": "% damage", "damaged zones": "% damage"}  # the others are shares
        return {"artifact": self.path, "page": self.page, "held_out": self.held_out, "units": units}


@command
def train(
    source: AnyPath | None = None,
    *,
    kind: Method = "neuro-fuzzy",
    out: File | None = None,
    window: Seconds | None = None,
    epochs: Count | None = None,
    **plan: Unpack[PlanOptions],
) -> TrainedDetector:
    """Train a detector on simulated damage.

    Runs the campaign first if that has not been done, which takes many minutes; the training itself takes some. What varies
    in the campaign is what the detector is trained over. For a scenario, damage varies and the membrane is its own; for a
    setup, windows and steps are the structure's, and the load is that which the setup states. Errors on cases that were held
    out stand beside those of the answer "always 0"; after a training of the thesis those on its test cases, beside its own.

    Parameters
    ----------
    source
        Folder of a campaign that has been run, a campaign file, a scenario with the membrane to train for, or the name of a
        shipped one; detector_nominal by default. Of the kind thesis: single (default), single_noisy, multiple or
        multiple_noisy. Of a setup, at most a scenario with its parameters.
    kind
        neuro-fuzzy: the thesis' network on indices that are trained; perceptron: two hidden layers; thesis: one of its own
        trainings, on 16 energies.
    out
        File to write, with its arrays beside it; out/detector/NAME.json by default.
    window
        Length of a window [s]; 0.2532, what the scenario says, or whole periods of the load of a setup.
    epochs
        Passes through the cases; 150 by default, up to 600 of a setup.
    **plan
        What is simulated, see ``PlanOptions``.

    Returns
    -------
    TrainedDetector
        Artifact, and its errors on cases that were held out; a path of the artifact; displayed in a notebook.

    Examples
    --------
    >>> gossamer.build("detector", artifact=gossamer.train("my_scenario.toml"))

    On the command line::

        gossamer train

        gossamer train mine.toml && gossamer build detector --artifact out/detector/mine.json

        gossamer train my_scenario.toml

        gossamer train --setup reflector && gossamer build detector --artifact out/detector/reflector.json

        gossamer train multiple_noisy --kind thesis
    """
    if kind == "thesis":
        if window is not None or epochs is not None or _given(plan):
            given = f"{option('window')}, {option('epochs')} and what is simulated"
            msg = f"{given} are not for {option('kind', kind)}, whose cases, windows and networks are fixed. Leave them out."
            raise OrchestratorError(msg)
        return _train_thesis(str(source or "single"), out)
    path = None if out is None else json_file(out)
    keep_inputs([source, plan.get("setup"), plan.get("mesh")], [out, path])
    from gossamer_models.assessment.figures import errors, held_out_verdicts
    from gossamer_models.detector.posterior_records import Training
    from gossamer_models.detector.posterior_training import train_posterior

    from .pages.train import training_page

    data, name = _data(source, window, **plan)
    training = Training.of(data, network=kind, window=window)
    if epochs is not None:
        training = replace(training, epochs=epochs)
    logger.info(
        "%s: %d cases, windows of %d samples, %d epochs", name, data.sizes["case"], training.samples, training.epochs
    )
    end = "" if kind == "neuro-fuzzy" else f"_{kind}"
    path = path or Path("out/detector") / f"{name}{end}.json"
    with progress_bar("training") as bar:
        artifact = train_posterior(data, training, lambda done: bar.update(done, 1.0))
    made = (
        f"gossamer train {'--setup ' * (plan.get('setup') is not None)}{name} --kind {kind} --epochs {training.epochs}"
    )
    made += f" --window {window:g}" if window is not None else ""
    judged = held_out_verdicts(artifact, data, training)
    artifact = replace(
        artifact,
        held_out={what: errors(*pair) for what, pair in judged.items()},
        provenance={"command": made, **artifact.provenance},
    )
    artifact.write(path)
    pages = save_page(lambda: training_page(name, artifact, judged), path.with_suffix(""))
    return TrainedDetector(files=[path, *pages], artifact=artifact, held_out=artifact.held_out)


def _data(source: AnyPath | None, window: float | None, **plan: Unpack[PlanOptions]) -> tuple[xr.Dataset, str]:
    """Return the campaign of a source, run if need be, and its name."""
    from gossamer_models.campaign import read_campaign, run_campaign

    from .descriptions import locating

    if source is not None and Path(source).is_dir():
        if _given(plan):
            msg = f"{source} has been run: leave out what is simulated, or name a campaign file in its place."
            raise OrchestratorError(msg)
        return read_campaign(Path(source)), Path(source).stem
    wanted, text, name = _planned(source, window, **plan)
    path = Path("out/campaigns") / f"{name}.zarr"
    logger.info("%d cases of %g s in %d steps", wanted.count, wanted.stop, wanted.steps)
    with locating(text), progress_bar("simulating damage") as bar:
        run_campaign(wanted, path, progress=lambda done, total: bar.update(done, total, f"{done} of {total} cases,"))
    return read_campaign(path), name


def _given(plan: Mapping[str, object]) -> bool:
    """Tell whether something is said of what is simulated."""
    return any(value is not None for value in plan.values())


def _planned(
    source: AnyPath | None, window: float | None, **plan: Unpack[PlanOptions]
) -> tuple[CampaignPlan, Source, str]:
    """Return the campaign of a file, a scenario or a setup, the text that its mistakes are in, and its name."""
    from gossamer_models.campaign import Distribution, MeasurementNoise, Mesh, campaign_of_setup
    from gossamer_models.campaign.defaults import CASES, NOISE
    from gossamer_orchestrator.scenario.source import Source, find_scenario

    from .descriptions import load_campaign, setup_of

    setup, cases, noise = plan.get("setup"), plan.get("cases"), plan.get("noise")
    constants = numbers_by_name(assigned(plan.get("set")), "for instance pressure_amplitude=100")
    run = source is not None and is_scenario(str(source))
    if setup is not None:
        file = find_scenario(str(setup), "membrane")
        if source is not None and not run:
            msg = f"{source} says what is simulated, and so does {option('setup')}. Leave one of them out."
            raise OrchestratorError(msg)
        mesh = plan.get("mesh")
        membrane = Mesh(setup=setup_of(file, None if mesh is None else Path(mesh)))
        if run:
            found, length = membrane_of(find_scenario(str(source)), membrane)
            membrane, window = found, window or length
        membrane = replace(membrane, parameters={**membrane.parameters, **constants})
        wanted = campaign_of_setup(
            membrane, cases=CASES if cases is None else cases, noise=NOISE if noise is None else noise, window=window
        )
        return wanted, Source(file.name, ""), file.stem
    if plan.get("mesh") is not None:
        msg = f"{option('mesh')} needs a setup of material and supports. Name its file with {option('setup')}."
        raise OrchestratorError(msg)
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
    from gossamer_orchestrator.scenario.source import parse_toml, read_text, shipped_scenarios

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
    if len(found) != 1 or fed & loads:
        msg = (
            f"{file.name} does not hold one membrane under its built-in pressure, so there is no campaign for it. Write a "
            "campaign file: its [membrane] takes mesh, parameters and constant inputs."
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


def _train_thesis(name: str, out: AnyPath | None) -> TrainedDetector:
    from gossamer_models.assessment.figures import thesis_errors
    from gossamer_models.detector.thesis_training import TRAININGS, train_detector
    from gossamer_orchestrator.names import suggest

    from .pages.train import thesis_page

    if name not in TRAININGS:
        msg = f"the thesis has no training {name!r}. {suggest(name, TRAININGS)}"
        raise OrchestratorError(msg)
    path = Path("out/detector") / f"{name}_damage.json" if out is None else json_file(out)
    with progress_bar("simulating and training"):
        artifact = train_detector(TRAININGS[name])
        artifact.write(path)
        found = thesis_errors(artifact, noisy=TRAININGS[name].noisy)
    rows: dict[str, dict[str, float]] = {}
    for cases, (ours, printed) in found.items():
        rows |= {cases: ours, f"{cases}: the thesis": printed}
    pages = save_page(lambda: thesis_page(name, artifact, rows), path.with_suffix(""))
    return TrainedDetector(files=[path, *pages], artifact=artifact, held_out=rows)

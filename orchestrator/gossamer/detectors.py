"""Detectors of damage: simulate for them, train them, judge them."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack

from gossamer_files.inputs import check_outputs
from gossamer_files.options import option
from gossamer_files.tables import TableText
from gossamer_orchestrator.errors import OrchestratorError, require

from .arguments import Address, AnyPath, Count, File, Folder, Seconds, command
from .options import PlanOptions
from .plans import given, planned
from .results import Saved, by_label
from .working import json_file, progress_bar, save_page

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_models.campaign import CampaignPlan, Summary
    from gossamer_models.detector import DetectorArtifact, PosteriorArtifact

Method = Literal["posterior", "thesis"]

COARSER = "_coarser"  # ends the name of the store on the coarser mesh

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
    PLACE = "The store is {}."

    @property
    def sentence(self) -> str:
        """How many cases there are."""
        return f"{self.summary.cases} cases, {self.summary.simulated} of them simulated now."

    def doubts(self) -> list[str]:
        """Return how many cases broke."""
        from gossamer_orchestrator.words import counted

        failed = counted(self.summary.failed, "case")
        return [f"{failed} broke: 'failed' is 1 there, and the histories are not a number."] * bool(self.summary.failed)

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

    check_outputs([out])
    wanted, source, name = planned(campaign, None, **plan)
    store = Path("out/campaigns") / f"{name}.zarr" if out is None else Path(out)
    bar = progress_bar(name)
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
    PLACE = "The artifact is {}."

    @property
    def data(self) -> xr.Dataset:
        """Errors by kind of record, ``cases``: see ``gossamer_models.assessment.figures``."""
        return by_label(("cases",), (((kind,), row) for kind, row in self.held_out.items()))

    @property
    def sentence(self) -> str:
        """The mean error."""
        first = next(each for each in self.held_out if each != "always 0")
        return f"The mean absolute error over all zones is {self.held_out[first]['all zones']:.2g} % damage ({first})."

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
    kind: Method = "posterior",
    out: File | None = None,
    window: Seconds | None = None,
    steps: Count | None = None,
    start: File | None = None,
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
        posterior: a network of the posterior of the damage; thesis: one of its own trainings, on 16 energies.
    out
        File to write, with its arrays beside it; out/detector/NAME.json by default.
    window
        Length of a window [s]; 0.2532, what the scenario says, or whole periods of the load of a setup.
    steps
        Steps of the training of each window; 5000 by default.
    start
        Artifact of a trained detector to go on from, in place of the coarser cases.
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
        if window is not None or steps is not None or start is not None or given(plan):
            refused = f"{option('window')}, {option('steps')}, {option('start')} and what is simulated"
            why = "whose cases, windows and networks are fixed"
            msg = f"{refused} are not for {option('kind', kind)}, {why}. Leave them out."
            raise OrchestratorError(msg)
        return _train_thesis(str(source or "single"), out)
    path = None if out is None else json_file(out)
    check_outputs([out, path])
    from gossamer_models.assessment.figures import errors, held_out_verdicts
    from gossamer_models.detector import PosteriorArtifact
    from gossamer_models.detector.posterior_records import Training
    from gossamer_models.detector.posterior_training import train_posterior

    from .pages.detectors import training_page

    begin = None if start is None else PosteriorArtifact.read(Path(start))
    data, coarse, name = _data(source, window, **plan)
    training = Training.of(data, window)
    training = replace(training, steps=training.steps if steps is None else steps)
    logger.info("%s: %d cases, windows of %d samples, %d steps", name, data.sizes["case"], training.samples, training.steps)
    path = path or Path("out/detector") / f"{name}.json"
    with progress_bar("training") as bar:
        artifact = train_posterior(data, training, coarse, begin, lambda done: bar.update(done, 1.0))
    made = f"gossamer train {'--setup ' * (plan.get('setup') is not None)}{name} --steps {training.steps}"
    made += f" --window {window:g}" if window is not None else ""
    made += f" --start {start}" if start is not None else ""
    judged = held_out_verdicts(artifact, data, training)
    artifact = replace(
        artifact,
        held_out={what: errors(*pair) for what, pair in judged.items()},
        provenance={"command": made, **artifact.provenance},
    )
    artifact.write(path)
    pages = save_page(lambda: training_page(name, artifact, judged), path.with_suffix(""))
    return TrainedDetector(files=[path, *pages], artifact=artifact, held_out=artifact.held_out)


def _data(
    source: AnyPath | None, window: float | None, **plan: Unpack[PlanOptions]
) -> tuple[xr.Dataset, xr.Dataset | None, str]:
    """Return the campaign of a source and the coarser one, if it has one, run if need be, and its name."""
    from gossamer_models.campaign import read_campaign, run_campaign

    from .descriptions import locating

    if source is not None and Path(source).is_dir():
        if given(plan):
            msg = f"{source} has been run: leave out what is simulated, or name a campaign file in its place."
            raise OrchestratorError(msg)
        path = Path(source)
        coarser = path.with_name(f"{path.stem}{COARSER}{path.suffix}")
        return read_campaign(path), read_campaign(coarser) if coarser.is_dir() else None, path.stem
    wanted, text, name = planned(source, window, **plan)

    def simulated(plan: CampaignPlan, end: str = "") -> xr.Dataset:
        path = Path("out/campaigns") / f"{name}{end}.zarr"
        logger.info("%d cases of %g s in %d steps", plan.count, plan.stop, plan.steps)
        with locating(text), progress_bar("simulating damage") as bar:
            run_campaign(plan, path, progress=lambda done, total: bar.update(done, total, f"{done} of {total} cases,"))
        return read_campaign(path)

    return simulated(wanted), simulated(wanted.coarse, COARSER) if wanted.coarse else None, name


def _train_thesis(name: str, out: AnyPath | None) -> TrainedDetector:
    from gossamer_models.assessment.figures import thesis_errors
    from gossamer_models.detector.thesis_training import TRAININGS, train_detector
    from gossamer_orchestrator.names import suggest

    from .pages.detectors import thesis_page

    require(name in TRAININGS, f"the thesis has no training {name!r}. {suggest(name, TRAININGS)}")
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

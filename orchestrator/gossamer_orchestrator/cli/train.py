"""``gossamer train``: from a campaign, or a scenario, to a detector."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import OrchestratorError, ScenarioError
from ..names import suggest
from ..scenario.source import find_scenario, shipped_scenarios
from .command import Result, show, stderr
from .common import json_file, keep_inputs, model_errors, note_page, save_page

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_models.campaign import CampaignPlan
    from gossamer_models.detector import DetectorArtifact, PosteriorArtifact
    from gossamer_models.detector.posterior_artifact import Network

    from ..pages import Page

logger = logging.getLogger(__name__)
NOMINAL = "detector_nominal"
UNITS = {"all zones": "% damage", "damaged zones": "% damage"}  # the others are shares
DRIFT = 2  # steps that cover how the phase of the load drifts from window to window


class Kind(StrEnum):
    """Detectors that can be trained."""

    NEURO_FUZZY = "neuro-fuzzy"
    PERCEPTRON = "perceptron"
    THESIS = "thesis"


def train(
    source: Annotated[
        str | None,
        typer.Argument(
            help="Folder of a campaign that has been run, a campaign file, a scenario with the membrane to train for, or "
            "the name of a shipped one; detector_nominal by default. With --kind thesis: single (default), single_noisy, "
            "multiple or multiple_noisy.",
        ),
    ] = None,
    kind: Annotated[
        Kind,
        typer.Option(
            help="neuro-fuzzy: the thesis' network on indices that are trained; perceptron: two hidden layers; thesis: one "
            "of its own trainings, on 16 energies."
        ),
    ] = Kind.NEURO_FUZZY,
    out: Annotated[
        Path | None,
        typer.Option(
            help="File to write, with its arrays beside it; out/detector/NAME.json by default.", metavar="FILE"
        ),
    ] = None,
    window: Annotated[
        float | None, typer.Option(help="Length of a window [s]; 0.2532 or what the scenario says.", metavar="SECONDS")
    ] = None,
    epochs: Annotated[int | None, typer.Option(help="Passes through the cases; 150 by default.", min=1)] = None,
) -> Result:
    """Train a detector on simulated damage.

    Runs the campaign first if that has not been done, which takes many minutes; the training itself takes some. What varies
    in the campaign is what the detector is trained over. For a scenario, damage varies and the membrane is its own. Then
    prints errors on cases that were held out, beside those of the answer "always 0"; after a training of the thesis those
    on its test cases, beside its own.

    For example:

        gossamer train

        gossamer train mine.toml && gossamer build detector --artifact out/detector/mine.json

        gossamer train my_scenario.toml

        gossamer train multiple_noisy --kind thesis
    """
    from gossamer.pages.train import error_table

    from .tables import printed

    _, path, rows, pages = train_given(source, kind=kind, out=out, window=window, epochs=epochs)
    stderr().print(printed(error_table(rows)))
    for each in (path, *pages):
        show(each)
    for page in pages:
        note_page(page)
    return Result({"artifact": path, "page": next(iter(pages), None), "held_out": rows, "units": UNITS})


def train_given(
    source: str | None, *, kind: str, out: Path | None, window: float | None, epochs: int | None
) -> tuple[PosteriorArtifact | DetectorArtifact, Path, dict[str, dict[str, float]], list[Path]]:
    """Train a detector with the options of the command.

    Returns
    -------
    PosteriorArtifact or DetectorArtifact
        The detector; the latter of the thesis.
    Path
        Its file.
    dict of str to dict of str to float
        Errors by kind of record, see ``gossamer_models.assessment.figures``.
    list of Path
        Its page, if it was written.
    """
    if kind == Kind.THESIS:
        if window is not None or epochs is not None:
            msg = (
                "--window and --epochs are not for --kind thesis, whose windows and networks are fixed. Leave them out."
            )
            raise OrchestratorError(msg)
        return _train_thesis(source or "single", out)
    path = None if out is None else json_file(out)
    keep_inputs([Path(source or NOMINAL)], [out, path])
    network: Network = "neuro-fuzzy" if kind == Kind.NEURO_FUZZY else "perceptron"
    from gossamer.pages.train import training_page
    from gossamer_models.assessment.figures import errors, held_out_verdicts
    from gossamer_models.detector.posterior_records import Training
    from gossamer_models.detector.posterior_training import train_posterior

    from ..run.progress import ProgressBar

    with model_errors():
        data, name, length = _data(source or NOMINAL)
        length = window or length
        samples = Training().samples if length is None else 4 * max(round(length / float(data["time"][0])) // 4, 1)
        windows = min(Training().windows, max(data.sizes["time"] // samples, 1))
        training = Training(network=network, samples=samples, windows=windows)
        if epochs is not None:
            training = replace(training, epochs=epochs)
        logger.info(
            "%s: %d cases, windows of %d samples, %d epochs", name, data.sizes["case"], samples, training.epochs
        )
        end = "" if kind == Kind.NEURO_FUZZY else f"_{kind}"
        path = path or Path("out/detector") / f"{name}{end}.json"
        with ProgressBar("training", stderr()) as bar:
            artifact = train_posterior(data, training, lambda done: bar.update(done, 1.0))
        command = f"gossamer train {name} --kind {kind} --epochs {training.epochs}"
        command += f" --window {window:g}" if window is not None else ""
        judged = held_out_verdicts(artifact, data, training)
        artifact = replace(
            artifact,
            held_out={what: errors(*pair) for what, pair in judged.items()},
            provenance={"command": command, **artifact.provenance},
        )
        artifact.write(path)
    return artifact, path, artifact.held_out, _save(lambda: training_page(name, artifact, judged), path)


def _data(source: str) -> tuple[xr.Dataset, str, float | None]:
    """Return the campaign of a source, run if need be, its name, and the length of a window that a scenario states [s]."""
    from gossamer_models.campaign import read_campaign, run_campaign

    from ..run.progress import ProgressBar
    from .campaign_file import load_campaign
    from .described_file import locating

    if Path(source).is_dir():
        return read_campaign(Path(source)), Path(source).stem, None
    length = None
    if _is_scenario(source):
        file = find_scenario(source)
        nominal, text = load_campaign(shipped_scenarios("campaign")[NOMINAL])
        wanted, length = _campaign_of(file, nominal)
    else:
        file = find_scenario(source, "campaign")
        wanted, text = load_campaign(file)
    path = Path("out/campaigns") / f"{file.stem}.zarr"
    with locating(text), ProgressBar("simulating damage", stderr()) as bar:
        run_campaign(wanted, path, progress=lambda done, total: bar.update(done, total, f"{done} of {total} cases,"))
    return read_campaign(path), file.stem, length


def _is_scenario(source: str) -> bool:
    """Tell a scenario, which has components, from a campaign, by content or by the name of a shipped one."""
    if not Path(source).is_file():
        return source in shipped_scenarios() and source not in shipped_scenarios("campaign")
    from ..scenario.source import parse_toml, read_text

    return "components" in parse_toml(read_text(Path(source), "scenario"), source, "scenario")


def _campaign_of(file: Path, nominal: CampaignPlan) -> tuple[CampaignPlan, float | None]:
    """Return the nominal campaign with the membrane and the windows of a scenario, and the length of a window [s]."""
    from ..scenario.load import load_scenario

    scenario = load_scenario(file)
    found = [c for c in scenario.components.values() if Path(c.fmu).stem == "membrane"]
    fed = {c.target.partition(".")[2] for c in scenario.connections}
    if len(found) != 1 or fed & {"pressure", "base_acceleration"}:
        msg = (
            f"{file.name} does not hold one membrane under its built-in pressure, so there is no campaign for it. Write a "
            "campaign file: its [membrane] takes mesh, parameters and constant inputs."
        )
        raise ScenarioError(msg)
    given = {**found[0].parameters, **found[0].inputs}
    numbers = {name: float(value) for name, value in given.items() if isinstance(value, int | float)}
    constants = {name: value for name, value in numbers.items() if not name.startswith("damage")}
    detectors = [c for c in scenario.components.values() if Path(c.fmu).stem == "detector"]
    lengths = [c.parameters.get("window_length") for c in detectors]
    length = next((float(value) for value in lengths if isinstance(value, int | float)), None)
    window = 0.2532 if length is None else length
    steps = 3 * 4 * max(round(window / nominal.step) // 4, 1) + DRIFT
    return replace(nominal, membrane=replace(nominal.membrane, parameters=constants), stop=steps * nominal.step), length


def _train_thesis(
    name: str, out: Path | None
) -> tuple[DetectorArtifact, Path, dict[str, dict[str, float]], list[Path]]:
    from gossamer.pages.train import thesis_page
    from gossamer_models.assessment.figures import thesis_errors
    from gossamer_models.detector.thesis_training import TRAININGS, train_detector

    from ..run.progress import ProgressBar

    if name not in TRAININGS:
        msg = f"the thesis has no training {name!r}. {suggest(name, TRAININGS)}"
        raise OrchestratorError(msg)
    path = Path("out/detector") / f"{name}_damage.json" if out is None else json_file(out)
    with model_errors(), ProgressBar("simulating and training", stderr()):
        artifact = train_detector(TRAININGS[name])
        artifact.write(path)
        found = thesis_errors(artifact, noisy=TRAININGS[name].noisy)
    rows: dict[str, dict[str, float]] = {}
    for cases, (ours, printed) in found.items():
        rows |= {cases: ours, f"{cases}: the thesis": printed}
    return artifact, path, rows, _save(lambda: thesis_page(name, artifact, rows), path)


def _save(describe: Callable[[], Page], artifact: Path) -> list[Path]:
    """Write the page of an artifact into the folder of its name beside it; return its path."""
    from ..pages import PAGE

    return save_page(describe, artifact.with_suffix("") / PAGE)

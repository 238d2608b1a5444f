"""Damage, how certain it is, and what finds it: twin, detectors, sensors in the right places.

Made by ``docs/make_front_door.py`` from the table of the command line: change the command, then run ``make goldens``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .results.damage import Campaign, DetectorAssessment, SensorPlacement, TrainedDetector, TwinAnswer, Watching


def twin(
    record: str | PathLike[str],
    *,
    fit: str | Sequence[str] | None = None,
    kind: str | None = None,
    noise: float | None = None,
    stop: float | None = None,
    set: Mapping[str, object] | Sequence[str] | None = None,
    sensor: str | PathLike[str] | None = None,
    elements_per_side: int = 4,
    order: int = 4,
    sparse: bool = True,
    out: str | PathLike[str] | None = None,
) -> TwinAnswer:
    """Fit a simulation to a record: the damage of each zone, with its standard deviation.

    The record begins when the load sets in. A CSV file has the columns time, and strain[1] to strain[4] or
    resistance[1] to resistance[4]; empty cells are gaps.

    Parameters
    ----------
    record : path
        Results of a run (results.nc, results.csv or their folder), or a CSV file.
    fit : str, sequence of str or None
        What is unknown beside damage: offset, gain, amplitude, frequency, phase, damping, modulus, pressure,
        with commas between, or none. By default offset for strain and none for resistance.
    kind : str or None
        strain or resistance, where the record has both.
    noise : float or None
        Standard deviation of the noise, 1 or ohm; estimated by default.
    stop : float or None
        Use the record up to this time [s] only; it costs less.
    set : mapping, sequence of str or None
        A parameter of the membrane; may be repeated.
    sensor : path or None
        Artifact of the sensors; the shipped one by default.
    elements_per_side : int, default 4
        Elements along a side of the twin, a multiple of 4.
    order : int, default 4
        Their order; 1 for bilinear ones.
    sparse : bool, default True
        Drop the zones that the record does not need.
    out : path or None
        JSON file to write; twin.json beside the record by default.

    Returns
    -------
    TwinAnswer
        Damage by zone with its deviation, and whether it is valid; displayed in a notebook.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.twin("out/damaged").data["damage"]
    """
    given = vars()
    from . import table
    from .work import damage as work

    with table.words_of_python("twin"):
        return work.twin(**table.values("twin", given))


def watch(
    record: str | PathLike[str],
    *,
    window: float = 0.05,
    kind: str | None = None,
    noise: float | None = None,
    false_alarms: float = 1e-05,
    set: Mapping[str, object] | Sequence[str] | None = None,
    sensor: str | PathLike[str] | None = None,
    elements_per_side: int = 4,
    order: int = 4,
    out: str | PathLike[str] | None = None,
) -> Watching:
    """Watch a record as if it arrived live: an alarm when damage begins, then when and where.

    The record begins, undamaged, when the load sets in.

    Parameters
    ----------
    record : path
        Results of a run (results.nc, results.csv or their folder), or a CSV file.
    window : float, default 0.05
        Length of a window [s].
    kind : str or None
        strain or resistance, where the record has both.
    noise : float or None
        Standard deviation of the noise, 1 or ohm; estimated by default.
    false_alarms : float, default 1e-05
        Share of the windows that may raise a false alarm.
    set : mapping, sequence of str or None
        A parameter of the membrane; may be repeated.
    sensor : path or None
        Artifact of the sensors; the shipped one by default.
    elements_per_side : int, default 4
        Elements along a side of the twin, a multiple of 4.
    order : int, default 4
        Their order; 1 for bilinear ones.
    out : path or None
        JSON file to write; watch.json beside the record by default.

    Returns
    -------
    Watching
        Alarms, onsets and damages, and the score of each window; displayed in a notebook.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.watch("out/damage_begins").report.alarms
    """
    given = vars()
    from . import table
    from .work import damage as work

    with table.words_of_python("watch"):
        return work.watch(**table.values("watch", given))


def campaign(
    campaign: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Campaign:
    """Simulate the cases of a campaign: random damage, load, material and sensors.

    The same call again goes on after an interruption; the numbers depend on the file alone.

    Parameters
    ----------
    campaign : path
        A campaign file, or the name of a shipped campaign.
    out : path or None
        Folder of the store; out/campaigns/NAME.zarr by default.
    workers : int or None
        Processes; all cores by default.
    scheduler : str or None
        Run on the Dask cluster of this scheduler, tcp://host:8786.

    Returns
    -------
    Campaign
        What was drawn, and the histories; a path of the store; displayed in a notebook.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.train(gossamer.campaign("training"))
    """
    given = vars()
    from . import table
    from .work import damage as work

    with table.words_of_python("campaign"):
        return work.campaign(**table.values("campaign", given))


def train(
    source: str | PathLike[str] | None = None,
    *,
    kind: str = "neuro-fuzzy",
    out: str | PathLike[str] | None = None,
    window: float | None = None,
    epochs: int | None = None,
) -> TrainedDetector:
    """Train a detector on simulated damage.

    Runs the campaign first if that has not been done, which takes many minutes; the training takes some.

    Parameters
    ----------
    source : path or None
        Folder of a campaign that has been run, a campaign file, a scenario with the membrane to train for, or
        the name of a shipped one; detector_nominal by default. With --kind thesis: single (default),
        single_noisy, multiple or multiple_noisy.
    kind : str, default "neuro-fuzzy"
        neuro-fuzzy: the thesis' network on indices that are trained; perceptron: two hidden layers; thesis: one
        of its own trainings, on 16 energies.
    out : path or None
        File to write, with its arrays beside it; out/detector/NAME.json by default.
    window : float or None
        Length of a window [s]; 0.2532 or what the scenario says.
    epochs : int or None
        Passes through the cases; 150 by default.

    Returns
    -------
    TrainedDetector
        Artifact, and its errors on cases that were held out; a path of the artifact; displayed in a notebook.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.build("detector", artifact=gossamer.train("my_scenario.toml"))
    """
    given = vars()
    from . import table
    from .work import damage as work

    with table.words_of_python("train"):
        return work.train(**table.values("train", given))


def assess_detector(
    *,
    artifact: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
    twin: bool = False,
    cases: int = 400,
    out: str | PathLike[str] = "out/assessment",
) -> DetectorAssessment:
    """Judge detectors, and the twin, under many conditions.

    The same call again goes on after an interruption.

    Parameters
    ----------
    artifact : path, sequence of path or None
        Trained detector: its file, or nominal, wide or single_damage; may be repeated. These three by default.
    twin : bool, default False
        The digital twin too, on few records: it takes long.
    cases : int, default 400
        Records of each condition; a fifth as many sizes of damage in each zone.
    out : path, default "out/assessment"
        Folder of results, pictures and simulations.

    Returns
    -------
    DetectorAssessment
        Errors, false calls and probability of detection; a path of the folder; displayed in a notebook.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.assess_detector(artifact="mine.json", cases=100).data["error_damaged"].sel(condition="clean")
    """
    given = vars()
    from . import table
    from .work import damage as work

    with table.words_of_python("assess_detector"):
        return work.assess_detector(**table.values("assess_detector", given))


def place_sensors(
    setup: str | PathLike[str] | None = None,
    *,
    mesh: str | PathLike[str] | None = None,
    count: int = 4,
    noise: float | None = None,
    set: Mapping[str, object] | Sequence[str] | None = None,
    stop: float = 0.3,
    step: float = 0.0003,
    points: int = 64,
    gauge_length: float = 0.0,
    check: int = 0,
    out: str | PathLike[str] = "out/placement",
) -> SensorPlacement:
    """Choose where strain sensors let damage be found best.

    Parameters
    ----------
    setup : path or None
        The setup of a membrane on a mesh; the square membrane of the thesis by default.
    mesh : path or None
        Mesh file in place of the setup's own.
    count : int, default 4
        Sensors to choose.
    noise : float or None
        Standard deviation of the noise of a sample of strain [1]; by default that of the thesis, uniform from 0
        to 0.02.
    set : mapping, sequence of str or None
        A parameter or input of the membrane; may be repeated.
    stop : float, default 0.3
        Length of a record from the moment that the load sets in [s].
    step : float, default 0.0003
        Time between samples [s].
    points : int, default 64
        Most points among the candidates, four directions at each.
    gauge_length : float, default 0.0
        Length of the candidates [m]; 0 at the point.
    check : int, default 0
        Fit this many simulated noisy records with each placement, as a check.
    out : path, default "out/placement"
        Folder to write.

    Returns
    -------
    SensorPlacement
        Smallest damage that is found by zone, and the sensors; displayed in a notebook.

    Raises
    ------
    OrchestratorError
        As the command does; the message says what to do.

    Examples
    --------
    >>> gossamer.place_sensors(count=4, check=40).data["a90"]
    """
    given = vars()
    from . import table
    from .work import damage as work

    with table.words_of_python("place_sensors"):
        return work.place_sensors(**table.values("place_sensors", given))

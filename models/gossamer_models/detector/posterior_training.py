r"""Train posterior networks on a campaign, and make them honest on held-out cases: probabilities, deviations, valid limits.

Symbols: ``n`` cases, ``x`` centred block means [1], ``T`` temperature [1], ``f`` factor on standard deviations [1], ``d``
damage [1].
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from dataclasses import asdict, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import ndtr

from ..arrays import Matrix, Vector
from ..campaign.symmetry import Symmetry
from ..errors import DataError
from ..twin.nuisances import LoadTable
from . import posterior_records as records
from .features import Components, block_means, principal_components
from .networks import ResidualNetwork
from .posterior import FLOOR, Features, analyse, deviation, explained, heads_of, records_judged, unexplained
from .posterior_artifact import HEADS, PosteriorArtifact, PosteriorWindow
from .posterior_fit import NetworkFit

if TYPE_CHECKING:
    import xarray as xr

SMALL = 2e-4  # components are in units of their deviation or of this, for the decoder
BANDS = 1.96, 3.0  # standard deviations of the bands of 95 and 99.7 %, both of which hold on held-out cases
FALSE_REJECTION = 0.01  # share of records of the training that the misfit may refuse
FEWEST = 40  # held-out cases that limits can be taken from
ROOM = 1.2  # noise above that of the training that is still valid


def train_posterior(
    data: xr.Dataset,
    t: records.Training,
    coarse: xr.Dataset | None = None,
    start: PosteriorArtifact | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> PosteriorArtifact:
    """Train the networks of all windows on a campaign.

    Parameters
    ----------
    data : xarray.Dataset
        From ``read_campaign``. What varies in it is what the detector is trained over.
    t : records.Training
        Settings.
    coarse : xarray.Dataset, optional
        Campaign on a coarser mesh, to train on first.
    start : PosteriorArtifact, optional
        Trained networks to go on from, without the coarser campaign.
    progress : callable
        Called with the share of the work that is done.

    Raises
    ------
    DataError
        There are too few cases, the runs are too short, or the networks to go on from have other windows or sizes.
    """
    campaign = json.loads(data.attrs["campaign"])
    sensing, symmetry = records.Sensing.of(data), Symmetry.stored(json.loads(data.attrs["symmetry"]))
    if start is not None:
        _check_start(start, data, t)
        coarse = None
    done = itertools.count(1)
    total = t.windows * (t.steps + t.decoder_steps + (t.coarse_steps if coarse is not None else 0))
    trained = []
    for number in range(t.windows):
        window = number, t.samples, number == t.windows - 1, t.seed
        cut = records.cut_windows(data, *window)
        before = None if coarse is None else records.cut_windows(coarse, *window)
        known = None if start is None else start.windows[number]
        settings = replace(t, seed=t.seed + number)
        trained.append(_train_window(cut, before, known, sensing, symmetry, settings, lambda: progress(next(done) / total)))
    windows, losses = zip(*trained, strict=True)
    return PosteriorArtifact(
        start_time=0.0,
        sampling_step=float(campaign["step"]),
        samples=t.samples,
        zone_names=tuple(data["zone"].attrs["names"]),
        structure=data.attrs.get("structure", ""),
        parameters=campaign["membrane"]["parameters"],
        load=LoadTable.stored(campaign["membrane"].get("load")),
        block=t.block,
        windows=windows,
        periodic=data.sizes["time"] > t.windows * t.samples,
        losses=list(losses),
        trained_over=trained_over(campaign, sensing) | {"share of records with a spoilt sensor [1]": [t.spoilt, t.spoilt]},
        provenance={
            "campaign": str(data.attrs["sha256"]),
            "cases": str(data.sizes["case"]),
            "settings": json.dumps(asdict(t)),
        },
    )


def _check_start(start: PosteriorArtifact, data: xr.Dataset, t: records.Training) -> None:
    """Refuse networks that do not fit a campaign and settings."""
    window = start.windows[0]
    there = (len(start.windows), start.samples, start.block, start.zones, start.sensors)
    sizes = (window.sectors.size, *window.latent.shape[:1], len(window.encoder) // 2 - 2)
    wanted = (t.windows, t.samples, t.block, data.sizes["zone"], data.sizes["sensor"])
    for what, found, here in (
        ("windows, their samples, block, zones and sensors", there, wanted),
        ("components, width and layers", sizes, (t.components, t.width, t.layers)),
    ):
        if found != here:
            msg = f"the networks to go on from have other {what}: {found}, not {here}. Train without them."
            raise DataError(msg)


def trained_over(campaign: dict[str, Any], sensing: records.Sensing) -> dict[str, list[float]]:
    """State the ranges of a training: from its campaign and the noise of ``Sensing``."""
    damage = campaign["damage"]
    ranges = {"damaged zones": [0, damage["zones"][1]], "damage [1]": damage["depth"]}
    for name, vary in campaign["vary"].items():
        kind = "range" if vary["range"] else "factor"
        ranges[f"{name}, {kind}"] = vary[kind]
    if campaign["membrane"].get("finer"):
        ranges["share of cases on finer elements [1]"] = [campaign["membrane"]["finer"]] * 2
    noise = {
        "white noise of a sample [1]": [sensing.unit * records.LEAST_NOISE, sensing.unit * records.MOST_NOISE],
        "coloured noise [1]": [0.0, sensing.unit * records.COLOURED],
    }
    return {name: [float(value) for value in pair] for name, pair in (ranges | noise).items()}


def split(cut: records.Windows, t: records.Training) -> tuple[records.Windows, records.Windows, records.Windows]:
    """Split cases into those to train on, to calibrate with and to test with.

    Raises
    ------
    DataError
        There are too few cases to calibrate with.
    """
    n = len(cut.damage)
    ends = [0, n - int(t.held_out * n), n - int(0.5 * t.held_out * n), n]
    train, calibration, test = (cut.part(a, b) for a, b in itertools.pairwise(ends))
    if len(calibration.damage) < FEWEST:
        there = f"{len(calibration.damage)} held-out cases are too few to calibrate a detector, {FEWEST} are the least"
        msg = f"{there}. Run {round(2 * FEWEST / t.held_out)} cases or more."
        raise DataError(msg)
    return train, calibration, test


def _train_window(
    cut: records.Windows,
    coarse: records.Windows | None,
    start: PosteriorWindow | None,
    sensing: records.Sensing,
    symmetry: Symmetry,
    t: records.Training,
    report: Callable[[], None],
) -> tuple[PosteriorWindow, list[float]]:
    random = np.random.default_rng(t.seed)
    train, calibration, _ = split(cut, t)
    x = records.features_of(train.records, t.block)
    if start is None:
        parts = principal_components(sensing.read(x, random), t.components, symmetry, sensing.unit)
        parts = replace(parts, axes=_half(parts.axes))
        net = ResidualNetwork.random(t.components + 1, t.width, t.layers, HEADS * train.damage.shape[1], random)
    else:
        parts = Components(**{row.name: getattr(start, row.name) for row in fields(Components)})
        net = ResidualNetwork([a.astype(np.float32) for a in start.encoder])
    losses = []
    if coarse is not None:
        before = NetworkFit(parts, records.features_of(coarse.records, t.block), coarse, sensing, t, symmetry)
        losses = before.network(net, t.coarse_steps, report)
    fit = NetworkFit(parts, x, train, sensing, t, symmetry)
    losses += fit.network(net, t.steps, report)
    largest = explained(parts.variances, t.explained)
    scales = np.sqrt(parts.variances[largest] + SMALL**2)
    decoder, latent = fit.decoder(net, scales, report)
    window = PosteriorWindow(
        **asdict(parts),
        signs=symmetry.signs(parts.modes),
        images=symmetry.zones,
        rest=np.array([fit.rest()]),
        encoder=tuple(np.asarray(a, float) for a in net.arrays),
        latent=np.asarray(latent, float),
        decoder=tuple(np.asarray(a, float) for a in decoder.arrays),
        scales=scales,
        directions=np.eye(len(scales)),
        errors=np.ones(len(scales)),
        limits=np.ones(4),
    )
    return calibrate(window, t.block, calibration, sensing, symmetry, random), losses


def calibrate(
    window: PosteriorWindow,
    block: int,
    held_out: records.Windows,
    sensing: records.Sensing,
    symmetry: Symmetry,
    random: np.random.Generator,
) -> PosteriorWindow:
    """Calibrate one window.

    Parameters
    ----------
    window : PosteriorWindow
        Trained network.
    block : int
        Samples of a block.
    held_out : records.Windows
        Cases that it was not trained on.
    sensing : records.Sensing
        Gain, error and noise of the training.
    symmetry : Symmetry
        Images of the structure.
    random : numpy.random.Generator
        Source of both.

    Returns
    -------
    PosteriorWindow
        With a temperature of the probabilities [1]_ and a factor on the deviations in the weights of its last layer, and
        with errors of the decoder and limits.

    References
    ----------
    .. [1] C. Guo, G. Pleiss, Y. Sun, K. Q. Weinberger, On calibration of modern neural networks, ICML, 2017,
       arXiv:1706.04599.
    """
    clean, d = symmetry.images(held_out.records, held_out.damage)
    noisy = sensing.samples(clean, random)
    window = _with_honest_heads(window, analyse(window, block_means(noisy, block)), d)
    found = analyse(window, block_means(sensing.read(clean, random), block))
    left = unexplained(window, found)
    squares, directions = np.linalg.eigh(left.T @ left / len(left))
    window = replace(window, directions=_half(directions), errors=np.sqrt(np.maximum(squares, FLOOR**2)))
    exact = replace(sensing, error=records.EXACT).samples(clean, random)  # noise alone, no error that seems to be some
    ratios = [records_judged(window, block, some)["ratios"] for some in (noisy, exact)]
    return replace(window, limits=_limits(ratios[0], float(ratios[1][:, 3].max())))


def _with_honest_heads(window: PosteriorWindow, found: Features, d: Matrix) -> PosteriorWindow:
    logit, mean, spread = np.split(heads_of(window, found), 3, axis=1)
    damaged = d > 0.0

    def surprise(log_T: float) -> float:
        return float(np.logaddexp(0.0, np.where(damaged, -logit, logit) * np.exp(-log_T)).mean())

    T = np.exp(minimize_scalar(surprise, bounds=(-1.5, 1.5), method="bounded").x)
    called = damaged & (logit >= 0.0)
    if called.sum() < FEWEST:
        msg = f"the network recognises {called.sum()} damaged zones of {damaged.sum()}. Train longer, or on more cases."
        raise DataError(msg)
    u = np.abs(mean - d)[called] / deviation(spread[called])
    f = max(np.quantile(u, 2.0 * ndtr(band) - 1.0) / band for band in BANDS)
    *rest, W, b = window.encoder
    W, b = W.copy(), b.copy()
    W[:, : window.zones] /= T
    b[: window.zones] /= T
    b[-window.zones :] += np.log(f)
    return replace(window, encoder=tuple(map(_half, (*rest, W, b))))


def _half(array: Matrix) -> Matrix:
    """Round to half precision, as the file holds it."""
    return np.asarray(array.astype(np.float16), float)


def _limits(ratios: Matrix, noise: float) -> Vector:
    """Return limits of ratios, shape (n, 4), that together refuse ``FALSE_REJECTION``; the last from the largest noise."""
    low, high = 0.0, FALSE_REJECTION
    for _ in range(30):  # the share that each may refuse
        each = 0.5 * (low + high)
        limits = np.quantile(ratios[:, :3], 1.0 - each, axis=0)
        together = (ratios[:, :3] > limits).any(axis=1).mean()
        low, high = (each, high) if together < FALSE_REJECTION else (low, each)
    return np.array([*limits, ROOM * noise])

r"""Train posterior networks on a campaign.

Symbols: ``n`` cases, ``x`` centred block means [1].
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from ..errors import DataError
from .features import principal_components
from .fuzzy_rules import PEAKS
from .posterior_artifact import PosteriorArtifact, PosteriorWindow
from .posterior_calibration import calibrate
from .posterior_fit import Fit
from .posterior_records import COLOURED, LEAST_NOISE, MOST_NOISE, Sensing, Windows, cut_windows, features_of
from .posterior_settings import Training

if TYPE_CHECKING:
    import xarray as xr

SMALL = 2e-4  # components are in units of their deviation or of this [1], for the decoder


def train_posterior(
    data: xr.Dataset, training: Training | None = None, progress: Callable[[float], None] | None = None
) -> PosteriorArtifact:
    """Train the networks of all windows on a campaign.

    Parameters
    ----------
    data : xarray.Dataset
        From ``read_campaign``. What varies in it is what the detector is trained over.
    training : Training, optional
        Settings.
    progress : callable, optional
        Called with the share of the work that is done.

    Raises
    ------
    DataError
        There are too few cases, the runs are too short, or the network cannot state damages as large.
    """
    t = training or Training()
    campaign = json.loads(data.attrs["campaign"])
    deepest = max([campaign["damage"]["depth"][1], *(d for case in campaign["damage"]["cases"] for d in case.values())])
    if t.network == "neuro-fuzzy" and deepest > PEAKS[-1]:
        msg = (
            f"the campaign has damage of {100.0 * deepest:g} %, but the last fuzzy set of a neuro-fuzzy network peaks at "
            f"{100.0 * PEAKS[-1]:g} %. Choose a perceptron, or less damage."
        )
        raise DataError(msg)
    sensing = Sensing.of(data)
    cuts = [cut_windows(data, number, t.samples, number == t.windows - 1, t.seed) for number in range(t.windows)]
    windows: list[PosteriorWindow] = []
    losses: list[list[float]] = []
    done = itertools.count(1)
    total = sum((t.epochs + t.decoder_epochs) * max(4 * len(split(cut, t)[0].damage) // t.batch, 1) for cut in cuts)
    with threadpool_limits(1):  # small matrices: waking other threads for them costs more than their work
        for number, cut in enumerate(cuts):
            report = (lambda: None) if progress is None else (lambda: progress(next(done) / total))
            window, loss = _train_window(cut, sensing, replace(t, seed=t.seed + number), report)
            windows.append(window)
            losses.append(loss)
    return PosteriorArtifact(
        start_time=0.0,
        sampling_step=float(campaign["step"]),
        samples=t.samples,
        block=t.block,
        windows=tuple(windows),
        periodic=data.sizes["time"] > t.windows * t.samples,
        losses=losses,
        trained_over=trained_over(campaign) | {"share of records with a spoilt sensor [1]": [t.spoilt, t.spoilt]},
        provenance={
            "campaign": str(data.attrs["sha256"]),
            "cases": str(data.sizes["case"]),
            "settings": json.dumps(asdict(t)),
        },
    )


def trained_over(campaign: dict[str, Any]) -> dict[str, list[float]]:
    """State the ranges of a training: from its campaign and the noise of ``Sensing``."""
    damage = campaign["damage"]
    ranges = {"damaged zones": [0, damage["zones"][1]], "damage [1]": damage["depth"]}
    for name, vary in campaign["vary"].items():
        kind = "range" if vary["range"] else "factor"
        ranges[f"{name}, {kind}"] = vary[kind]
    noise = {"white noise of a sample [1]": [LEAST_NOISE, MOST_NOISE], "coloured noise [1]": [0.0, COLOURED]}
    return {name: [float(value) for value in pair] for name, pair in (ranges | noise).items()}


def split(cut: Windows, t: Training) -> tuple[Windows, Windows, Windows]:
    """Split cases into those to train on, to calibrate with and to test with."""
    n = len(cut.damage)
    ends = [0, n - int(t.held_out * n), n - int(0.5 * t.held_out * n), n]
    train, calibration, test = (cut.part(a, b) for a, b in itertools.pairwise(ends))
    return train, calibration, test


def _train_window(
    cut: Windows, sensing: Sensing, t: Training, report: Callable[[], None]
) -> tuple[PosteriorWindow, list[float]]:
    random = np.random.default_rng(t.seed)
    train, calibration, _ = split(cut, t)
    x = features_of(train.records, t.block)
    parts = principal_components(sensing.gained(x, random), t.components)
    parts = replace(parts, axes=parts.axes.astype(np.float16).astype(float))  # as the file holds them
    fit = Fit.of(parts, x, train, sensing, t)
    scales = np.sqrt(parts.variances + SMALL**2)
    net, losses = fit.network(report)
    decoder, latent = fit.decoder(net, scales, report)
    window = PosteriorWindow(
        mean=parts.mean,
        axes=parts.axes,
        sectors=parts.sectors,
        variances=parts.variances,
        rest=np.array([fit.rest()]),
        network=t.network,
        encoder=tuple(np.asarray(a, float) for a in net.arrays),
        latent=np.asarray(latent, float),
        decoder=tuple(np.asarray(a, float) for a in decoder.arrays),
        scales=scales,
        directions=np.eye(t.components),
        errors=np.ones(t.components),
        limits=np.ones(4),
    )
    return calibrate(window, t.block, calibration, sensing, random), losses

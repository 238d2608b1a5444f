r"""Make a trained posterior network honest on held-out cases: probabilities, deviations, and limits of what is valid.

Symbols: ``T`` temperature [1], ``f`` factor on standard deviations [1], ``d`` damage [1], ``q`` quantiles.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import norm

from ..arrays import Matrix, Vector
from ..errors import DataError
from .features import block_means
from .fuzzy_rules import QUADRANT
from .learned import Features, analyse, deviation, explain, heads_of
from .posterior import FLOOR, judge_records
from .posterior_artifact import PosteriorArtifact, PosteriorWindow
from .posterior_records import Sensing, Windows, reflect

BAND = 1.96  # standard deviations of a 95 % band
FALSE_REJECTION = 0.01  # share of records of the training that the misfit may refuse
FEWEST = 40  # held-out cases that limits can be taken from
ROOM = 1.2  # noise above that of the training that is still valid


def calibrate(
    window: PosteriorWindow, block: int, held_out: Windows, sensing: Sensing, random: np.random.Generator
) -> PosteriorWindow:
    """Calibrate one window.

    Parameters
    ----------
    window : PosteriorWindow
        Trained network.
    block : int
        Samples of a block.
    held_out : Windows
        Cases that it was not trained on.
    sensing : Sensing
        Gain and noise of the training.
    random : numpy.random.Generator
        Source of both.

    Returns
    -------
    PosteriorWindow
        With a temperature of the probabilities [1]_ and a factor on the deviations in the weights of its last layer, and
        with errors of the decoder and limits.

    Raises
    ------
    DataError
        There are too few cases.

    References
    ----------
    .. [1] C. Guo, G. Pleiss, Y. Sun, K. Q. Weinberger, On calibration of modern neural networks, ICML, 2017,
       arXiv:1706.04599.
    """
    if len(held_out.damage) < FEWEST:
        msg = (
            f"{len(held_out.damage)} held-out cases are too few to calibrate a detector, {FEWEST} are the least. Run more "
            "cases."
        )
        raise DataError(msg)
    clean, d = reflect(held_out.records, held_out.damage)
    noisy = sensing.samples(clean, random)
    window = _with_honest_heads(window, analyse(window, block_means(noisy, block)), d)
    found = analyse(window, block_means(sensing.gained(clean, random), block))
    left = found.c - explain(window, found)
    squares, directions = np.linalg.eigh(left.T @ left / len(left))
    directions = directions.astype(np.float16).astype(float)  # as the file holds them
    window = replace(window, directions=directions, errors=np.sqrt(np.maximum(squares, FLOOR**2)))
    artifact = PosteriorArtifact(
        start_time=0.0,
        sampling_step=1.0,
        samples=clean.shape[-1],
        block=block,
        windows=(window,),
        periodic=False,
    )
    return replace(window, limits=_limits(judge_records(artifact, 0, noisy)["ratios"]))


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
    f = np.quantile(u, 2.0 * norm.cdf(BAND) - 1.0) / BAND
    *rest, W, b = window.encoder
    W, b = W.copy(), b.copy()
    W[:, :QUADRANT] /= T
    b[:QUADRANT] /= T
    b[-QUADRANT:] += np.log(f)
    return replace(window, encoder=(*rest, W, b))


def _limits(ratios: Matrix) -> Vector:
    """Return the limits of ratios, shape (n, 4), which together refuse ``FALSE_REJECTION`` of the records."""
    low, high = 0.0, FALSE_REJECTION
    for _ in range(30):  # the share that each may refuse
        each = 0.5 * (low + high)
        limits = np.quantile(ratios[:, :3], 1.0 - each, axis=0)
        together = (ratios[:, :3] > limits).any(axis=1).mean()
        low, high = (each, high) if together < FALSE_REJECTION else (low, each)
    return np.array([*limits, ROOM * ratios[:, 3].max()])

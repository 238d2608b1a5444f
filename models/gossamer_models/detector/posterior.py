"""What one window says of the damage: probability, mean and standard deviation per zone, and how well they explain it.

Symbols: ``x`` centred block means [1], ``V``, ``lam`` axes and variances of the principal components, ``c`` components,
``r`` what lies outside them, ``s`` noise of a block mean, all in units of ``Components.unit``; ``P``, ``m``, ``sd``
probability, mean and standard deviation of the damage of a damaged zone [1].

``judge_window`` is the definition, as an expression. ``analyse``, ``heads_of`` and ``unexplained`` are the same in NumPy for
many cases at once, as training needs it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from ..variables import results_of
from .features import Components, block_means, difference_noise
from .networks import LEAST_SPREAD, Perceptron, ResidualNetwork
from .posterior_artifact import HEADS, PosteriorArtifact, PosteriorWindow

SMALL_CHANCE = 1e-3  # of damage in a zone that is answered with none, or of none in a damaged one, that still counts
FLOOR = 3e-5  # least noise of a block mean, far below what matters, so that clean records have one too
SPREAD, SPREADS = 0.017, 3.0  # a network can state standard deviations within e^-3 to e^3 times this [1]
ALIVE = 0.1  # of the mean square of the mean record of the training, which a sensor that lives reads beside its noise
Rows = NDArray[Any]  # of single or double precision


@dataclass(frozen=True, slots=True)
class DamagePosterior:
    """Outputs of the detector that one window gives; arrays have shape (z,), z zones.

    Attributes
    ----------
    damage : estimate [1], 0 where damage is less likely than not.
    deviation : standard deviation [1], or a third of what bounds the error, if that is more.
    probability : that there is damage [1].
    misfit : distance from the records of the training; 1 is the largest valid one.
    valid : 1 if the windows are those of the training, misfit is at most 1 and all sensors live, else 0. Each zone has its
        own deviation.
    """

    damage: ca.MX
    deviation: ca.MX
    probability: ca.MX
    misfit: ca.MX
    valid: ca.MX


def judge_window(
    window: PosteriorWindow, block: int, x: ca.MX, noise: ca.MX, known: ca.MX | float = 1.0
) -> tuple[DamagePosterior, ca.MX]:
    r"""Write what follows from a window.

    Parameters
    ----------
    window : PosteriorWindow
        Trained network.
    block : int
        Samples of a block.
    x : casadi.MX, shape (sensors, M)
        Centred block means [1].
    noise : casadi.MX, shape (sensors,)
        Standard deviations [1] of the noise of a sample by fourth differences.
    known : casadi.MX or float, scalar
        1 if the window is one of those that the network was trained for, else 0.

    Returns
    -------
    DamagePosterior
        The outputs.
    casadi.MX, shape (4,)
        The parts of the misfit before they are divided by their limits.

    Notes
    -----
    What the network says of a record and of its images, if there are any, is averaged.
    The features are the components as a Wiener filter leaves them, :math:`z_k = c_k \sqrt{\lambda_k} / (\lambda_k + s^2)`,
    and :math:`\log_{10} s`. The noise s is that outside the components, where there is no strain.

    With probability P the damage of a zone is normal with mean m and standard deviation sd, else it is 0. ``damage`` is m if
    P is 1/2 or more, else 0: near the median of the mixture, which has the least absolute error. ``deviation`` is the
    standard deviation of the mixture, which says little of a rare and large error: where the other case has a chance
    above ``SMALL_CHANCE``, it is at least a third of the error that there is then, m, or m + 3 sd of a missed damage.

    ``misfit`` is the largest of four ratios, each divided by its limit: what lies outside the components of a sensor over
    its noise by fourth differences and what clean records have there; what a decoder of the answer leaves of the
    components over noise and decoder error; the components over their variances; and the noise by fourth differences, which
    errors of sensors do not raise, over that of the training.
    """
    lam = ca.DM(window.variances)
    c, r = components(window, x)
    outside, freedom = ca.sum2(r**2), degrees_of_freedom(window)
    s2 = ca.sum1(outside) / freedom.sum() + FLOOR**2
    features = ca.vertcat(c * ca.sqrt(lam) / (lam + s2), 0.5 * ca.log10(s2) + 3.5)
    signs = image_signs(window.signs, window.sectors)
    images = ca.repmat(features, 1, signs.shape[1]) * ca.DM(signs)
    hidden, all_heads = residual_network(window.encoder, images)
    orders = head_orders(window.images)
    heads = sum(all_heads[order.tolist(), k] for k, order in enumerate(orders)) / len(orders)
    P, m, sd = posterior(*ca.vertsplit(heads, window.zones))
    damage = ca.if_else(P >= 0.5, m, 0.0)
    given = ca.vertcat(damage, ca.DM(window.latent).T @ hidden[:, 0])
    largest = c[explained(window.variances, window.scales.size).tolist()]
    left = ca.DM(window.directions).T @ (largest - perceptron(window.decoder, given) * ca.DM(window.scales))
    ratios = ca.vertcat(
        ca.mmax(outside / ca.DM(freedom) / ((noise / window.unit[0]) ** 2 / block + window.rest[0] ** 2)),
        ca.sum1(left**2 / (s2 + ca.DM(window.errors) ** 2)) / left.numel(),
        ca.sum1(c**2 / (lam + s2)) / lam.numel(),
        ca.mmax(noise) / window.unit[0],
    )
    other = ca.if_else(ca.fmin(P, 1.0 - P) > SMALL_CHANCE, m / 3.0 + (P < 0.5) * sd, 0.0)
    deviation = ca.fmax(ca.sqrt(P * sd**2 + P * (1.0 - P) * m**2), other)
    misfit = ca.mmax(ratios / ca.DM(window.limits))
    swing = ca.sum2(x**2) / x.shape[1] - noise**2 / block
    alive = ca.mmin(swing - ALIVE * np.mean((window.unit[0] * window.mean) ** 2, axis=1)) >= 0.0
    return DamagePosterior(damage, deviation, P, misfit, known * alive * (misfit <= 1.0)), ratios


def residual_network(arrays: Sequence[Matrix], x: ca.MX) -> tuple[ca.MX, ca.MX]:
    """Write the last values and the outputs of ``ResidualNetwork``, a column per column of its inputs."""

    def silu(a: ca.MX) -> ca.MX:
        return a / (1.0 + ca.exp(-a))

    layers = [(ca.DM(W).T, ca.DM(b)) for W, b in zip(arrays[::2], arrays[1::2], strict=True)]
    h = silu(layers[0][0] @ x + layers[0][1])
    mean, ones = ca.DM.ones(1, h.shape[0]) / h.shape[0], ca.DM.ones(h.shape[0], 1)
    for W, b in layers[1:-1]:
        centred = h - ones @ (mean @ h)
        y = centred / (ones @ ca.sqrt(mean @ centred**2 + LEAST_SPREAD))
        h = h + silu(W @ y + b)
    return h, layers[-1][0] @ h + layers[-1][1]


def perceptron(arrays: Sequence[Matrix], x: ca.MX) -> ca.MX:
    """Write the output of a ``Perceptron``."""
    *hidden, W, b = map(ca.DM, arrays)
    for k in range(0, len(hidden), 2):
        x = ca.tanh(hidden[k].T @ x + hidden[k + 1])
    return W.T @ x + b


def head_orders(images: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return where each head of a record stands among those of each of its images, shape (m, 3 z)."""
    m, zones = images.shape
    return np.asarray((np.argsort(images)[:, None, :] + zones * np.arange(HEADS)[:, None]).reshape(m, -1))


def explained(variances: Vector, count: int) -> NDArray[np.int64]:
    """Return which components have the largest variances, in their order."""
    return np.sort(np.argsort(-variances, kind="stable")[:count])


def posterior(logit: ca.MX, mean: ca.MX, spread: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
    """Turn heads, shape (z,) each, into probability, and mean and standard deviation of the damage of a damaged zone."""
    return (1.0 / (1.0 + ca.exp(-logit)), ca.fmax(mean, 0.0), SPREAD * ca.exp(ca.fmax(-SPREADS, ca.fmin(SPREADS, spread))))


def degrees_of_freedom(parts: Components) -> Vector:
    """Count what the components leave of the centred block means of each sensor, shape (sensors,)."""
    return np.asarray(len(parts.axes) - 1.0 - np.sum(parts.modes[parts.sectors.astype(int)] ** 2, axis=0))


def image_signs(signs: Matrix, sectors: Vector) -> Matrix:
    """Return the signs of the features in each image, shape (K + 1, images), from those of the modes."""
    return np.vstack([signs[:, sectors.astype(int)].T, np.ones(len(signs))])


def components(window: PosteriorWindow, x: ca.MX) -> tuple[ca.MX, ca.MX]:
    """Write the components of block means, shape (K,), and what they leave of them, shape (sensors, M)."""
    y = ca.DM(window.modes) @ (x / window.unit[0] - ca.DM(window.mean))
    parts, left = [], []
    for sector in range(len(window.modes)):
        axes = window.axes[:, window.sectors == sector]
        V = ca.MX(ca.DM(axes))  # one constant for both products
        parts.append(y[sector, :] @ V if axes.size else ca.MX(1, 0))
        left.append(y[sector, :] - (V @ parts[-1].T).T if axes.size else y[sector, :])
    return ca.horzcat(*parts).T, ca.DM(window.modes).T @ ca.vertcat(*left)


def judge_records(artifact: PosteriorArtifact, number: int, records: Matrix) -> dict[str, Matrix]:
    """Judge many records of one window of a detector.

    Parameters
    ----------
    artifact : PosteriorArtifact
        Trained detector.
    number : int
        Window, from 0.
    records : ndarray, shape (n, sensors, samples)
        Strains [1].

    Returns
    -------
    dict
        The fields of ``DamagePosterior``, shape (n, z) or (n,), and ``ratios``, shape (n, 4).
    """
    return records_judged(artifact.windows[number], artifact.block, records)


def records_judged(window: PosteriorWindow, block: int, records: Matrix) -> dict[str, Matrix]:
    """Judge many records of a window with blocks of some samples; see ``judge_records``."""
    sensors, M = window.mean.shape
    x, noise = ca.MX.sym("x", sensors * M), ca.MX.sym("noise", sensors)
    outputs, ratios = judge_window(window, block, ca.reshape(x, M, sensors).T, noise)
    named = {**results_of(outputs), "ratios": ratios}
    judge = ca.Function("judge", [x, noise], list(named.values()))
    found = judge(block_means(records, block).reshape(len(records), -1).T, difference_noise(records).T)
    result = {name: np.array(value.T) for name, value in zip(named, found, strict=True)}
    return result | {"misfit": result["misfit"][:, 0], "valid": result["valid"][:, 0] > 0.5}


class Features(NamedTuple):
    """Features of the network, shape (n, K + 1), components, shape (n, K), and variance of the noise, shape (n, 1)."""

    features: Rows
    c: Rows
    s2: Rows


def analyse(parts: Components, x: Rows) -> Features:
    """Return the features of block means [1], shape (n, sensors, M)."""
    y = np.tensordot(parts.scaled(x), parts.modes, (1, 1))  # (n, M, sensors)
    c = np.empty((len(x), len(parts.sectors)))
    outside = np.sum(y * y, axis=(1, 2))
    for sector in range(len(parts.modes)):
        some = parts.sectors == sector
        V = parts.axes[:, some]
        c[:, some] = y[:, :, sector] @ V
        left = y[:, :, sector] - c[:, some] @ V.T
        outside += np.sum(left * left, axis=1) - np.sum(y[:, :, sector] ** 2, axis=1)
    s2 = outside[:, None] / degrees_of_freedom(parts).sum() + FLOOR**2
    return Features(features(parts.variances, c, s2), c, s2)


def features(lam: Rows, c: Rows, s2: Rows) -> Rows:
    """Return the features of components, shape (n, K), and the variance of the noise, shape (n, 1)."""
    return np.hstack([c * np.sqrt(lam) / (lam + s2), 0.5 * np.log10(s2) + s2.dtype.type(3.5)])


def all_heads(net: ResidualNetwork, features: Rows, signs: Rows, images: NDArray[np.int64]) -> Rows:
    """Evaluate the heads, shape (n, 3 z), averaged over the images of the features."""
    heads = [net.values(features * sign)[-1][:, order] for sign, order in zip(signs.T, head_orders(images), strict=True)]
    return np.asarray(sum(heads) / len(heads))


def deviation(spread: Rows) -> Rows:
    """Return the standard deviation [1] that the third head states."""
    return np.asarray(SPREAD * np.exp(np.clip(spread, -SPREADS, SPREADS)), spread.dtype)


def damage_of(heads: Rows) -> Rows:
    """Return the estimated damage [1], shape (n, z), that heads, shape (n, 3 z), state."""
    logit, mean, _ = np.split(heads, HEADS, axis=1)
    return np.asarray(np.where(logit >= 0.0, np.clip(mean, 0.0, 1.0), 0.0))


def heads_of(window: PosteriorWindow, found: Features) -> Matrix:
    """Evaluate the heads, shape (n, 3 z), of a window."""
    net, signs = ResidualNetwork(list(window.encoder)), image_signs(window.signs, window.sectors)
    return all_heads(net, found.features, signs, window.images)


def unexplained(window: PosteriorWindow, found: Features) -> Matrix:
    """Return what the decoder of the answer leaves of the components of largest variance, shape (n, E)."""
    hidden = ResidualNetwork(list(window.encoder)).values(found.features)[-2]
    given = np.hstack([damage_of(heads_of(window, found)), hidden @ window.latent])
    largest = found.c[:, explained(window.variances, window.scales.size)]
    return largest - Perceptron(list(window.decoder)).values(given)[-1] * window.scales

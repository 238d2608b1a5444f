"""What one window says of the damage: probability, mean and standard deviation per zone, and how well they explain it.

Symbols: ``x`` centred block means [1], ``V``, ``lam`` axes and variances of the principal components, ``c`` components,
``r`` what lies outside them, ``s`` noise of a block mean, all in units of ``Components.unit``; ``P``, ``m``, ``sd``
probability, mean and standard deviation of the damage of a damaged zone [1].

``judge_window`` is the definition, as an expression. ``analyse``, ``heads_of`` and ``unexplained`` are the same in NumPy for
many cases at once, as training needs it.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any, NamedTuple, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from ..variables import pack, results_of
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


Judging: TypeAlias = Generator[list[ca.MX], list[ca.MX], tuple[DamagePosterior, ca.MX]]
Product: TypeAlias = Generator[list[ca.MX], list[ca.MX], list[ca.MX]]


def judge_window(
    window: PosteriorWindow, block: int, x: ca.MX, noise: ca.MX, known: ca.MX | float = 1.0
) -> tuple[DamagePosterior, ca.MX]:
    """Write what follows from a window at once, see ``judging``."""
    stages, values = judging(window, block, x, noise, ca.MX(known)), None
    while True:
        try:
            values = next(stages) if values is None else stages.send(values)
        except StopIteration as end:
            judged: tuple[DamagePosterior, ca.MX] = end.value
            return judged


def judged_in_slices(window: PosteriorWindow, block: int, most: int) -> list[ca.Function]:
    """Write what follows from a window as functions of each other's results, each of some multiplications at most.

    Parameters
    ----------
    window, block
        As of ``judging``.
    most : int
        Multiplications of numbers of the network in a function.

    Returns
    -------
    list of casadi.Function
        The first takes block means, shape (sensors M,), noise and ``known`` as one column; the last gives a
        ``DamagePosterior``.
    """
    sensors, M = window.mean.shape
    column = ca.MX.sym("live", sensors * M + sensors + 1)
    x, noise, known = ca.vertsplit(column, [0, sensors * M, sensors * M + sensors, column.numel()])
    stages, found, values = judging(window, block, ca.reshape(x, sensors, M), noise, known, most), list[ca.Function](), None
    while True:
        try:
            results = next(stages) if values is None else stages.send(values)
        except StopIteration as end:
            return [*found, ca.Function("slice", [column], [pack(end.value[0])])]
        found.append(ca.Function("slice", [column], [ca.vertcat(*map(ca.vec, results))]))
        column = ca.MX.sym("live", found[-1].nnz_out(0))
        ends = accumulate((each.numel() for each in results), initial=0)
        parts = ca.vertsplit(column, list(ends))
        values = [ca.reshape(part, each.shape) for part, each in zip(parts, results, strict=True)]


def judging(window: PosteriorWindow, block: int, x: ca.MX, noise: ca.MX, known: ca.MX, most: int | None = None) -> Judging:
    r"""Write what follows from a window; yield all that is needed later where a step may end, and go on with what is sent.

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
    most : int or None
        Multiplications of numbers of the network between two yields; None for any number.

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
    lam, freedom = ca.DM(window.variances), degrees_of_freedom(window)
    swing = ca.sum2(x**2) / x.shape[1] - noise**2 / block
    alive = ca.mmin(swing - ALIVE * np.mean((window.unit[0] * window.mean) ** 2, axis=1)) >= 0.0
    c, outside, noise, good = yield from components(window, x, [noise, known * alive], most)
    s2 = ca.sum1(outside) / freedom.sum() + FLOOR**2
    features = ca.vertcat(c * ca.sqrt(lam) / (lam + s2), 0.5 * ca.log10(s2) + 3.5)
    signs = image_signs(window.signs, window.sectors)
    rest, heads, first = [c, outside, noise, good], list[ca.MX](), list[ca.MX]()
    columns = [list(range(signs.shape[1]))] if most is None else [[k] for k in range(signs.shape[1])]
    for each in columns:
        images = ca.repmat(features, 1, len(each)) * ca.DM(signs[:, each])
        kept = [features, *heads, *first, *rest]
        h, out, features, *others = yield from residual_network(window.encoder, images, kept, most)
        heads, first, rest = [*others[: len(heads)], out], (first and others[len(heads) :][:1]) or [h[:, 0]], others[-4:]
    c, outside, noise, good = rest
    s2 = ca.sum1(outside) / freedom.sum() + FLOOR**2
    all_heads, orders = ca.horzcat(*heads), head_orders(window.images)
    heads_of_record = sum(all_heads[order.tolist(), k] for k, order in enumerate(orders)) / len(orders)
    P, m, sd = posterior(*ca.vertsplit(heads_of_record, window.zones))
    damage = ca.if_else(P >= 0.5, m, 0.0)
    given = ca.vertcat(damage, ca.DM(window.latent).T @ first[0])
    decoded = perceptron(window.decoder, given)
    if most is not None:
        heads_of_record, decoded, c, outside, noise, good = yield [heads_of_record, decoded, c, outside, noise, good]
        s2 = ca.sum1(outside) / freedom.sum() + FLOOR**2
        P, m, sd = posterior(*ca.vertsplit(heads_of_record, window.zones))
        damage = ca.if_else(P >= 0.5, m, 0.0)
    largest = c[explained(window.variances, window.scales.size).tolist()]
    left = ca.DM(window.directions).T @ (largest - decoded * ca.DM(window.scales))
    ratios = ca.vertcat(
        ca.mmax(outside / ca.DM(freedom) / ((noise / window.unit[0]) ** 2 / block + window.rest[0] ** 2)),
        ca.sum1(left**2 / (s2 + ca.DM(window.errors) ** 2)) / left.numel(),
        ca.sum1(c**2 / (lam + s2)) / lam.numel(),
        ca.mmax(noise) / window.unit[0],
    )
    other = ca.if_else(ca.fmin(P, 1.0 - P) > SMALL_CHANCE, m / 3.0 + (P < 0.5) * sd, 0.0)
    deviation = ca.fmax(ca.sqrt(P * sd**2 + P * (1.0 - P) * m**2), other)
    misfit = ca.mmax(ratios / ca.DM(window.limits))
    return DamagePosterior(damage, deviation, P, misfit, good * (misfit <= 1.0)), ratios


def product(W: Matrix, h: ca.MX, kept: list[ca.MX], most: int | None) -> Product:
    """Write the product of a matrix and columns, row by row so far as it is long; return it before what is kept."""
    rows = W.shape[0] if most is None else max(1, most // (W.shape[1] * h.shape[1]))
    found: list[ca.MX] = []
    for begin in range(0, W.shape[0], rows):
        if begin:
            values = yield [*found, h, *kept]
            found, h, kept = values[: len(found)], values[len(found)], values[len(found) + 1 :]
        found.append(ca.DM(W[begin : begin + rows]) @ h)
    if most is not None:
        values = yield [*found, *kept]
        found, kept = values[: len(found)], values[len(found) :]
    return [ca.vertcat(*found), *kept]


def residual_network(arrays: Sequence[Matrix], x: ca.MX, kept: list[ca.MX], most: int | None) -> Product:
    """Write the last values and the outputs of ``ResidualNetwork``, a column per column of its inputs; see ``product``."""

    def silu(a: ca.MX) -> ca.MX:
        return a / (1.0 + ca.exp(-a))

    layers = [(W.T, ca.DM(b)) for W, b in zip(arrays[::2], arrays[1::2], strict=True)]
    a, *kept = yield from product(layers[0][0], x, kept, most)
    h = silu(a + layers[0][1])
    mean, ones = ca.DM.ones(1, h.shape[0]) / h.shape[0], ca.DM.ones(h.shape[0], 1)
    for W, b in layers[1:-1]:
        centred = h - ones @ (mean @ h)
        y = centred / (ones @ ca.sqrt(mean @ centred**2 + LEAST_SPREAD))
        a, h, *kept = yield from product(W, y, [h, *kept], most)
        h = h + silu(a + b)
    a, h, *kept = yield from product(layers[-1][0], h, [h, *kept], most)
    return [h, a + layers[-1][1], *kept]


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


def components(window: PosteriorWindow, x: ca.MX, kept: list[ca.MX], most: int | None) -> Product:
    """Write the components of block means, shape (K,), and squares of what they leave of them, shape (sensors,)."""
    y = ca.DM(window.modes) @ (x / window.unit[0] - ca.DM(window.mean))
    parts, left = list[ca.MX](), list[ca.MX]()
    for sector in range(len(window.modes)):
        axes, k = window.axes[:, window.sectors == sector], len(left)
        if not axes.size:
            parts, left = [*parts, ca.MX(0, 1)], [*left, y[sector, :]]
            continue
        part, y, *others = yield from product(axes.T, y[sector, :].T, [y, *parts, *left, *kept], most)
        parts, left, kept = [*others[: len(parts)], part], others[len(parts) :][:k], others[len(parts) + k :]
        near, y, *others = yield from product(axes, part, [y, *parts, *left, *kept], most)
        parts, left, kept = (
            others[: len(parts)],
            [*others[len(parts) :][:k], y[sector, :] - near.T],
            others[len(parts) + k :],
        )
    outside = ca.DM(window.modes).T @ ca.vertcat(*left)
    return [ca.vertcat(*parts), ca.sum2(outside**2), *kept]


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

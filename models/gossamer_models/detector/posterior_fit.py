r"""Fit the networks of a window: the one for the damage, and the decoder that tells whether its answer explains the record.

Symbols: ``n`` cases, ``c`` components [1], ``s2`` variance of the noise of a block mean [1], ``lam`` variances of the
components, ``d`` damage [1], ``P``, ``m``, ``sd`` probability, mean and standard deviation of the damage of a damaged zone
[1], ``g`` gradients. Everything stays in the space of the components, where white noise is white.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector
from ..campaign.symmetry import Symmetry
from . import posterior
from .features import Components, block_means
from .networks import Adam, Perceptron, ResidualNetwork, Rows32
from .posterior_records import SOME, Sensing, Training, Windows, coloured_noise, noise_levels, unit_errors

BETA = 0.5  # of the weight sd^(2 beta) in the loss of the mean
FAR = 6.0  # standard deviations beyond which a case pulls no more
COLOURED_DRAWS = 1024
ERRORS = 8192  # cases, at most, that have an error of their sensors at hand
WRONG_GAIN = (0.6, 1.4)  # of a spoilt sensor [1]
GAIN_SHARE, DEAD_SHARE = 0.5, 0.15  # of the spoilt records; in the others two sensors are swapped
WARMING = 200  # steps until the rate is full, or a tenth of all
LOSSES = 100  # parts of the steps that losses are averaged over


def loss_gradient(heads: Rows32, d: Rows32) -> tuple[float, Rows32]:
    r"""Return the negative log likelihood per case and the gradient of the loss with respect to the heads.

    Notes
    -----
    The likelihood of a zone is :math:`1 - P` if it is undamaged, else :math:`P` times the normal density of its damage. The
    gradients of mean and deviation have the weight :math:`sd^{2\beta}` of [1]_, without which cases with a large deviation
    are never learned, and cases beyond ``FAR`` deviations pull as if they were there.

    References
    ----------
    .. [1] M. Seitzer, A. Tavakoli, D. Antic, G. Martius, On the pitfalls of heteroscedastic uncertainty estimation with
       probabilistic neural networks, ICLR, 2022, arXiv:2203.09168.
    """
    logit, mean, spread = np.split(heads, 3, axis=1)
    damaged = (d > 0.0).astype(np.float32)
    P = 1.0 / (1.0 + np.exp(-logit))
    sd = posterior.deviation(spread)
    u = (mean - d) / sd
    near = np.clip(u, -FAR, FAR)
    weight = damaged * (sd / np.float32(0.05)) ** np.float32(2.0 * BETA)
    likelihood = np.logaddexp(0.0, np.where(damaged > 0.0, -logit, logit)) + damaged * (0.5 * u * u + np.log(sd))
    g_spread = weight * (1.0 - near * near)
    g_spread *= (np.abs(spread) < posterior.SPREADS) | (g_spread * spread > 0.0)  # values beyond the ends come back
    g = np.hstack([P - damaged, weight * near / sd, g_spread])
    return float(likelihood.sum(axis=1).mean()), g / np.float32(len(d))


def spoilt_sensors(gains: Vector, random: np.random.Generator) -> tuple[Vector, NDArray[np.int64]]:
    """Spoil a sensor of each record: it has a wrong gain, is dead, or is swapped with another one, if there is one.

    Parameters
    ----------
    gains : ndarray, shape (n, s)
        Gains [1].
    random : numpy.random.Generator
        Source of which and how.

    Returns
    -------
    gains : ndarray, shape (n, s)
        Gains of what the inputs of the detector get [1].
    sensors : ndarray of int, shape (n, s)
        Which sensor each of them gets.
    """
    n, s = gains.shape
    first, second = random.permuted(np.tile(np.arange(s), (n, 1)), axis=1)[:, [0, min(1, s - 1)]].T
    rows, kind = np.arange(n), random.random(n)
    factor = np.where(kind < GAIN_SHARE, random.uniform(*WRONG_GAIN, n), np.where(kind < GAIN_SHARE + DEAD_SHARE, 0.0, 1.0))
    gains = gains.copy()
    gains[rows, first] *= factor
    sensors = np.tile(np.arange(s), (n, 1))
    swapped = rows[kind >= GAIN_SHARE + DEAD_SHARE]
    sensors[swapped, first[swapped]], sensors[swapped, second[swapped]] = second[swapped], first[swapped]
    return gains, sensors


class Drawn(NamedTuple):
    """Components with and without noise, shape (n, K), variance of the noise, shape (n, 1), and damage, shape (n, z)."""

    noisy: Rows32
    clean: Rows32
    s2: Rows32
    damage: Rows32


class NetworkFit:
    """What both networks of a window learn from; every case and its images.

    Parameters
    ----------
    parts : Components
        Principal components.
    x : ndarray, shape (n, s, M)
        Clean block means [1]; they are projected.
    train : Windows
        The cases.
    sensing, training
        Gain and noise, and settings.
    symmetry : Symmetry
        Images of the structure.

    Attributes
    ----------
    c : ndarray of float32, shape (n, s, K)
        Clean signal of each sensor along each axis, its mean not removed.
    mean : ndarray of float32, shape (K,)
        Components of the mean.
    energy, overlap : ndarray, shapes (n, s) and (n, s, s)
        Squares of a sensor's block means, and their products with the mean of every sensor, summed over the window.
    error : ndarray of float32, shape (e, s, K)
        An error of each sensor, as large as the range of what it feels, along each axis, of the first cases; a draw has some
        of it, or of its negative.
    error_energy, error_product, error_overlap : ndarray, shapes (e, s), (e, s) and (e, s, s)
        Its squares, and its products with the sensor's block means and with the mean of every sensor.
    damage : ndarray of float32, shape (n, z)
        Damage [1].
    noise : tuple of ndarray, shapes (m, K) and (m,)
        Components and outside of coloured noise.
    random : numpy.random.Generator
        Source of everything random.
    """

    def __init__(
        self, parts: Components, x: Rows32, train: Windows, sensing: Sensing, training: Training, symmetry: Symmetry
    ) -> None:
        self.parts, self.sensing, self.training, self.symmetry = parts, sensing, training, symmetry
        self.random = random = np.random.default_rng((training.seed, 1))
        x = x / np.float32(parts.unit[0])
        self.c, self.damage = x @ parts.axes.astype("f4"), train.damage.astype("f4")
        self.freedom = float(posterior.degrees_of_freedom(parts).sum())
        unit = block_means(coloured_noise((COLOURED_DRAWS, *train.records.shape[1:]), random), training.block)
        found = posterior.analyse(parts, parts.unit * (unit + parts.mean))
        self.noise = found.c.astype("f4"), (found.s2[:, 0] * self.freedom).astype("f4")
        self._shares = np.asarray(parts.modes[parts.sectors.astype(int)].T, np.float32)  # of each sensor in each component
        self.mean = np.sum((parts.mean @ parts.axes) * self._shares, axis=0).astype("f4")
        self.energy, self.overlap = np.einsum("nsm,nsm->ns", x, x, dtype=float), x @ parts.mean.T
        some = x[: ERRORS if sensing.error.limits(0.0)[1] > 0.0 else 0]
        off = [unit_errors(some[k : k + SOME], random) for k in range(0, len(some), SOME)]
        errors = np.concatenate([some[:0], *off])
        self.error = errors @ parts.axes.astype("f4")
        self.error_energy, self.error_product = (np.einsum("nsm,nsm->ns", e, errors, dtype=float) for e in (errors, some))
        self.error_overlap = errors @ parts.mean.T

    def draw(self, n: int, spoilt: float) -> Drawn:
        """Draw cases, their images, gain and noise, and in a share of the records a spoilt sensor."""
        random, symmetry, s = self.random, self.symmetry, self.c.shape[1]
        rows, image = random.integers(0, len(self.c), n), random.integers(0, len(symmetry.zones), n)
        gains, sensors = self.sensing.gains((n, s), random), np.tile(np.arange(s), (n, 1))
        errors = self.sensing.errors((n, s), random) if len(self.error) else np.zeros((n, s))
        off = errors.any(axis=1)
        rows[off] %= max(len(self.error), 1)
        errors *= np.where(random.random((n, 1)) < 0.5, 1.0, -1.0)
        spoil = np.less(random.random(n), spoilt)
        gains[spoil], sensors[spoil] = spoilt_sensors(gains[spoil], random)
        clean, outside = self.read(rows, np.take_along_axis(symmetry.sensors[image], sensors, axis=1), gains, errors)
        level, coloured = noise_levels(n, random)
        level = (level / np.sqrt(self.training.block)).astype(np.float32)
        noise: Rows32 = random.standard_normal(clean.shape, np.float32)
        energy: Vector = np.asarray(random.chisquare(self.freedom, n))
        draw = random.integers(0, len(self.noise[1]), int(coloured.sum()))
        flip = np.where(random.random((len(draw), 1)) < 0.5, 1.0, -1.0).astype(np.float32)
        noise[coloured] = self.noise[0][draw] * flip * np.float32(np.sqrt(self.training.block))
        energy[coloured] = self.noise[1][draw] * self.training.block
        s2 = ((outside + level**2 * energy) / self.freedom + posterior.FLOOR**2).astype(np.float32)
        damage = self.damage[rows[:, None], symmetry.zones[image]]
        return Drawn(clean + level[:, None] * noise, clean, s2[:, None], damage)

    def read(
        self, rows: NDArray[np.int64], sensors: NDArray[np.int64], gains: Vector, errors: Vector
    ) -> tuple[Rows32, Vector]:
        """Return clean components, shape (n, K), and what they leave, shape (n,), as sensors with gains and errors read.

        Parameters
        ----------
        rows : ndarray of int, shape (n,)
            Cases.
        sensors : ndarray of int, shape (n, s)
            Which sensor each input of the detector gets.
        gains, errors : ndarray, shape (n, s)
            Gains [1], and sizes of the errors over the range of what the sensor feels [1].
        """
        own, rows = np.arange(sensors.shape[1]), rows[:, None]
        clean = np.einsum("ns,nsk,sk->nk", gains.astype(np.float32), self.c[rows, sensors], self._shares) - self.mean
        total = np.sum(gains**2 * self.energy[rows, sensors], axis=1) + np.sum(self.parts.mean**2)
        total -= 2.0 * np.sum(gains * self.overlap[rows, sensors, own], axis=1)
        off = errors.any(axis=1)
        at, e, g = (rows[off], sensors[off]), errors[off], gains[off]
        clean[off] += np.einsum("ns,nsk,sk->nk", e.astype(np.float32), self.error[at], self._shares)
        total[off] += np.sum(e**2 * self.error_energy[at] + 2.0 * e * g * self.error_product[at], axis=1)
        total[off] -= 2.0 * np.sum(e * self.error_overlap[(*at, own)], axis=1)
        return clean, np.maximum(total - np.sum(clean.astype(float) ** 2, axis=1), 0.0)

    def rest(self) -> float:
        """Return the root mean square of what clean records have outside the components, per degree of freedom."""
        n, s = self.energy.shape
        gains = self.sensing.gains((n, s), self.random)
        _, outside = self.read(np.arange(n), np.tile(np.arange(s), (n, 1)), gains, np.zeros((n, s)))
        return float(np.sqrt(outside.mean() / self.freedom + posterior.FLOOR**2))

    def _batches(self, steps: int, spoilt: float) -> Iterator[tuple[float, Drawn, Rows32]]:
        """Draw batches; give the step size of Adam and their features, too."""
        t, lam = self.training, self.parts.variances.astype(np.float32)
        warming = min(WARMING, 1 + steps // 10)
        for k in range(steps):
            drawn = self.draw(t.batch, spoilt)
            rate = 0.5 * t.rate * min(1.0, (k + 1) / warming) * (1.0 + np.cos(np.pi * k / steps))
            yield rate, drawn, posterior.features(lam, drawn.noisy, drawn.s2)

    def network(self, net: ResidualNetwork, steps: int, report: Callable[[], None]) -> list[float]:
        """Train the network for the damage, in place; return means of ``loss_gradient`` over equal parts of the steps."""
        adam, losses = Adam(net.arrays), []
        for rate, drawn, features in self._batches(steps, self.training.spoilt):
            values = net.values(features)
            loss, gradient = loss_gradient(values[-1], drawn.damage)
            adam.step(net.gradients(values, gradient), rate)
            losses.append(loss)
            report()
        return [float(part.mean()) for part in np.array_split(losses, min(LOSSES, steps))]

    def decoder(self, net: ResidualNetwork, scales: Vector, report: Callable[[], None]) -> tuple[Perceptron, Rows32]:
        """Train the decoder on what the network, which stays as it is, makes of noisy records, towards the clean ones."""
        t, unit, zones = self.training, scales.astype(np.float32), self.damage.shape[1]
        largest = posterior.explained(self.parts.variances, len(scales))
        decoder = Perceptron.random((zones + t.latent, t.inner, len(scales)), self.random)
        latent = (self.random.standard_normal((t.width, t.latent)) / np.sqrt(t.width)).astype(np.float32)
        adam = Adam([*decoder.arrays, latent])
        for rate, drawn, features in self._batches(t.decoder_steps, 0.0):
            *_, hidden, heads = net.values(features)
            values = decoder.values(np.hstack([posterior.damage_of(heads), hidden @ latent]))
            wrong = (values[-1] - drawn.clean[:, largest] / unit) / np.float32(t.batch)
            gradients, g_in = decoder.gradients(values, wrong)
            adam.step([*gradients, hidden.T @ g_in[:, zones:]], rate)
            report()
        return decoder, latent

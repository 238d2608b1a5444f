r"""Fit the networks of a window: the one for the damage, and the decoder that tells whether its answer explains the record.

Symbols: ``n`` cases, ``c`` components [1], ``s2`` variance of the noise of a block mean [1], ``lam`` variances of the
components, ``d`` damage [1], ``P``, ``m``, ``sd`` probability, mean and standard deviation of the damage of a damaged zone
[1], ``g`` gradients, ``f`` polynomials of damage, ``W`` their coefficients. Everything stays in the space of the components,
where white noise is white.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector
from ..campaign.symmetry import Symmetry
from . import posterior
from .features import Components, block_means
from .networks import Adam, FuzzyRules, Perceptron, Rows32, batches
from .posterior_artifact import HEADS
from .posterior_records import Sensing, Training, Windows, coloured_noise, noise_levels

BETA = 0.5  # of the weight sd^(2 beta) in the loss of the mean
FAR = 4.0  # standard deviations beyond which a case pulls no more
COLOURED_DRAWS = 1024
WRONG_GAIN = (0.6, 1.4)  # of a spoilt sensor [1]
GAIN_SHARE, DEAD_SHARE = 0.5, 0.15  # of the spoilt records; in the others two sensors are swapped
WORST_POLYNOMIALS = 0.3  # residual over deviation of the components up to which cases are moved by polynomials
MOST_TERMS = 1000  # of the polynomials: more take longer than they are worth


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
    g_spread = weight * (1.0 - near * near) * (np.abs(spread) < posterior.SPREADS)
    g = np.hstack([P - damaged, weight * near / sd * np.float32(0.05), g_spread])
    return float(likelihood.sum(axis=1).mean()), g / np.float32(len(d))


def polynomials(d: Rows32) -> Rows32:
    """Return powers of the damages and products of two of them, shape (n, ``terms``)."""
    i, j = np.triu_indices(d.shape[1], 1)
    pairs = d[:, i] * d[:, j]
    powers = [d**k for k in range(1, 6)]
    return np.hstack([np.ones((len(d), 1), d.dtype), *powers, pairs, pairs * d[:, i], pairs * d[:, j]])


def terms(zones: int) -> int:
    """Count the polynomials of some damages."""
    return 1 + 5 * zones + 3 * (zones * (zones - 1) // 2)


@dataclass(frozen=True)
class Moves:
    """Cases that differ in damage alone, and their components as polynomials of it.

    Attributes
    ----------
    cases : ndarray of int
        Damaged since more than a window. None if the polynomials do not describe them.
    W : ndarray of float32, shape (terms, s K)
        Coefficients.
    """

    cases: NDArray[np.int64]
    W: Rows32

    @classmethod
    def of(cls, damage: Rows32, c: Rows32, cases: NDArray[np.int64], shift: NDArray[np.int64]) -> Moves:
        """Fit the polynomials to some of all cases; windows of each shift have a mean of their own."""
        none = cls(cases[:0], np.zeros((0, 0), np.float32))
        count = terms(damage.shape[1])
        if len(cases) < 2 * count or count > MOST_TERMS:
            return none
        f, target = polynomials(damage[cases].astype(float)), c[cases].reshape(len(cases), -1).astype(float)
        for which in np.unique(shift[cases]):
            some = shift[cases] == which
            f[some] -= f[some].mean(axis=0)
            target[some] -= target[some].mean(axis=0)
        W = np.linalg.lstsq(f, target, rcond=1e-8)[0]
        left = np.mean((target - f @ W) ** 2) / np.mean(target**2)
        return cls(cases, W.astype(np.float32)) if left < WORST_POLYNOMIALS**2 else none


def _other_damage(damage: Rows32, random: np.random.Generator) -> Rows32:
    """Draw as many zones, others, with other depths from among those of the cases, shape (n, z)."""
    depths = damage[damage > 0.0]
    order = np.argsort(random.random(damage.shape), axis=1)
    drawn = random.uniform(depths.min(), depths.max(), damage.shape)
    return np.where(order < (damage > 0.0).sum(axis=1, keepdims=True), drawn, 0.0).astype(np.float32)


def _shares(parts: Components) -> Rows32:
    """Return the weight of each sensor in each component, shape (s, K)."""
    return np.asarray(parts.modes[parts.sectors.astype(int)].T, np.float32)


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


class NetworkFit:
    """What both networks of a window learn from; every case and its images.

    Parameters
    ----------
    parts : Components
        Principal components.
    x : ndarray, shape (n, s, M)
        Clean block means [1]; they are projected, and polynomials of damage are fitted to them.
    train : Windows
        The cases.
    sensing, training
        Gain and noise, and settings.
    symmetry : Symmetry
        Images of the structure.

    Attributes
    ----------
    c : ndarray of float32, shape (n, s, K)
        Clean signal of each sensor along each axis, its mean not removed; all as ``images`` of the cases.
    mean : ndarray of float32, shape (K,)
        Components of the mean.
    energy, overlap : ndarray, shapes (n, s) and (n, s, s)
        Squares of a sensor's block means, and their products with the mean of every sensor, summed over the window.
    damage : ndarray of float32, shape (n, z)
        Damage [1].
    moves : list of Moves
        How cases can be moved to other damages.
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
        images = len(symmetry.sensors)
        of_images = symmetry.images(x @ parts.axes.astype("f4"), train.damage)
        self.c, self.damage = c, damage = tuple(part.astype("f4") for part in of_images)
        settled = np.tile(train.settled, images) & (damage.max(axis=1) > 0.0)
        shift = np.tile(train.shift, images)
        alike = [np.flatnonzero(settled & (shift == which)) for which in np.unique(shift)]
        if min(map(len, alike)) < 2 * terms(damage.shape[1]):  # of none alone are there enough
            alike = [np.flatnonzero(settled)]
        self.moves = [Moves.of(damage, c, cases, shift) for cases in alike]
        self.freedom = float(posterior.degrees_of_freedom(parts).sum())
        unit = block_means(coloured_noise((COLOURED_DRAWS, *train.records.shape[1:]), random), training.block)
        found = posterior.analyse(parts, parts.unit * (unit + parts.mean))
        self.noise = found.c.astype("f4"), (found.s2[:, 0] * self.freedom).astype("f4")
        shares = _shares(parts)
        self.mean = np.sum((parts.mean @ parts.axes) * shares, axis=0).astype("f4")
        energy, overlap = np.einsum("nsm,nsm->ns", x, x, dtype=float), x.astype(float) @ parts.mean.T
        self.energy, self.overlap = (symmetry.images(part, train.damage)[0] for part in (energy, overlap))

    def epoch(self, virtual: bool, spoilt: float) -> tuple[Rows32, Rows32, Rows32, Rows32]:
        """Draw gain, noise and spoilt sensors of every case.

        Parameters
        ----------
        virtual : bool
            Whether to move most cases to other damages, by the difference of the polynomials.
        spoilt : float
            Share of the records that have a wrong sensor.

        Returns
        -------
        noisy, clean : ndarray, shape (n, K)
            Components with gain, with and without noise.
        s2 : ndarray, shape (n, 1)
            Variance of the noise outside the components.
        damage : ndarray, shape (n, z)
            Damage [1].
        """
        random, damage = self.random, self.damage
        n, s, K = self.c.shape
        spoil = np.less(random.random(n), spoilt)
        gains, sensors = self.sensing.gains((n, s), random), np.tile(np.arange(s), (n, 1))
        gains[spoil], sensors[spoil] = spoilt_sensors(gains[spoil], random)
        clean, outside = self.read(gains, sensors)
        if virtual:
            damage = damage.copy()
            for move in (m for m in self.moves if len(m.cases)):
                moved = move.cases[(random.random(len(move.cases)) < self.training.virtual) & ~spoil[move.cases]]
                damage[moved] = _other_damage(damage[moved], random)
                step = (polynomials(damage[moved]) - polynomials(self.damage[moved])) @ move.W
                clean[moved] += self.summed(gains[moved], step.reshape(-1, s, K))
        level, coloured = noise_levels(n, random)
        level = (level / np.sqrt(self.training.block)).astype(np.float32)
        noise: Rows32 = random.standard_normal((n, K), np.float32)
        energy: Vector = np.asarray(random.chisquare(self.freedom, n))
        draw = random.integers(0, len(self.noise[1]), int(coloured.sum()))
        flip = np.where(random.random((len(draw), 1)) < 0.5, 1.0, -1.0).astype(np.float32)
        noise[coloured] = self.noise[0][draw] * flip * np.float32(np.sqrt(self.training.block))
        energy[coloured] = self.noise[1][draw] * self.training.block
        s2 = (outside + level**2 * energy) / self.freedom + posterior.FLOOR**2
        return clean + level[:, None] * noise, clean, s2[:, None].astype(np.float32), damage

    def read(self, gains: Vector, sensors: NDArray[np.int64]) -> tuple[Rows32, Vector]:
        """Return clean components, shape (n, K), and what they leave, shape (n,), as sensors with gains read them.

        Parameters
        ----------
        gains : ndarray, shape (n, s)
            Gains [1].
        sensors : ndarray of int, shape (n, s)
            Which sensor each input of the detector gets.
        """
        s = sensors.shape[1]
        clean = self.summed(gains, np.take_along_axis(self.c, sensors[:, :, None], axis=1)) - self.mean
        total = np.sum(gains**2 * np.take_along_axis(self.energy, sensors, axis=1), axis=1)
        overlap = self.overlap[np.arange(len(sensors))[:, None], sensors, np.arange(s)]
        total += np.sum(self.parts.mean**2) - 2.0 * np.sum(gains * overlap, axis=1)
        return clean, np.maximum(total - np.sum(clean.astype(float) ** 2, axis=1), 0.0)

    def summed(self, gains: Vector, along: Rows32) -> Rows32:
        """Return the components of signals along all axes, shape (n, s, K), with gains, shape (n, s)."""
        return np.asarray(np.einsum("ns,nsk->nk", gains.astype(np.float32), along * _shares(self.parts)))

    def rest(self) -> float:
        """Return the root mean square of what clean records have outside the components, per degree of freedom."""
        n, s, _ = self.c.shape
        _, outside = self.read(self.sensing.gains((n, s), self.random), np.tile(np.arange(s), (n, 1)))
        return float(np.sqrt(outside.mean() / self.freedom + posterior.FLOOR**2))

    def _batches(self, epochs: int, spoilt: float) -> Iterator[tuple[float, tuple[Rows32, Rows32, Rows32, Rows32]]]:
        """Deal batches of ``epoch``, with the step size of Adam."""
        t, n = self.training, len(self.c)
        per_epoch = max(n // t.batch, 1)
        for epoch in range(epochs):
            drawn = self.epoch(t.virtual > 0.0 and epoch < 0.75 * epochs, spoilt)
            for k, rows in enumerate(batches(n, t.batch, self.random)):
                done = (epoch + k / per_epoch) / epochs
                noisy, clean, s2, damage = (part[rows] for part in drawn)
                yield 0.5 * t.rate * (1.0 + np.cos(np.pi * done)), (noisy, clean, s2, damage)

    def network(self, report: Callable[[], None]) -> tuple[Perceptron | FuzzyRules, list[float]]:
        """Train the network for the damage; return the mean of ``loss_gradient`` in each epoch, too."""
        t, lam = self.training, self.parts.variances.astype(np.float32)
        own = self.symmetry.answered[0]
        net: Perceptron | FuzzyRules
        if t.network == "neuro-fuzzy":
            noisy, _, s2, damage = self.epoch(virtual=False, spoilt=0.0)
            damage = np.hstack([damage[:, own], np.delete(damage, own, axis=1)])
            net = FuzzyRules.of_cases(posterior.features(lam, noisy, s2), damage, own.size, t.references, self.random)
        else:
            net = Perceptron.random((t.components + 1, t.hidden, t.hidden, HEADS * own.size), self.random)
        adam, losses = Adam(net.arrays), []
        for rate, (noisy, _, s2, damage) in self._batches(t.epochs, t.spoilt):
            values = net.values(posterior.features(lam, noisy, s2))
            loss, gradient = loss_gradient(values[-1], damage[:, own])
            adam.step(net.gradients(values, gradient)[0], rate)
            losses.append(loss)
            report()
        return net, np.reshape(losses, (t.epochs, -1)).mean(axis=1).tolist()

    def decoder(self, net: Perceptron | FuzzyRules, scales: Vector, report: Callable[[], None]) -> tuple[Perceptron, Rows32]:
        """Train the decoder on what the network, which stays as it is, makes of noisy records, towards the clean ones."""
        t, lam, unit = self.training, self.parts.variances.astype(np.float32), scales.astype(np.float32)
        signs = posterior.image_signs(self.symmetry.signs(self.parts.modes), self.parts.sectors).astype(np.float32)
        zones, answered = self.damage.shape[1], self.symmetry.answered
        decoder = Perceptron.random((zones + t.latent, t.inner, t.components), self.random)
        hidden_values = net.arrays[-2].shape[0]
        latent = (self.random.standard_normal((hidden_values, t.latent)) / np.sqrt(hidden_values)).astype(np.float32)
        adam = Adam([*decoder.arrays, latent])
        for rate, (noisy, clean, s2, _) in self._batches(t.decoder_epochs, 0.0):
            found = posterior.features(lam, noisy, s2)
            hidden = net.values(found)[-2]
            values = decoder.values(
                np.hstack([posterior.damage_of(posterior.all_heads(net, found, signs, answered)), hidden @ latent])
            )
            gradients, g_in = decoder.gradients(values, (values[-1] - clean / unit) / np.float32(len(clean)))
            adam.step([*gradients, hidden.T @ g_in[:, zones:]], rate)
            report()
        return decoder, latent

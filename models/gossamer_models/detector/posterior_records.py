"""What a posterior network is trained with: settings, windows of a campaign, gain, noise and errors of sensors.

Symbols: ``n`` cases, ``M`` blocks of a window, ``x`` centred block means [1].
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from ..arrays import Matrix, Vector
from ..campaign import SENSOR_ERROR, SENSOR_GAIN, Distribution, Vary
from ..errors import DataError
from ..twin.lasting_error import random_errors
from .features import block_means
from .networks import Rows32
from .posterior_artifact import STATED

if TYPE_CHECKING:
    import xarray as xr

# Deviations of the noise of a sample, in units of ``Sensing.unit``:
LEAST_NOISE, MOST_NOISE = 1e-5, 6.5e-3  # white
COLOURED = 2e-3  # most of what is not white, as an estimator leaves it
PER_SENSOR, MOST_COMPONENTS, PER_COMPONENT = 192, 512, 4  # principal components, and cases of each
USUAL = 0.03  # noise over the swing of the strain [1], of a campaign that states none
SWINGS = 64  # cases that tell the swing
SOME = 64  # cases that errors of sensors are drawn for at once


@dataclass(frozen=True, kw_only=True)
class Training:
    """Settings of the training.

    Attributes
    ----------
    samples, windows : int
        Samples of a window, and how many of them.
    block, components : int
        Samples that are averaged, and principal components.
    width, layers : int
        Values of each layer of the network, and layers that add.
    explained, latent, inner : int
        Components that the decoder explains, at most; latent values that it gets beside the damage; values of its hidden
        layer.
    spoilt : float
        Share of the records with a wrong sensor, so that the network is not sure of its answer where it sees one.
    steps, batch : int
        Steps of the network, after half as many on coarser cases, if there are any; and cases of a step.
    rate : float
        Largest step size of Adam; it falls to 0 along half a cosine.
    held_out : float
        Share of the cases, the last ones, that limits and errors come from: half for each.
    seed : int
        Of weights, order, gain and noise.
    """

    samples: int = 844
    windows: int = 3
    block: int = 2
    components: int = 512
    width: int = 512
    layers: int = 3
    explained: int = 128
    latent: int = 8
    inner: int = 96
    spoilt: float = 0.03
    steps: int = 5000
    batch: int = 1024
    rate: float = 1.5e-3
    held_out: float = 0.15
    seed: int = 0

    @classmethod
    def of(cls, data: xr.Dataset, window: float | None = None) -> Training:
        """Return the settings that suit a campaign: sizes from its sensors, windows of a length [s], or as it says."""
        length = window or json.loads(data.attrs["campaign"])["window"]
        samples = cls.samples if length is None else 4 * max(round(length / float(data["time"][0])) // 4, 1)
        windows = min(cls.windows, max(data.sizes["time"] // samples, 1))
        blocks = data.sizes["sensor"] * (samples // cls.block - 1)
        return cls(
            samples=samples,
            windows=windows,
            components=min(
                PER_SENSOR * data.sizes["sensor"], MOST_COMPONENTS, data.sizes["case"] // PER_COMPONENT, blocks // 2
            ),
            batch=min(cls.batch, data.sizes["case"]),
            width=64 * round(cls.width / np.sqrt(windows) / 64),  # so that several windows fill no larger file
        )

    @property
    def coarse_steps(self) -> int:
        """Steps of the network on coarser cases."""
        return self.steps // 2

    @property
    def decoder_steps(self) -> int:
        """Steps of the decoder."""
        return 1 + self.steps // 4


@dataclass(frozen=True)
class Windows:
    """One window of many cases.

    Attributes
    ----------
    records : ndarray of float32, shape (n, s, samples)
        Strain [1] without gain and noise.
    damage : ndarray, shape (n, z)
        Damage [1] that is there during the whole window.
    """

    records: Rows32
    damage: Matrix

    def part(self, first: int, last: int) -> Windows:
        """Return some of the cases."""
        return Windows(self.records[first:last], self.damage[first:last])


def cut_windows(data: xr.Dataset, number: int, samples: int, last: bool, seed: int) -> Windows:
    """Cut one window out of every case of a campaign.

    Parameters
    ----------
    data : xarray.Dataset
        From ``read_campaign``.
    number : int
        Which window, from 0.
    samples : int
        Samples of a window.
    last : bool
        Whether it stands for all later ones. Then it is one of those, at random, and begins up to as many samples later as
        the run has left behind them, since the phase of the load at the start of a window drifts.
    seed : int
        For that.

    Returns
    -------
    Windows
        Without cases that failed or whose damage begins within the window.

    Raises
    ------
    DataError
        The runs are too short.
    """
    steps, first = data.sizes["time"], number * samples
    if steps < first + samples:
        advice = "Make its 'stop' longer."
        msg = f"{number + 1} windows of {samples} samples need {first + samples} steps, the campaign has {steps}. {advice}"
        raise DataError(msg)
    n = data.sizes["case"]
    slack = steps - first - samples if last else 0
    random = np.random.default_rng((seed, number))
    starts = first + random.integers(0, slack % samples + 1, n)
    if slack >= samples:
        starts += samples * random.integers(0, slack // samples + 1, n)
    onset = data["onset"].to_numpy() if "onset" in data else np.zeros(n)
    step = float(data["time"][0])
    damage = data["damage"].to_numpy()
    there = onset <= starts * step * (1.0 + 1e-9)
    clean = (onset >= (starts + samples) * step) | (damage.max(axis=1) == 0.0)
    wanted = (there | clean) & ~data["failed"].to_numpy()
    records = np.empty((n, data.sizes["sensor"], samples), np.float32)
    for begin in range(0, n, 512):
        some = data["strain"][begin : begin + 512].to_numpy()
        for k, record in enumerate(some, start=begin):
            records[k] = record[:, starts[k] : starts[k] + samples]
    return Windows(records[wanted], np.where(there[:, None], damage, 0.0)[wanted])


EXACT = Vary(range=(0.0, 0.0))  # no error of a sensor


@dataclass(frozen=True)
class Sensing:
    """Gain, error and noise of sensors that a network is trained over.

    Attributes
    ----------
    noise : Distribution
        Noise of a sample of strain [1] that the records of a third of the training have about.
    gain : Vary
        How the gain of a sensor varies [1], and in which share of the records.
    error : Vary
        How the error of a sensor does: its root mean square over the range of what it feels [1].
    """

    noise: Distribution
    gain: Vary = field(default_factory=lambda: Vary(range=(1.0, 1.0)))
    error: Vary = EXACT

    @classmethod
    def of(cls, data: xr.Dataset) -> Sensing:
        """Read noise and ranges of gain and error from a campaign."""
        campaign = json.loads(data.attrs["campaign"])
        law = campaign["noise"]["strain"]
        gain, error = (
            Vary(**(campaign["vary"].get(name) or {"range": (base, base)}))
            for name, base in ((SENSOR_GAIN, 1.0), (SENSOR_ERROR, 0.0))
        )
        if law is None:
            some = data["strain"][:SWINGS].to_numpy()
            law = {"normal": USUAL * float(np.nanmax(np.ptp(some[:, :, 1:], axis=2)))}
        return cls(Distribution(**law), gain, error)

    @property
    def unit(self) -> float:
        """Strain [1] that the features of the network are in units of, so that the noise is ``STATED``."""
        return float(self.noise.deviation / STATED)

    def gains(self, shape: tuple[int, ...], random: np.random.Generator) -> Matrix:
        """Draw gains [1] of records and their sensors, shape (n, s)."""
        return _drawn(self.gain, 1.0, shape, random)

    def errors(self, shape: tuple[int, ...], random: np.random.Generator) -> Matrix:
        """Draw sizes [1] of the errors of records and their sensors, shape (n, s)."""
        return _drawn(self.error, 0.0, shape, random)

    def read(self, x: Rows32, random: np.random.Generator) -> Rows32:
        """Return signals, shape (n, s, samples) [1], as sensors with fresh gains and errors read them."""
        read = x * self.gains(x.shape, random)[:, :, None].astype(np.float32)
        size = self.errors(x.shape, random)
        off = np.flatnonzero(size.any(axis=1))
        for rows in np.split(off, range(SOME, len(off), SOME)):
            read[rows] += (size[rows, :, None] * unit_errors(x[rows], random)).astype(np.float32)
        return read

    def samples(self, records: Rows32, random: np.random.Generator, kind: str = "any") -> Matrix:
        """Add gain, errors and noise to records, shape (n, 4, samples) [1].

        Parameters
        ----------
        records : ndarray, shape (n, s, samples)
            Strain [1].
        random : numpy.random.Generator
            Source of the noise.
        kind : {"any", "clean", "stated"}
            As in the training; none; or that of the campaign.
        """
        signal = self.read(records, random).astype(float)
        if kind == "stated":
            signal += self.noise.draw(records.shape, random)
        if kind == "any":
            level, coloured = noise_levels(len(records), random)
            noise = random.standard_normal(records.shape)
            noise[coloured] = coloured_noise((int(coloured.sum()), *records.shape[1:]), random)
            signal += self.unit * level[:, None, None] * noise
        return np.asarray(signal)


def unit_errors(x: Rows32, random: np.random.Generator) -> Rows32:
    """Draw errors [1] of sensors along signals, both of shape (n, s, samples), as large as the range of the signal."""
    return np.asarray(random_errors(x.reshape(-1, x.shape[-1]).astype(float), random).reshape(x.shape), np.float32)


def _drawn(vary: Vary, base: float, shape: tuple[int, ...], random: np.random.Generator) -> Matrix:
    values = random.uniform(*vary.limits(base), shape[:2])
    return np.where(random.random((shape[0], 1)) < vary.share, values, base)


def noise_levels(n: int, random: np.random.Generator) -> tuple[Vector, NDArray[np.bool_]]:
    """Draw the deviation of the white noise of a sample, and whether there is coloured noise as well, shape (n,).

    A third has about the noise that the campaign states, a third any level, and a third is coloured, as an estimator leaves
    it.
    """
    kind = random.random(n)
    level = np.exp(random.uniform(np.log(LEAST_NOISE), np.log(MOST_NOISE), n))
    level = np.where(kind < 0.35, STATED * random.uniform(0.9, 1.1, n), level)
    coloured = kind > 0.65
    return np.where(coloured, np.minimum(level, COLOURED), level), coloured


def coloured_noise(shape: tuple[int, ...], random: np.random.Generator) -> Matrix:
    """Draw white noise of deviation 1 and two first-order processes of deviations up to 1, shape (n, s, samples).

    The estimator of the compensator leaves noise like this: half of its variance white, a third with a correlation time of
    two samples, the rest of ten to thirty.
    """
    noise = random.standard_normal(shape)
    for record in noise:
        for low, high in ((0.4, 0.7), (0.85, 0.97)):
            f = random.uniform(low, high)
            white = random.standard_normal(record.shape)
            start = white[:, :1] * (f / np.sqrt(1.0 - f**2))
            record += random.random() * np.sqrt(1.0 - f**2) * lfilter([1.0], [1.0, -f], white, axis=-1, zi=start)[0]
    return noise


def features_of(records: Rows32, block: int) -> Rows32:
    """Return ``block_means`` of many records in single precision, a few of them at a time."""
    some = [block_means(records[k : k + 512], block).astype(np.float32) for k in range(0, len(records), 512)]
    return np.concatenate(some)

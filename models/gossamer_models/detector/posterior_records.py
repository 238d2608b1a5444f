"""What a posterior network is trained with: settings, windows of a campaign, their mirror images, gain and noise.

Symbols: ``n`` cases, ``M`` blocks of a window, ``x`` centred block means [1].
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from ..arrays import Matrix, Vector
from ..errors import DataError
from .features import SENSORS, block_means
from .networks import Rows32
from .posterior import MIRRORS
from .posterior_artifact import Network
from .thesis_tables import NOISE

if TYPE_CHECKING:
    import xarray as xr

THESIS_NOISE = (NOISE[1] - NOISE[0]) / np.sqrt(12.0)  # its standard deviation [1]
LEAST_NOISE, MOST_NOISE = 1e-5, 6.5e-3  # of a sample, white [1]
COLOURED = 2e-3  # most of a sample that is not white, as an estimator leaves it [1]


@dataclass(frozen=True, kw_only=True)
class Training:
    """Settings of the training.

    Attributes
    ----------
    samples, windows : int
        Samples of a window, and how many of them.
    block, components : int
        Samples that are averaged, and principal components.
    network : {"perceptron", "neuro-fuzzy"}
        A multilayer perceptron, or the thesis' network with indices that are trained.
    references : int
        Reference cases of a neuro-fuzzy network.
    hidden, latent, inner : int
        Values of each hidden layer of the perceptron, latent values that the decoder gets beside the damage, and values of
        its hidden layer.
    virtual : float
        Share of the cases that are moved to other damages until the last quarter of the epochs; see ``NetworkFit.epoch``.
    spoilt : float
        Share of the records with a wrong sensor, so that the network is not sure of its answer where it sees one.
    epochs, batch : int
        Passes of the network through the cases, and cases of a step.
    rate : float
        First step size of Adam; it falls to 0 along half a cosine.
    held_out : float
        Share of the cases, the last ones, that limits and errors come from: half for each.
    seed : int
        Of weights, order, gain and noise.
    """

    samples: int = 844
    windows: int = 3
    block: int = 2
    components: int = 128
    network: Network = "neuro-fuzzy"
    references: int = 256
    hidden: int = 128
    latent: int = 8
    inner: int = 96
    epochs: int = 150
    virtual: float = 0.9
    spoilt: float = 0.03
    batch: int = 256
    rate: float = 2e-3
    held_out: float = 0.15
    seed: int = 0

    @property
    def decoder_epochs(self) -> int:
        """Passes of the decoder through the cases."""
        return 1 + self.epochs // 4


@dataclass(frozen=True)
class Windows:
    """One window of many cases.

    Attributes
    ----------
    records : ndarray of float32, shape (n, 4, samples)
        Strain [1] without gain and noise.
    damage : ndarray, shape (n, 16)
        Damage [1] that is there during the whole window.
    settled : ndarray of bool, shape (n,)
        Whether it was there from the start, or a whole window before.
    shift : ndarray of int, shape (n,)
        Samples by which the window begins later than the earliest.
    """

    records: Rows32
    damage: Matrix
    settled: NDArray[np.bool_]
    shift: NDArray[np.int64]

    def part(self, first: int, last: int) -> Windows:
        """Return some of the cases."""
        return Windows(
            self.records[first:last], self.damage[first:last], self.settled[first:last], self.shift[first:last]
        )


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
        Whether it stands for all later ones. Then it begins at random within what the run has left, since the phase of the
        load at the start of a window drifts.
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
        msg = (
            f"{number + 1} windows of {samples} samples need {first + samples} steps, the campaign has {steps}. Make its "
            "'stop' longer."
        )
        raise DataError(msg)
    n = data.sizes["case"]
    slack = steps - first - samples if last else 0
    starts = first + np.random.default_rng((seed, number)).integers(0, slack + 1, n)
    onset = data["onset"].to_numpy() if "onset" in data else np.zeros(n)
    step = float(data["time"][0])
    damage = data["damage"].to_numpy()
    there = onset <= starts * step * (1.0 + 1e-9)
    clean = (onset >= (starts + samples) * step) | (damage.max(axis=1) == 0.0)
    wanted = (there | clean) & ~data["failed"].to_numpy()
    records = np.empty((n, SENSORS, samples), np.float32)
    for begin in range(0, n, 512):
        some = data["strain"][begin : begin + 512].to_numpy()
        for k, record in enumerate(some, start=begin):
            records[k] = record[:, starts[k] : starts[k] + samples]
    settled = (onset == 0.0) | (onset <= (starts - samples) * step)
    return Windows(
        records[wanted], np.where(there[:, None], damage, 0.0)[wanted], settled[wanted], starts[wanted] - first
    )


def reflect(x: Rows32, damage: Matrix) -> tuple[Rows32, Matrix]:
    """Add the three mirror images of each case: the membrane, its load, zones and sensors are symmetric.

    Parameters
    ----------
    x : ndarray, shape (n, 4, ...)
        Signals of the sensors.
    damage : ndarray, shape (n, 16)
        Damage [1].

    Returns
    -------
    ndarray, shape (4 n, 4, ...), and ndarray, shape (4 n, 16)
        The cases, then their images in x, in y and in both.
    """
    n, side = len(x), math.isqrt(damage.shape[1])
    signals, zones = x.reshape(n, 2, 2, -1), damage.reshape(n, side, side)
    return (
        np.concatenate([signals[:, ::y, ::x] for y, x in MIRRORS]).reshape(4 * n, *x.shape[1:]),
        np.concatenate([zones[:, ::y, ::x] for y, x in MIRRORS]).reshape(4 * n, -1),
    )


@dataclass(frozen=True)
class Sensing:
    """Gain and noise that a network is trained over.

    Attributes
    ----------
    gain : tuple of float
        Range of the gain of a sensor [1].
    """

    gain: tuple[float, float] = (1.0, 1.0)

    @classmethod
    def of(cls, data: xr.Dataset) -> Sensing:
        """Read the range of the gain from a campaign."""
        vary = json.loads(data.attrs["campaign"])["vary"].get("sensor_gain") or {}
        low, high = vary.get("range") or vary.get("factor") or (1.0, 1.0)
        return cls((float(low), float(high)))

    def gains(self, n: int, random: np.random.Generator) -> Matrix:
        """Draw gains [1], shape (n, 4)."""
        return random.uniform(*self.gain, (n, SENSORS))

    def gained(self, x: Rows32, random: np.random.Generator) -> Rows32:
        """Multiply signals, shape (n, 4, samples), by fresh gains."""
        return x * self.gains(len(x), random)[:, :, None].astype(np.float32)

    def samples(self, records: Rows32, random: np.random.Generator, kind: str = "any") -> Matrix:
        """Add gain and noise to records, shape (n, 4, samples) [1].

        Parameters
        ----------
        records : ndarray, shape (n, 4, samples)
            Strain [1].
        random : numpy.random.Generator
            Source of the noise.
        kind : {"any", "clean", "thesis"}
            As in the training; none; or uniform from 0 to 0.02 as in the thesis.
        """
        signal = self.gained(records, random).astype(float)
        if kind == "thesis":
            signal += random.uniform(*NOISE, records.shape)
        if kind == "any":
            level, coloured = noise_levels(len(records), random)
            noise = random.standard_normal(records.shape)
            noise[coloured] = coloured_noise((int(coloured.sum()), *records.shape[1:]), random)
            signal += level[:, None, None] * noise
        return np.asarray(signal)


def noise_levels(n: int, random: np.random.Generator) -> tuple[Vector, NDArray[np.bool_]]:
    """Draw the deviation of the white noise of a sample [1], and whether there is coloured noise as well, shape (n,).

    A third has about the noise of the thesis, a third any level, and a third is coloured, as an estimator leaves it.
    """
    kind = random.random(n)
    level = np.exp(random.uniform(np.log(LEAST_NOISE), np.log(MOST_NOISE), n))
    level = np.where(kind < 0.35, THESIS_NOISE * random.uniform(0.9, 1.1, n), level)
    coloured = kind > 0.65
    return np.where(coloured, np.minimum(level, COLOURED), level), coloured


def coloured_noise(shape: tuple[int, ...], random: np.random.Generator) -> Matrix:
    """Draw white noise of deviation 1 and two first-order processes of deviations up to 1, shape (n, 4, samples).

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

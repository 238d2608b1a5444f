"""Features of strain histories: energies of Haar packets, block means and their principal components, and the noise.

Symbols: ``n`` cases, ``s`` sensors, ``M`` whole blocks of a window, ``x`` centred block means [1], ``K`` components, ``V``
their axes; ``x1..x4`` four successive samples, ``U`` packet energies in the order AA, AD, DA, DD.

A packet coefficient of level 2 of the orthonormal Haar basis, Eqs. (7.5) and (7.6) of the thesis applied twice, depends on
four successive samples only, so its energy is a running sum over blocks of four, without a record. PyWavelets gives the
same for a whole record whose length is a multiple of four. These energies discard sign and phase, which hold most of what
noise leaves of damage. Blocks of means must be short: a fifth of what damage in the middle of the membrane changes, and most
of what it changes in a corner, is above 250 Hz.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import Any

import casadi as ca
import numpy as np
import pywt
from numpy.typing import ArrayLike, NDArray

from ..arrays import Matrix, Vector
from ..campaign.symmetry import Symmetry
from ..errors import DataError
from ..variables import modulo

BLOCK = 4
PACKETS = ("AA", "AD", "DA", "DD")
ORDER = 4  # of the differences that show the noise: strain is smooth between neighbouring samples
DIFFERENCE = np.array([(-1.0) ** k * comb(ORDER, k) for k in range(ORDER + 1)])  # newest sample first


def block_energies(block: ca.MX) -> ca.MX:
    """Return the four packet energies of one block of four samples.

    Parameters
    ----------
    block : casadi.MX, shape (n, 4)
        Four successive samples of n signals.

    Returns
    -------
    casadi.MX, shape (4 n,)
        Energies, signal by signal in the order AA, AD, DA, DD; the integrand of Eq. (7.8) of [1]_ without the constant
        sampling step, which cancels in the index.

    References
    ----------
    .. [1] M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite
       Sensors, dissertation, Virginia Tech, 2010, Chapter 7.
    """
    x1, x2, x3, x4 = ca.horzsplit(block)
    a1, d1 = x1 + x2, x1 - x2
    a2, d2 = x3 + x4, x3 - x4
    coefficients = ca.horzcat(a1 + a2, a1 - a2, d1 + d2, d1 - d2) / 2.0
    return ca.vec((coefficients**2).T)


def packet_energies(record: ArrayLike) -> Vector:
    """Compute the packet energies of whole records with PyWavelets.

    Parameters
    ----------
    record : array_like, shape (..., n)
        Sampled signals; n a multiple of 4.

    Returns
    -------
    ndarray, shape (..., 4)
        Energies in the order AA, AD, DA, DD.

    Raises
    ------
    DataError
        The number of samples is zero or not a multiple of four.
    """
    samples = np.asarray(record, dtype=float)
    if samples.shape[-1] == 0 or samples.shape[-1] % BLOCK:
        msg = f"a record of {samples.shape[-1]} samples has no whole blocks of {BLOCK}. Cut it to a multiple of {BLOCK}."
        raise DataError(msg)
    packets = pywt.WaveletPacket(samples, "haar", mode="periodization", maxlevel=2, axis=-1)
    return np.stack([np.sum(packets[name.lower()].data ** 2, axis=-1) for name in PACKETS], axis=-1)


@dataclass(frozen=True, slots=True)
class Components:
    """Principal components of the block means of each of some orthonormal sums of the sensors' signals.

    Of a structure with mirror images these sums are even or odd, so the covariance over random damage falls into a block
    for each, and an image of a record has the same components up to their signs. Of any other each sensor is by itself.

    Attributes
    ----------
    unit : ndarray, shape (1,)
        Strain [1] that everything else is in units of.
    modes : ndarray, shape (s, s)
        Weights of the sensors in each sum, one per row.
    mean : ndarray, shape (s, M)
        Mean history of every sensor.
    axes : ndarray, shape (M, K)
        Orthonormal axes of each sum, the largest variance first.
    sectors : ndarray, shape (K,)
        Row of ``modes`` that an axis belongs to, in ascending order.
    variances : ndarray, shape (K,)
        Variances along them.
    """

    unit: Vector
    modes: Matrix
    mean: Matrix
    axes: Matrix
    sectors: Vector
    variances: Vector

    def scaled(self, x: NDArray[Any]) -> NDArray[Any]:
        """Return block means [1] in the unit of the components, their mean removed, shape (n, s, M)."""
        return np.asarray(x / x.dtype.type(self.unit[0]) - self.mean)


def block_means(records: ArrayLike, block: int) -> Matrix:
    """Average the records of a window over blocks of samples and remove the mean of each sensor.

    Parameters
    ----------
    records : array_like, shape (..., s, samples)
        Strains [1].
    block : int
        Samples of a block; samples at the end that fill no block are not used.

    Returns
    -------
    ndarray, shape (..., s, M)
        Centred block means [1]: a constant offset of a sensor has no effect.

    Raises
    ------
    DataError
        There are fewer samples than in two blocks.
    """
    strain = np.asarray(records)
    count = strain.shape[-1] // block
    if count < 2:
        msg = f"a window of {strain.shape[-1]} samples has no two blocks of {block}. Use a longer window."
        raise DataError(msg)
    blocks = strain[..., : count * block].reshape(*strain.shape[:-1], count, block).mean(axis=-1, dtype=float)
    centred = blocks - blocks.mean(axis=-1, keepdims=True)
    return np.asarray(centred)


def difference_noise(records: ArrayLike) -> Matrix:
    """Estimate the standard deviation of white noise from fourth differences.

    Parameters
    ----------
    records : array_like, shape (..., s, samples)
        Strains [1].

    Returns
    -------
    ndarray, shape (..., s)
        Standard deviation [1] of each sensor; strain itself adds little, since it is smooth.
    """
    differences = np.diff(np.asarray(records, dtype=float), ORDER, axis=-1)
    return np.asarray(np.sqrt(np.mean(differences**2, axis=-1) / np.sum(DIFFERENCE**2)))


def principal_components(x: NDArray[Any], count: int, symmetry: Symmetry, unit: float = 1.0) -> Components:
    """Find the principal components of centred block means.

    Parameters
    ----------
    x : ndarray, shape (n, s, M)
        From ``block_means``; the images of a case need not be there.
    count : int
        Number of components.
    symmetry : Symmetry
        Images of the structure.
    unit : float
        Strain [1] that the components are in units of.

    Raises
    ------
    DataError
        There are fewer cases or block means than components.
    """
    n, s, M = x.shape
    if count >= min(n, s * M):
        msg = f"{n} cases of {s * M} block means have no {count} principal components. Run more cases."
        raise DataError(msg)
    mean = x.mean(axis=0, dtype=float)
    mean = np.mean([mean[order] for order in symmetry.sensors], axis=0) / unit
    found = []
    for sector, row in enumerate(symmetry.modes):
        y = np.tensordot(row / unit, x, (0, 1)) - row @ mean
        variances, axes = np.linalg.eigh(np.asarray(y.T @ y, dtype=float) / n)
        found += [(variance, sector, axis) for variance, axis in zip(variances, axes.T, strict=True)]
    largest = sorted(found, key=lambda item: -item[0])[:count]
    chosen = sorted(largest, key=lambda item: (item[1], -item[0]))
    V = np.array([axis for *_, axis in chosen]).T
    V = V * np.sign(V[np.abs(V).argmax(axis=0), np.arange(count)])  # a sign that does not depend on the solver
    lam, sectors = np.array([item[:2] for item in chosen], float).T
    return Components(np.array([unit]), symmetry.modes, mean, V, sectors, lam)


@dataclass(frozen=True, slots=True)
class Register:
    """Block means and noise of the running window, sample by sample.

    Attributes
    ----------
    recent : casadi.MX, shape (s, 4)
        Strains [1] at the last four samples, the newest first.
    partial : casadi.MX, shape (s,)
        Sum of the strains [1] of the running block.
    blocks : casadi.MX, shape (s, M)
        Means [1] of the last blocks, the newest last.
    squares : casadi.MX, shape (s,)
        Sum of the squared differences.
    """

    recent: ca.MX
    partial: ca.MX
    blocks: ca.MX
    squares: ca.MX

    @classmethod
    def empty(cls, sensors: int, count: int) -> Register:
        """Return a register of ``count`` blocks of some sensors before the first sample."""
        none = ca.MX.zeros(sensors)
        return cls(ca.MX.zeros(sensors, ORDER), none, ca.MX.zeros(sensors, count), none)

    def advance(self, sample: ca.MX, take: ca.MX, count: ca.MX, block: int) -> Register:
        """Take one sample.

        Parameters
        ----------
        sample : casadi.MX, shape (s,)
            Strains [1].
        take : casadi.MX, scalar
            Whether there is a sample.
        count : casadi.MX, scalar
            Samples of this window, this one included.
        block : int
            Samples of a block.
        """
        samples = ca.horzcat(sample, self.recent)
        difference = samples @ ca.DM(DIFFERENCE)
        partial = self.partial + take * sample
        full = ca.logic_and(take, modulo(count, block) < 0.5)
        return Register(
            recent=ca.if_else(take, samples[:, :ORDER], self.recent),
            partial=ca.if_else(full, 0.0, partial),
            blocks=ca.if_else(full, ca.horzcat(self.blocks[:, 1:], partial / block), self.blocks),
            squares=self.squares + ca.if_else(ca.logic_and(take, count > ORDER + 0.5), difference**2, 0.0),
        )

    def restarted(self, ended: ca.MX) -> Register:
        """Return the register of a new window if one has ended."""
        zero = ca.if_else(ended, 0.0, 1.0)
        return Register(self.recent, self.partial * zero, self.blocks, self.squares * zero)

    def features(self, samples: int) -> tuple[ca.MX, ca.MX]:
        """Return what ``block_means``, shape (s, M), and ``difference_noise``, shape (s,), give for the whole window."""
        centred = self.blocks - ca.repmat(ca.sum2(self.blocks) / self.blocks.shape[1], 1, self.blocks.shape[1])
        scale = (samples - ORDER) * float(np.sum(DIFFERENCE**2))
        return centred, ca.sqrt(self.squares / scale)

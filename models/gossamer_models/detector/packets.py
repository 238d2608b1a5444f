"""Haar wavelet packets of level 2, streaming and by PyWavelets.

Symbols: ``x1..x4`` four successive samples, ``U`` packet energies in the order AA, AD, DA, DD.

A packet coefficient of level 2 of the orthonormal Haar basis, Eqs. (7.5) and (7.6) of the thesis applied twice, depends on
four successive samples only, so its energy is a running sum over blocks of four, without a record. PyWavelets gives the
same for a whole record whose length is a multiple of four.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pywt
from numpy.typing import ArrayLike

from ..arrays import Vector
from ..errors import DataError

BLOCK = 4
PACKETS = ("AA", "AD", "DA", "DD")


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
        msg = (
            f"a record of {samples.shape[-1]} samples has no whole blocks of {BLOCK}. Cut it to a multiple of {BLOCK}."
        )
        raise DataError(msg)
    packets = pywt.WaveletPacket(samples, "haar", mode="periodization", maxlevel=2, axis=-1)
    return np.stack([np.sum(packets[name.lower()].data ** 2, axis=-1) for name in PACKETS], axis=-1)

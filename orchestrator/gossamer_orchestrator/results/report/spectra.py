"""Spectra of evenly sampled curves under Hann's window."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

LEAST = 64  # samples of a spectrum
COLUMNS, LINES = 240, 128  # of a spectrogram, at most
_FLOOR = 1e-12  # of an amplitude, so that it has a logarithm

Array = NDArray[np.float64]


def spectrum(time: Array, values: Array) -> dict[str, Any]:
    """Return the amplitudes of a curve without its mean; empty if it is short, uneven or not finite."""
    if not _usable(time, values):
        return {}
    hann = np.hanning(len(values))
    amplitudes = np.abs(np.fft.rfft(hann * (values - values.mean()))) * 2.0 / hann.sum()
    return {"frequency": np.fft.rfftfreq(len(values), time[1] - time[0])[1:], "amplitude": amplitudes[1:]}


def spectrogram(time: Array, values: Array) -> dict[str, Any]:
    """Return the amplitudes of overlapping stretches of a curve, each without its mean.

    Returns
    -------
    dict
        ``time``, the middle of each stretch [s], ``frequency`` [Hz], and ``level``, the decimal logarithm of the
        amplitude, of shape (frequencies, times); of more than ``LINES`` frequencies the largest amplitude of
        neighbours. Empty as ``spectrum``.
    """
    if not _usable(time, values):
        return {}
    size = max(LEAST // 2, min(1024, len(values) // 8))  # eight stretches beside each other, or more
    begins = np.linspace(0, len(values) - size, min(COLUMNS, 2 * len(values) // size)).round().astype(int)
    parts = np.stack([values[begin : begin + size] for begin in begins])
    hann = np.hanning(size)
    amplitudes = np.abs(np.fft.rfft(hann * (parts - parts.mean(axis=1, keepdims=True)))) * 2.0 / hann.sum()
    frequency = np.fft.rfftfreq(size, time[1] - time[0])[1:]
    merged = -(-len(frequency) // LINES)
    first = np.arange(0, len(frequency), merged)
    level = np.log10(np.maximum(np.maximum.reduceat(amplitudes[:, 1:], first, axis=1), _FLOOR))
    return {"time": time[begins + size // 2], "frequency": frequency[first], "level": level.T}


def _usable(time: Array, values: Array) -> bool:
    even = len(time) >= LEAST and np.ptp(np.diff(time)) <= 1e-6 * (time[1] - time[0]) + 1e-12
    return bool(even and np.isfinite(values).all())

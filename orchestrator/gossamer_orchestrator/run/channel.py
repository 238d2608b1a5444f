"""What happens to a signal between two components: gain, bias, noise, dropout.

Symbols: ``x`` sample of the sender, ``k`` communication point, ``n_k`` noise, ``d_k`` 1 if the sample is lost::

    y_k = gain * x_k + bias + n_k        if not d_k
    y_k = y_(k-1)  or  0                 if d_k, with and without hold

``n`` and ``d`` are drawn once for the whole run and looked up by ``k``, so a repeated step sees the same disturbance and two
runs with the same seeds are equal to the bit.
"""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

from ..scenario.schema import Connection


class Channel:
    """The disturbances of one connection.

    Parameters
    ----------
    connection : Connection
        As the scenario states it.
    ticks : int
        Number of communication steps of the run.

    Attributes
    ----------
    held : float
        Last sample that arrived; the whole state of a channel.
    """

    def __init__(self, connection: Connection, ticks: int) -> None:
        self.gain = 1.0 if connection.gain is None else connection.gain
        self.bias = 0.0 if connection.bias is None else connection.bias
        self.held = 0.0
        name = zlib.crc32(connection.target.encode())
        noise, dropout = connection.noise, connection.dropout
        self._noise: NDArray[np.float64] | None = None
        self._lost: NDArray[np.bool_] | None = None
        self._hold = True
        size = ticks + 1
        if noise is not None:
            generator = np.random.default_rng([noise.seed, name, 0])
            unit = generator.uniform(-1.0, 1.0, size) if noise.kind == "uniform" else generator.normal(size=size)
            self._noise = noise.amplitude * unit
        if dropout is not None:
            lost = np.random.default_rng([dropout.seed, name, 1]).random(size) < dropout.probability
            lost[0] &= not dropout.hold  # there is nothing to hold yet
            self._lost = lost
            self._hold = dropout.hold

    def __call__(self, value: float, tick: int) -> float:
        """Return what arrives of a sample sent for communication point ``tick``."""
        if self._lost is not None and self._lost[tick]:
            return self.held if self._hold else 0.0
        value = self.gain * value + self.bias
        if self._noise is not None:
            value += float(self._noise[tick])
        self.held = value
        return value

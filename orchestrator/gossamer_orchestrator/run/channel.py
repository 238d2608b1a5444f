"""What happens to a signal between two components: gain, bias, noise, dropout.

Symbols: ``x`` sample of the sender, ``k`` communication point, ``n_k`` noise, ``d_k`` 1 if the sample is lost::

    y_k = gain * x_k + bias + n_k        if not d_k
    y_k = y_(k-1)  or  0                 if d_k, with and without hold

``n`` and ``d`` are functions of the seed and of ``k``, so a repeated step sees the same disturbance and two runs with the
same seeds are equal to the bit.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from ..scenario.schema import Connection

_BLOCK = 4096


class _Draws:
    """Random numbers by index, drawn in blocks: memory does not grow with the run.

    Parameters
    ----------
    seed : list of int
        Seed of the generator.
    draw : callable
        Draws the next block from a generator.
    """

    def __init__(self, seed: list[int], draw: Callable[[Generator], NDArray[np.float64]]) -> None:
        self._seed, self._draw = seed, draw
        self._restart()

    def _restart(self) -> None:
        self._generator = np.random.default_rng(self._seed)
        self._first, self._block = 0, self._draw(self._generator)

    def __getitem__(self, k: int) -> float:
        if k < self._first:
            self._restart()
        while k >= self._first + _BLOCK:
            self._first, self._block = self._first + _BLOCK, self._draw(self._generator)
        return float(self._block[k - self._first])


class Channel:
    """The disturbances of one connection.

    Parameters
    ----------
    connection : Connection
        As the scenario states it.

    Attributes
    ----------
    held : float
        Last sample that arrived; the whole state of a channel.
    """

    def __init__(self, connection: Connection) -> None:
        self.gain = 1.0 if connection.gain is None else connection.gain
        self.bias = 0.0 if connection.bias is None else connection.bias
        self.held = 0.0
        name = zlib.crc32(connection.target.encode())
        noise, dropout = connection.noise, connection.dropout
        self._noise: _Draws | None = None
        self._chance: _Draws | None = None
        self._amplitude = self._probability = 0.0
        self._hold = True
        if noise is not None:
            uniform = noise.kind == "uniform"
            self._noise = _Draws([noise.seed, name, 0], _uniform if uniform else _normal)
            self._amplitude = noise.amplitude
        if dropout is not None:
            self._chance = _Draws([dropout.seed, name, 1], _chance)
            self._probability, self._hold = dropout.probability, dropout.hold

    def __call__(self, value: float, tick: int) -> float:
        """Return what arrives of a sample sent for communication point ``tick``."""
        if self._chance is not None and self._chance[tick] < self._probability and (tick or not self._hold):
            return self.held if self._hold else 0.0  # at tick 0 there is nothing to hold yet
        value = self.gain * value + self.bias
        if self._noise is not None:
            value += self._amplitude * self._noise[tick]
        self.held = value
        return value


def _uniform(generator: Generator) -> NDArray[np.float64]:
    return generator.uniform(-1.0, 1.0, _BLOCK)


def _normal(generator: Generator) -> NDArray[np.float64]:
    return generator.normal(size=_BLOCK)


def _chance(generator: Generator) -> NDArray[np.float64]:
    return generator.random(_BLOCK)

"""The values of a run: what was read from the FMUs, what happens to it on its way, and what has arrived.

Symbols: ``x`` sample of the sender, ``k`` communication point, ``n_k`` noise, ``d_k`` 1 if the sample is lost::

    y_k = gain * x_k + bias + n_k        if not d_k
    y_k = y_(k-1)  or  0                 if d_k, with and without hold

``n`` and ``d`` are functions of the seed and of ``k``, so a repeated step sees the same disturbance and two runs with the
same seeds are equal to the bit.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from operator import methodcaller
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from ..fmi.types import EXCHANGED_EXACTLY, parse
from ..names import split_endpoint
from ..scenario.histories import FILE
from ..scenario.plan import Plan
from ..scenario.schema import Connection


class Store:
    """Every variable that is read, as a float; texts and wide integers also as they are.

    Parameters
    ----------
    plan : Plan
        Gives the variables, and the master.

    Attributes
    ----------
    plan : Plan
        The same.
    places : dict
        Index by ``(component, variable)``.
    values : numpy.ndarray
        What was read last, by place; a truth value is 0 or 1, a text 0.
    exact : list
        The same of the types that floats do not hold, and None elsewhere; empty if there are none.
    arrived, exact_arrived : numpy.ndarray, list
        What receivers see: the same objects under Gauss-Seidel, those of the last communication point under Jacobi.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        read = [(c.name, v, c.fmu.variables[v]) for c in plan.components for v in c.read]
        for target in plan.histories:
            component, name = split_endpoint(target)
            read.append((FILE, target, plan.component(component).fmu.variables[name]))
        self.places = {(component, name): i for i, (component, name, _) in enumerate(read)}
        starts = [0.0 if v.type != "Real" or v.start is None else float(v.start) for _, _, v in read]
        self.values = np.array(starts, dtype=np.float64)  # what an FMU sends until it is initialized
        self.exact: list[Any] = [parse(v.type, v.start) if v.type in EXCHANGED_EXACTLY else None for _, _, v in read]
        if not any(v.type in EXCHANGED_EXACTLY for _, _, v in read):
            self.exact.clear()
        jacobi = plan.scenario.master == "jacobi"
        self.arrived = self.values.copy() if jacobi else self.values
        self.exact_arrived = self.exact.copy() if jacobi else self.exact
        self._histories = [(self.places[FILE, target], history) for target, history in plan.histories.items()]
        self._before = self.values.copy()
        self._exact_before = self.exact.copy()

    def look_up(self, time: float) -> None:
        """Hand what files say of a time [s] to the receivers."""
        for place, history in self._histories:
            value = history(time)
            if self.exact and self.exact[place] is not None:
                self.exact[place] = self.exact_arrived[place] = value
            else:
                self.values[place] = self.arrived[place] = value

    def arrive(self) -> None:
        """Hand everything on to the receivers."""
        self.arrived[:] = self.values
        self.exact_arrived[:] = self.exact

    def save(self) -> None:
        """Keep everything for ``restore``."""
        self._before[:] = self.values
        if self.exact:
            self._exact_before[:] = self.exact

    def restore(self) -> None:
        """Go back to what was kept."""
        self.values[:] = self._before
        self.exact[:] = self._exact_before


_BLOCK = 4096
_UNIFORM, _NORMAL = methodcaller("uniform", -1.0, 1.0, _BLOCK), methodcaller("normal", size=_BLOCK)
_CHANCE = methodcaller("random", _BLOCK)


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
            self._noise = _Draws([noise.seed, name, 0], _UNIFORM if noise.kind == "uniform" else _NORMAL)
            self._amplitude = noise.amplitude
        if dropout is not None:
            self._chance = _Draws([dropout.seed, name, 1], _CHANCE)
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

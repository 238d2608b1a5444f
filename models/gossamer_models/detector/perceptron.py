"""A multilayer perceptron in NumPy: values, gradients, and Adam.

Symbols: ``W``, ``b`` weights and biases of a layer, ``a`` its values, ``g`` gradients of the loss. Hidden layers are tanh,
the last one is linear. Arrays are single precision, one row per case.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Rows32 = NDArray[np.floating[Any]]  # single precision where it is trained


@dataclass(frozen=True)
class Perceptron:
    """Layers of a perceptron.

    Attributes
    ----------
    arrays : list of ndarray
        W of the first layer, shape (inputs, outputs), its b, shape (outputs,), W of the second, ...
    """

    arrays: list[Rows32]

    @classmethod
    def random(cls, sizes: Sequence[int], random: np.random.Generator) -> Perceptron:
        """Make layers between the given numbers of values, with the weights of [1]_.

        References
        ----------
        .. [1] X. Glorot, Y. Bengio, Understanding the difficulty of training deep feedforward neural networks, AISTATS,
           2010.
        """
        arrays: list[Rows32] = []
        for n, m in pairwise(sizes):
            W = random.standard_normal((n, m)) * np.sqrt(2.0 / (n + m))
            arrays += [W.astype(np.float32), np.zeros(m, np.float32)]
        return cls(arrays)

    def values(self, x: Rows32) -> list[Rows32]:
        """Return the values of all layers, beginning with the input."""
        found = [x]
        for layer in range(0, len(self.arrays), 2):
            a = found[-1] @ self.arrays[layer] + self.arrays[layer + 1]
            found.append(a if layer + 2 == len(self.arrays) else np.tanh(a))
        return found

    def gradients(self, values: Sequence[Rows32], g: Rows32) -> tuple[list[Rows32], Rows32]:
        """Propagate the gradient of the output back.

        Parameters
        ----------
        values : sequence of ndarray
            From ``values``.
        g : ndarray, shape (n, outputs)
            Gradient of the loss with respect to the output.

        Returns
        -------
        gradients : list of ndarray
            As ``arrays``.
        ndarray, shape (n, inputs)
            Gradient with respect to the input.
        """
        found: list[Rows32] = []
        for layer in range(len(self.arrays) - 2, -1, -2):
            a = values[layer // 2]
            found = [a.T @ g, g.sum(axis=0), *found]
            g = g @ self.arrays[layer].T
            if layer:
                g = g * (1.0 - a**2)
        return found, g


@dataclass
class Adam:
    """Adam [1]_ over a list of arrays, which it changes in place.

    Attributes
    ----------
    arrays : list of ndarray
        Parameters.

    References
    ----------
    .. [1] D. P. Kingma, J. Ba, Adam: a method for stochastic optimization, ICLR, 2015, arXiv:1412.6980.
    """

    arrays: list[Rows32]
    _steps: int = 0
    _means: list[Rows32] = field(default_factory=list)
    _squares: list[Rows32] = field(default_factory=list)

    def step(self, gradients: Sequence[Rows32], rate: float) -> None:
        """Take one step against the gradients."""
        if not self._means:
            self._means = [np.zeros_like(a) for a in self.arrays]
            self._squares = [np.zeros_like(a) for a in self.arrays]
        self._steps += 1
        size = rate * np.sqrt(1.0 - 0.999**self._steps) / (1.0 - 0.9**self._steps)
        for a, g, mean, square in zip(self.arrays, gradients, self._means, self._squares, strict=True):
            mean += 0.1 * (g - mean)
            square += 0.001 * (g * g - square)
            a -= np.float32(size) * mean / (np.sqrt(square) + np.float32(1e-8))


def batches(cases: int, size: int, random: np.random.Generator) -> Iterator[NDArray[np.int64]]:
    """Deal the cases into batches, in random order; the last few that fill none wait for another epoch."""
    order = random.permutation(cases)
    for first in range(0, max(cases - size, 0) + 1, size):
        yield order[first : first + size]

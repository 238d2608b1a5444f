"""The networks of the detectors: neuro-fuzzy ones as in the thesis, residual ones, and how these are trained.

Symbols, as in Chapter 6 of [1]_: ``I`` input (damage feature index), ``X`` reference inputs, ``D`` distance, ``S``
similarity, ``w1`` distance weights, ``b`` bias, ``w2`` rule weights, ``O`` memberships of the damage in the fuzzy sets,
``peaks`` damage at which each set has membership one. Of what is trained here: ``W``, ``b`` weights and biases of a layer,
``a`` what they give, ``h`` values of a layer, ``x`` inputs, ``g`` gradients of the loss. Its arrays are single precision,
one row per case.

Correction of the source: similarity falls with distance, so Eq. (6.3) must read S = 1 / (1 + exp(-(b - D))).

References
----------
.. [1] M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite
   Sensors, dissertation, Virginia Tech, 2010, Chapters 6 and 7.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Vector

Defuzzification = Literal["centroid", "mom", "som", "lom"]
Rows32 = NDArray[np.floating[Any]]  # single precision where it is trained
PEAKS = (0.0, 0.25, 0.5)  # damage at which a zone has membership one in each fuzzy set [1]
LEAST_SPREAD = 1e-5  # added to the variance of the values of a layer
LONGEST = 5.0  # gradient of all arrays
DECAY = 0.01  # of the weights, relative to the rate


def similarity(I: ca.MX, X: ca.MX, w1: ca.MX, b: float) -> ca.MX:
    """Return the similarity of an input with every reference input, Eqs. (6.1) and (6.3).

    Parameters
    ----------
    I : shape (m, 1)
        Input [1].
    X : shape (n, m)
        Reference inputs [1].
    w1 : shape (n, m)
        Weights of the squared differences, not negative.
    b : float
        Bias: the distance at which the similarity is one half.

    Returns
    -------
    shape (n, 1)
        Similarities between 0 and 1.
    """
    rows = ca.mtimes(ca.DM.ones(X.shape[0], 1), I.T)  # one loop of C; repmat would be one per row
    D = ca.sum2(w1 * (X - rows) ** 2)
    return 1.0 / (1.0 + ca.exp(D - b))


def triangular_memberships(damage: ArrayLike, peaks: ArrayLike) -> Vector:
    """Return the memberships of damages in triangular fuzzy sets that share their feet with the neighbours' peaks.

    Parameters
    ----------
    damage : array_like, shape (...)
        Damage [1]; beyond the last peak the last membership stays one.
    peaks : array_like, shape (k,)
        Increasing peaks [1].

    Returns
    -------
    ndarray, shape (..., k)
        Memberships; they add up to one.
    """
    p, x = np.asarray(peaks, dtype=float), np.asarray(damage, dtype=float)
    return np.stack([np.interp(x, p, row) for row in np.eye(p.size)], axis=-1)


def defuzzify(O: ca.MX, peaks: ca.DM, method: Defuzzification = "centroid", least: float = 1e-300) -> ca.MX:
    """Turn memberships into crisp values.

    Parameters
    ----------
    O : shape (k, z)
        Memberships in k fuzzy sets, one column per network; negative ones count as zero.
    peaks : casadi.DM, shape (k, 1)
        Increasing values at which each set has membership one.
    method : {"centroid", "mom", "som", "lom"}
        Centroidal matching, Eq. (6.4), or the middle, smallest or largest of the sets of largest membership.
    least : float
        Added to the sum of the memberships that the centroid is divided by.

    Returns
    -------
    shape (1, z)
        Crisp values; 0 where no set has a membership.
    """
    sets = [ca.fmax(row, 0.0) for row in ca.vertsplit(O)]
    values = [float(peak) for peak in peaks.full().ravel()]
    if method == "centroid":
        moment = sum(membership * value for membership, value in zip(sets, values, strict=True))
        return moment / (sum(sets) + least)
    largest = functools.reduce(ca.fmax, sets)
    smallest_peak, largest_peak = values[-1], values[0]
    for membership, value in zip(sets, values, strict=True):
        largest_peak = ca.if_else(membership >= largest, value, largest_peak)
    for membership, value in zip(reversed(sets), reversed(values), strict=True):
        smallest_peak = ca.if_else(membership >= largest, value, smallest_peak)
    crisp = {"som": smallest_peak, "lom": largest_peak, "mom": 0.5 * (smallest_peak + largest_peak)}[method]
    return ca.if_else(largest > 0.0, crisp, 0.0)


@dataclass(frozen=True)
class Perceptron:
    """Layers of a perceptron: tanh, the last one linear.

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


@dataclass(frozen=True)
class ResidualNetwork:
    """Layers that add to the values before them; the first and the last one replace them.

    Attributes
    ----------
    arrays : list of ndarray
        W and b of the first layer, shapes (inputs, width) and (width,), of each layer that adds, (width, width) and
        (width,), and of the last one, (width, outputs) and (outputs,).

    Notes
    -----
    :math:`h_0 = silu(x W + b)`, :math:`h_{k+1} = h_k + silu(norm(h_k) W + b)` as in [1]_, and outputs :math:`h W + b`, with
    :math:`silu(a) = a / (1 + e^{-a})`. ``norm`` takes mean and deviation of the values of a case away [2]_; its usual
    weights are part of W and b.

    References
    ----------
    .. [1] K. He, X. Zhang, S. Ren, J. Sun, Deep residual learning for image recognition, CVPR, 2016, arXiv:1512.03385.
    .. [2] J. L. Ba, J. R. Kiros, G. E. Hinton, Layer normalization, 2016, arXiv:1607.06450.
    """

    arrays: list[Rows32]

    @classmethod
    def random(cls, inputs: int, width: int, layers: int, outputs: int, random: np.random.Generator) -> ResidualNetwork:
        """Make a network with random weights, and an output near 0."""
        arrays = Perceptron.random((inputs, *[width] * (layers + 1), outputs), random).arrays
        arrays[-2] *= np.float32(0.01)
        return cls(arrays)

    def values(self, x: Rows32) -> list[Rows32]:
        """Return the values of all layers, beginning with the input."""
        W, b = self.arrays[:2]
        found = [x, silu(x @ W + b)]
        for layer in range(2, len(self.arrays) - 2, 2):
            W, b = self.arrays[layer : layer + 2]
            found.append(found[-1] + silu(_norm(found[-1])[0] @ W + b))
        return [*found, found[-1] @ self.arrays[-2] + self.arrays[-1]]

    def gradients(self, values: Sequence[Rows32], g: Rows32) -> list[Rows32]:
        """Propagate the gradient of the outputs, shape (n, outputs), back; return it as ``arrays``."""
        x, *h, _ = values
        found = [h[-1].T @ g, g.sum(axis=0)]
        g = g @ self.arrays[-2].T
        for layer in range(len(self.arrays) - 4, 0, -2):
            W, b = self.arrays[layer : layer + 2]
            y, scale = _norm(h[layer // 2 - 1])
            of_a = g * _slope(y @ W + b)
            found = [y.T @ of_a, of_a.sum(axis=0), *found]
            of_y = of_a @ W.T
            means = of_y.mean(axis=1, keepdims=True), np.mean(of_y * y, axis=1, keepdims=True)
            g = g + scale * (of_y - means[0] - y * means[1])
        of_a = g * _slope(x @ self.arrays[0] + self.arrays[1])
        return [x.T @ of_a, of_a.sum(axis=0), *found]


def silu(a: Rows32) -> Rows32:
    """Return values times their logistic function."""
    return np.asarray(a / (1.0 + np.exp(-a)))


def _slope(a: Rows32) -> Rows32:
    share = 1.0 / (1.0 + np.exp(-a))
    return np.asarray(share * (1.0 + a * (1.0 - share)))


def _norm(h: Rows32) -> tuple[Rows32, Rows32]:
    """Return the values of each case less their mean, over their deviation, and one over that."""
    centred = h - h.mean(axis=1, keepdims=True)
    scale = 1.0 / np.sqrt(np.mean(centred**2, axis=1, keepdims=True) + h.dtype.type(LEAST_SPREAD))
    return centred * scale, scale


@dataclass
class Adam:
    """Adam [1]_ over a list of arrays, which it changes in place, with weights that decay [2]_.

    Attributes
    ----------
    arrays : list of ndarray
        Parameters.

    References
    ----------
    .. [1] D. P. Kingma, J. Ba, Adam: a method for stochastic optimization, ICLR, 2015, arXiv:1412.6980.
    .. [2] I. Loshchilov, F. Hutter, Decoupled weight decay regularization, ICLR, 2019, arXiv:1711.05101.
    """

    arrays: list[Rows32]
    _steps: int = 0
    _means: list[Rows32] = field(default_factory=list)
    _squares: list[Rows32] = field(default_factory=list)

    def step(self, gradients: Sequence[Rows32], rate: float) -> None:
        """Take one step against the gradients, which together are no longer than ``LONGEST``."""
        if not self._means:
            self._means = [np.zeros_like(a) for a in self.arrays]
            self._squares = [np.zeros_like(a) for a in self.arrays]
        self._steps += 1
        length = np.sqrt(sum(float(np.vdot(g, g)) for g in gradients))
        shorter = np.float32(min(1.0, LONGEST / max(length, LONGEST)))
        size = rate * np.sqrt(1.0 - 0.999**self._steps) / (1.0 - 0.9**self._steps)
        for a, g, mean, square in zip(self.arrays, gradients, self._means, self._squares, strict=True):
            each = shorter * g
            mean += np.float32(0.1) * (each - mean)
            square += np.float32(0.001) * (each * each - square)
            a *= np.float32(1.0 - rate * DECAY)
            a -= np.float32(size) * mean / (np.sqrt(square) + np.float32(1e-8))

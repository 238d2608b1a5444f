"""The networks of the detectors: similarity-based neuro-fuzzy ones as in the thesis, a perceptron, and how they are trained.

Symbols, as in Chapter 6 of [1]_: ``I`` input (damage feature index), ``X`` reference inputs, ``D`` distance, ``S``
similarity, ``w1`` distance weights, ``b`` bias, ``w2`` rule weights, ``O`` memberships of the damage in the fuzzy sets,
``peaks`` damage at which each set has membership one. Of what is trained here: ``W``, ``b`` weights and biases of a layer,
``a`` its values; ``f`` features; ``T`` weights of the indices; ``V`` roots of the distance weights; ``R``, ``c`` weights and
bias of the output layer; ``g`` gradients of the loss. Its arrays are single precision, one row per case.

Correction of the source: similarity falls with distance, so Eq. (6.3) must read S = 1 / (1 + exp(-(b - D))).

References
----------
.. [1] M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite
   Sensors, dissertation, Virginia Tech, 2010, Chapters 6 and 7.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
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
LEAST = 1e-3  # added to the sum of the memberships, so that no similarity at all gives no damage
BIAS, NEAR = 2.0, 0.6  # of the first similarities: about a tenth on average


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


@dataclass(frozen=True)
class FuzzyRules:
    """Indices, similarities with reference cases, and rules for q of z zones.

    Attributes
    ----------
    arrays : list of ndarray
        ``T``, shape (F, z); ``X`` and ``V``, shape (n, z); ``b``, shape (1,); ``R``, shape (n, 5 q); ``c``, shape (5 q,).
        The output layer gives the logarithms of the odds of damage of the zones, their memberships in the sets of
        ``PEAKS``, set by set, and the logarithms of their deviations.
    """

    arrays: list[Rows32]

    @classmethod
    def of_cases(cls, f: Rows32, d: Rows32, answered: int, references: int, random: np.random.Generator) -> FuzzyRules:
        """Begin with cases as references, as the thesis does, and with indices that estimate the damages linearly.

        Parameters
        ----------
        f : ndarray, shape (m, F)
            Features of cases.
        d : ndarray, shape (m, z)
            Their damage [1]; the first columns are the zones that the network answers for.
        answered : int
            Number of these.
        references : int
            Number of the cases that become references.
        random : numpy.random.Generator
            Which, and how far each reaches along each index.
        """
        T = np.linalg.solve(f.T @ f + np.eye(f.shape[1]), f.T @ (d - d.mean(axis=0)))
        spread = (f @ T).std(axis=0)
        T /= np.where(spread > 0.0, spread, 1.0)
        chosen = random.choice(len(f), references, replace=False)
        X = f[chosen] @ T
        V = np.exp(random.standard_normal(X.shape)) * NEAR / np.sqrt(X.shape[1])
        S = cls._similarity(f[:1000] @ T, X, V, BIAS)
        O = triangular_memberships(d[chosen, :answered], PEAKS)  # (n, q, k)
        R = np.zeros((references, (2 + len(PEAKS)) * answered))
        R[:, answered:-answered] = O.transpose(0, 2, 1).reshape(references, -1) / S.sum(axis=1).mean()
        return cls([a.astype(np.float32) for a in (T, X, V, np.array([BIAS]), R, np.zeros(R.shape[1]))])

    @staticmethod
    def _similarity(I: Rows32, X: Rows32, V: Rows32, b: Rows32 | float) -> Rows32:
        w = V * V
        D = (I * I) @ w.T - 2.0 * I @ (w * X).T + np.sum(w * X * X, axis=1)
        return np.asarray(1.0 / (1.0 + np.exp(np.clip(D - b, -60.0, 60.0))))

    def values(self, f: Rows32) -> list[Rows32]:
        """Return features, indices, values of the output layer, similarities, and heads: odds, mean and deviation."""
        T, X, V, b, R, c = self.arrays
        I = f @ T
        S = self._similarity(I, X, V, b)
        a = S @ R + c
        logit, O, total, spread = _parts(a)
        mean = np.einsum("nkz,k->nz", O, np.array(PEAKS, f.dtype)) / total
        return [f, I, a, S, np.hstack([logit, mean, spread])]

    def gradients(self, values: Sequence[Rows32], g: Rows32) -> tuple[list[Rows32], Rows32]:
        """Propagate the gradient of the heads, shape (n, 3 q), back; return it as ``arrays``, and for the features."""
        T, X, V, _, R, _ = self.arrays
        f, I, a, S, heads = values
        _, O, total, _ = _parts(a)
        logit, mean, spread = np.split(g, 3, axis=1)
        slope = (np.array(PEAKS, f.dtype)[:, None] - np.split(heads, 3, axis=1)[1][:, None]) / total[:, None]
        of_O = (mean[:, None] * slope * (O > 0.0)).reshape(len(f), -1)
        g_a = np.hstack([logit, of_O, spread])
        g_D = -(g_a @ R.T) * S * (1.0 - S)
        w = V * V
        weighed, count = g_D.T @ I, g_D.sum(axis=0)[:, None]
        g_w = g_D.T @ (I * I) - 2.0 * X * weighed + X * X * count
        g_I = 2.0 * (I * (g_D @ w) - g_D @ (w * X))
        found = [f.T @ g_I, -2.0 * w * (weighed - X * count), 2.0 * V * g_w, -g_D.sum(keepdims=True)[0], S.T @ g_a]
        return [*found, g_a.sum(axis=0)], g_I @ T.T


def _parts(a: Rows32) -> tuple[Rows32, Rows32, Rows32, Rows32]:
    """Split the output layer: odds (n, q), memberships (n, k, q) and their sums (n, q), logarithms of deviations (n, q)."""
    parts = a.reshape(len(a), 2 + len(PEAKS), -1)
    O = np.maximum(parts[:, 1:-1], 0.0)
    return parts[:, 0], O, O.sum(axis=1) + a.dtype.type(LEAST), parts[:, -1]

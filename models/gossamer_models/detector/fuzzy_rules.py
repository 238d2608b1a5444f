"""The neuro-fuzzy network of the thesis with indices that are trained: values and gradients in NumPy.

Symbols: ``f`` features; ``T`` weights of the indices; ``I`` indices; ``X`` reference inputs; ``V`` roots of the distance
weights; ``D`` distance, ``b`` bias and ``S`` similarity, Eqs. (6.1) and (6.3) as ``neurofuzzy.py`` reads them; ``R``, ``c``
weights and bias of the output layer, ``a`` its values; ``O`` memberships; ``g`` gradients of the loss. Arrays are single
precision, one row per case.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .neurofuzzy import triangular_memberships
from .perceptron import Rows32

INDICES = 16
PEAKS = (0.0, 0.25, 0.5)  # damage at which a zone has membership one in each fuzzy set [1]
QUADRANT = 4  # zones that a network answers for
LEAST = 1e-3  # added to the sum of the memberships, so that no similarity at all gives no damage
BIAS, NEAR = 2.0, 0.6  # of the first similarities: about a tenth on average


@dataclass(frozen=True)
class FuzzyRules:
    """Sixteen indices, similarities with reference cases, and rules for the zones of a quadrant.

    Attributes
    ----------
    arrays : list of ndarray
        ``T``, shape (F, 16); ``X`` and ``V``, shape (n, 16); ``b``, shape (1,); ``R``, shape (n, 20); ``c``, shape (20,).
        The output layer gives the logarithms of the odds of damage of four zones, their memberships in the sets of
        ``PEAKS``, set by set, and the logarithms of their deviations.
    """

    arrays: list[Rows32]

    @classmethod
    def of_cases(cls, f: Rows32, d: Rows32, references: int, random: np.random.Generator) -> FuzzyRules:
        """Begin with cases as references, as the thesis does, and with indices that estimate the damages linearly.

        Parameters
        ----------
        f : ndarray, shape (m, F)
            Features of cases.
        d : ndarray, shape (m, 16)
            Their damage [1]; the first columns are the zones that the network answers for.
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
        V = np.exp(random.standard_normal(X.shape)) * NEAR / np.sqrt(INDICES)
        S = cls._similarity(f[:1000] @ T, X, V, BIAS)
        O = triangular_memberships(d[chosen, :QUADRANT], PEAKS)  # (n, 4, k)
        R = np.zeros((references, (2 + len(PEAKS)) * QUADRANT))
        R[:, QUADRANT:-QUADRANT] = O.transpose(0, 2, 1).reshape(references, -1) / S.sum(axis=1).mean()
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
        O, total = _memberships(a)
        mean = np.einsum("nkz,k->nz", O, np.array(PEAKS, f.dtype)) / total
        return [f, I, a, S, np.hstack([a[:, :QUADRANT], mean, a[:, -QUADRANT:]])]

    def gradients(self, values: Sequence[Rows32], g: Rows32) -> tuple[list[Rows32], Rows32]:
        """Propagate the gradient of the heads, shape (n, 12), back; return it as ``arrays``, and for the features."""
        T, X, V, _, R, _ = self.arrays
        f, I, a, S, heads = values
        O, total = _memberships(a)
        logit, mean, spread = np.split(g, 3, axis=1)
        slope = (np.array(PEAKS, f.dtype)[:, None] - heads[:, None, QUADRANT:-QUADRANT]) / total[:, None]
        of_O = (mean[:, None] * slope * (O > 0.0)).reshape(len(f), -1)
        g_a = np.hstack([logit, of_O, spread])
        g_D = -(g_a @ R.T) * S * (1.0 - S)
        w = V * V
        weighed, count = g_D.T @ I, g_D.sum(axis=0)[:, None]
        g_w = g_D.T @ (I * I) - 2.0 * X * weighed + X * X * count
        g_I = 2.0 * (I * (g_D @ w) - g_D @ (w * X))
        found = [f.T @ g_I, -2.0 * w * (weighed - X * count), 2.0 * V * g_w, -g_D.sum(keepdims=True)[0], S.T @ g_a]
        return [*found, g_a.sum(axis=0)], g_I @ T.T


def _memberships(a: Rows32) -> tuple[Rows32, Rows32]:
    """Return memberships, shape (n, k, 4), and their sums, shape (n, 4), from the values of the output layer."""
    O = np.maximum(a[:, QUADRANT:-QUADRANT].reshape(len(a), len(PEAKS), QUADRANT), 0.0)
    return O, O.sum(axis=1) + a.dtype.type(LEAST)

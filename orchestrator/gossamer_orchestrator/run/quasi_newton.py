r"""The next guess at a fixed point, from earlier ones: interface quasi-Newton with an inverse Jacobian from least squares.

Symbols: ``x`` guess, ``y = H(x)`` what a sweep makes of it, ``r = y - x`` residual; ``V``, ``W`` changes of ``r`` and ``y``.

With the newest guess :math:`x_k` and the earlier ones :math:`x_i` (IQN-ILS of [1]_):

.. math:: V_i = r_i - r_k, \quad W_i = y_i - y_k, \quad c = \arg\min \|V c + r_k\|, \quad x_{k+1} = y_k + W c

For a linear ``H`` of n values that is exact after n + 1 sweeps, whether plain repetition converges or not.

References
----------
.. [1] J. Degroote, K.-J. Bathe, J. Vierendeels, Performance of a new partitioned procedure versus a monolithic procedure in
   fluid-structure interaction, Computers & Structures 87, 793-801, 2009.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_SINGULAR = 1e-10  # smaller directions, relative to the largest, are left out

Vector = NDArray[np.float64]


def next_guess(guesses: Sequence[Vector], results: Sequence[Vector], scale: Vector) -> Vector:
    """Return the next guess at a fixed point.

    Parameters
    ----------
    guesses, results : sequence of numpy.ndarray, shape (n,)
        Guesses so far and what came of them, the newest last; finite.
    scale : numpy.ndarray, shape (n,)
        Size of each value, positive.

    Returns
    -------
    numpy.ndarray, shape (n,)
    """
    x, y = np.array(guesses[-1 - len(scale) :]), np.array(results[-1 - len(scale) :])
    r = (y - x) / scale
    V, W = (r[:-1] - r[-1]).T, (y[:-1] - y[-1]).T
    sizes = np.linalg.norm(V, axis=0)
    useful = sizes > 0.0
    if not useful.any():
        return results[-1]
    V, W = V[:, useful] / sizes[useful], W[:, useful] / sizes[useful]
    c = np.linalg.lstsq(V, -r[-1], rcond=_SINGULAR)[0]
    return np.asarray(y[-1] + W @ c)

r"""Newton's method with sparse tangents, for statics and implicit steps.

Symbols: ``r`` residual, ``K`` its derivative, ``q`` unknowns.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from numpy.typing import NDArray

from gossamer_models.errors import ConvergenceError

Vector = NDArray[np.float64]


def sparse(matrix: ca.DM) -> scipy.sparse.csc_matrix:
    """Convert a sparse CasADi matrix to SciPy without copying its pattern by hand."""
    column_starts, rows = matrix.sparsity().get_ccs()
    return scipy.sparse.csc_matrix((np.array(matrix.nonzeros()), rows, column_starts), shape=matrix.shape)


def solve_newton(
    residual: Callable[[Vector], Vector],
    tangent: Callable[[Vector], scipy.sparse.csc_matrix],
    q: Vector,
    tolerance: float,
    what: str,
    max_iterations: int = 25,
) -> Vector:
    """Find the root of a residual by Newton's method.

    Parameters
    ----------
    residual, tangent : callable
        ``r(q)``, shape (n,), and ``dr/dq``, sparse (n, n).
    q : ndarray, shape (n,)
        Where to start.
    tolerance : float
        Largest component of a correction, in the unit of ``q``, at which iteration ends.
    what : str
        What is solved, for the message.
    max_iterations : int
        How many corrections to try.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    ConvergenceError
        The corrections do not become small.
    """
    change = np.inf
    for _ in range(max_iterations):
        correction = -scipy.sparse.linalg.splu(tangent(q)).solve(residual(q))
        q = q + correction
        change = float(np.abs(correction).max())
        if change <= tolerance:
            return q
        if not np.isfinite(change):
            break
    msg = (
        f"{what} did not converge: last correction {change:.3e} > {tolerance:.3e} after {max_iterations} iterations. "
        "Raise the prestress, or take more load steps or shorter time steps."
    )
    raise ConvergenceError(msg)

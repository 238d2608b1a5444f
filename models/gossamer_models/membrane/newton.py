r"""Newton's method with sparse tangents, for statics and implicit steps.

Symbols: ``r`` residual, ``K`` its derivative by the unknowns ``q``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from ..arrays import Vector
from ..errors import ConvergenceError


def solve_newton(
    system: Callable[..., tuple[Vector, scipy.sparse.csc_matrix]],
    arguments: tuple[Any, ...],
    q: Vector,
    tolerance: float,
    what: str,
    max_iterations: int = 25,
) -> Vector:
    """Find the root of a residual by Newton's method.

    Parameters
    ----------
    system : callable
        ``system(q, *arguments) -> (r, K)``, residual, shape (n,), and its derivative, sparse (n, n).
    arguments : tuple
        What else ``system`` needs.
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
        r, K = system(q, *arguments)
        try:
            correction = -scipy.sparse.linalg.splu(K).solve(r)
        except RuntimeError:  # an exactly singular tangent
            break
        q = q + correction
        change = float(np.abs(correction).max())
        if change <= tolerance:
            return q
        if not np.isfinite(change):
            break
    msg = (
        f"{what} did not converge: last correction {change:.3e} > {tolerance:.3e} within {max_iterations} iterations. "
        "Raise the prestress, or take more load steps or shorter time steps."
    )
    raise ConvergenceError(msg)

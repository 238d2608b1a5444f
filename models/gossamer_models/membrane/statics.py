r"""Static equilibrium under pressure, by load steps and Newton's method.

Symbols: ``q`` displacements [m] from the homogeneous stretch, ``K`` tangent [N/m].
"""

from __future__ import annotations

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike

from ..arrays import Vector
from .assembly import MembraneEquations
from .newton import solve_newton
from .params import MembraneParams

# correction [side lengths] at which Newton's method ends; the error left is about its square
TOLERANCE = 1e-9


def static_deflection(
    equations: MembraneEquations,
    params: MembraneParams,
    pressure: float = 0.0,
    damage: ArrayLike = 0.0,
    load_steps: int = 4,
) -> Vector:
    """Find the equilibrium under a constant follower pressure; the built-in pressure does not act.

    Parameters
    ----------
    equations : MembraneEquations
        The mesh and its forces.
    params : MembraneParams
        The membrane.
    pressure : float
        Follower pressure [Pa].
    damage : array_like
        Lost fraction [1] of each zone's modulus, shape (16,) or scalar.
    load_steps : int
        In how many parts the pressure is applied. They grow like the cube of their number, since a membrane is softest at
        first: its deflection follows the cube root of a large pressure.

    Returns
    -------
    ndarray, shape (n_q,)
        Displacements [m] of the interior nodes from the homogeneous stretch.

    Raises
    ------
    ConvergenceError
        Newton's method failed.
    """
    p = params.vector()

    def system(q: Vector, load: float) -> tuple[Vector, scipy.sparse.csc_matrix]:
        f = equations.force(q, damage, load, p)
        return np.asarray(f).ravel(), -equations.tangent(q, damage, load, p).sparse()

    q = np.zeros(equations.n_q)
    loads = [0.0] if pressure == 0.0 else [pressure * (k / load_steps) ** 3 for k in range(load_steps + 1)]
    for load in loads:
        what = f"membrane equilibrium at {load:g} Pa"
        q = solve_newton(system, (load,), q, TOLERANCE * params.side_length, what)
    return q

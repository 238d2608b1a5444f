r"""Natural frequencies of the membrane about an equilibrium.

Symbols: ``K`` tangent [N/m], ``M`` mass [kg], ``omega`` [rad/s].
"""

from __future__ import annotations

import numpy as np
import scipy.sparse.linalg
from gossamer_models import ParameterError
from gossamer_models.membrane import MembraneParams
from numpy.typing import ArrayLike, NDArray
from studies.square import SquareEquations


def natural_frequencies(
    equations: SquareEquations,
    params: MembraneParams,
    q: ArrayLike = 0.0,
    damage: ArrayLike = 0.0,
    count: int = 6,
    mass: str = "lumped",
    highest: bool = False,
) -> NDArray[np.float64]:
    r"""Solve :math:`K \varphi = \omega^2 M \varphi` for the lowest or highest undamped frequencies without pressure.

    Parameters
    ----------
    equations : SquareEquations
        The mesh and its forces.
    params : MembraneParams
        The membrane.
    q : array_like
        Displacements [m] from the homogeneous stretch, shape (n_q,); 0 is the undamaged prestressed plane.
    damage : array_like
        Lost fraction [1] of each zone's modulus, shape (16,) or scalar.
    count : int
        How many frequencies.
    mass : {"lumped", "consistent"}
        Which mass matrix.
    highest : bool
        Return the highest ones, which limit an explicit step, in place of the lowest.

    Returns
    -------
    ndarray, shape (count,)
        Frequencies [Hz], increasing. A direction without stiffness, as in a slack membrane, gives 0.

    Raises
    ------
    ParameterError
        ``count`` is not from 1 to the number of degrees of freedom less one.
    """
    if not 0 < count < equations.n_q:
        msg = f"count is {count}; this mesh has 1 to {equations.n_q - 1} frequencies to ask for"
        raise ParameterError(msg)
    K = equations.tangent(q, damage, 0.0, params.vector()).sparse()
    K = (K + K.T) / 2.0  # symmetric but for round-off
    M = equations.lumped_mass(params) if mass == "lumped" else equations.consistent_mass(params)
    start = np.cos(np.arange(equations.n_q))  # ARPACK's own start is random
    if highest:
        squares = scipy.sparse.linalg.eigsh(K, count, M, which="LA", v0=start, return_eigenvectors=False)
    else:
        # a shift a little below zero, so that a membrane without stiffness can be factorized
        shift = -1e-9 * scipy.sparse.linalg.norm(K, 1) / M.max()
        squares = scipy.sparse.linalg.eigsh(K, count, M, sigma=shift, v0=start, return_eigenvectors=False)
    return np.asarray(np.sqrt(np.maximum(np.sort(squares), 0.0)) / (2.0 * np.pi))

r"""The slowest vibration of a structure about its equilibrium.

Symbols: ``K`` tangent [N/m], ``M`` masses [kg], ``n`` normals, ``k`` factor on inertia along the surface [1], ``omega``
angular frequency [1/s].
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike
from scipy.sparse.linalg import eigsh

from ..errors import ConvergenceError
from .model import membrane_model
from .statics import Equilibrium
from .structure import Structure

_SHIFT = 1e-6  # of the largest stiffness over mass: below all frequencies, so that a slack film can be factored


def first_period(structure: Structure, given: Mapping[str, ArrayLike] | None = None) -> float:
    r"""Return the longest period of small vibrations about equilibrium [s], without damping and without the gas' stiffness.

    Parameters
    ----------
    structure : Structure
        The membrane.
    given : mapping of str to float, optional
        Parameters and inputs that differ from their start values.

    Raises
    ------
    ConvergenceError
        There is no equilibrium.

    Notes
    -----
    The smallest :math:`\omega` of :math:`K v = \omega^2 M v`, with the inertia of the model,
    :math:`M = m\,(n n^T + k\,(1 - n n^T))`.
    """
    equilibrium = Equilibrium(structure, membrane_model(structure))
    found = equilibrium.solve(given or {"damage": np.zeros((1, structure.n_zones))})
    if found.failed[0]:
        msg = "there is no equilibrium to vibrate about. Check supports, prestress and loads of the setup."
        raise ConvergenceError(msg)
    K = equilibrium.tangent(found, 0)
    normals, k = structure.normals[structure.moving], structure.setup.inplane_mass
    across = np.einsum("ni,nj->nij", normals, normals)
    blocks = structure.mass[structure.moving, None, None] * (across + k * (np.eye(3) - across))
    M = scipy.sparse.block_diag([scipy.sparse.csc_array(each) for each in blocks], format="csc")
    M = M[:, equilibrium.free][equilibrium.free]
    shift = -_SHIFT * float(np.max(np.abs(K.diagonal()) / M.diagonal()))
    values = eigsh(K, 1, M=M, sigma=shift, return_eigenvectors=False)
    return math.tau / math.sqrt(max(float(values[0]), -shift))

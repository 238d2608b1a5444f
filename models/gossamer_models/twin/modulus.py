r"""Damage of many zones or another Young's modulus: which explains a record with less.

Symbols: ``e`` relative change of Young's modulus [1], ``d`` damages beside it. Both enter as :math:`(1 + e)(1 - d_k)` alone,
which is :math:`1 - (d_k - e)` for a zone without damage: a modulus is a common move of all damages by ``-e``. For a damaged
zone that is not exact, but its own damage makes up for it.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Matrix
from ..membrane.mesh import N_ZONES
from .least_squares import Quadratic
from .nuisances import LOAD, MODULUS
from .quadratic import change
from .search import Fit, box
from .sparse import THRESHOLD, Box, drop_zones

MANY = 4  # zones: fewer are no imitation of a modulus
WIDEST = 0.2  # of a change of the modulus


def modulus_instead(fit: Fit) -> float | None:
    """Return the relative change of Young's modulus that explains a record with fewer damages, or None.

    Parameters
    ----------
    fit : Fit
        Without the nuisance ``modulus``.
    """
    if np.count_nonzero(fit.point.x[:N_ZONES] > 0.0) <= MANY:
        return None
    model, limits = fit.model, box(fit.problem, fit.model.at)
    n = len(model.g)
    M: Matrix = np.eye(n, n + 1)
    M[:N_ZONES, n] = -1.0
    A, at = M.T @ model.A @ M, np.append(model.at, 0.0)
    A[n, n] += LOAD[MODULUS][1] ** -2
    wider = Quadratic(A=A, g=M.T @ model.g, at=at)
    with_modulus = Box(
        zones=np.append(limits.zones, False), low=np.append(limits.low, -WIDEST), high=np.append(limits.high, WIDEST)
    )
    worth, changes = [], []
    for quadratic, bounds in ((model, limits), (wider, with_modulus)):
        kept, move = drop_zones(quadratic, bounds)
        worth.append(change(quadratic.A, quadratic.g, move) + THRESHOLD * np.count_nonzero(kept & bounds.zones))
        changes.append(float(move[-1]))
    return changes[1] if worth[1] < worth[0] - THRESHOLD else None

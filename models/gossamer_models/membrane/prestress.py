r"""Static equilibrium of the stretched, unloaded membrane, Section 7.2 of the thesis, as part of ``init``.

Symbols: ``q`` displacements [m] from the homogeneous stretch, ``f`` forces [N], ``K`` tangent [N/m].
"""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca

from ..variables import by_name, in_order
from .assembly import MembraneEquations
from .params import PARAMETERS, stretch

NEWTON_STEPS = 8
# largest force left on a node, over modulus * thickness * element size * stretch^3; round-off is 1e-16 of it
TOLERANCE = 1e-11


def prestress(equations: MembraneEquations, damage: ca.MX, p: SimpleNamespace) -> tuple[ca.MX, ca.MX, ca.MX]:
    r"""Write the in-plane equilibrium with damaged zones.

    Parameters
    ----------
    equations : MembraneEquations
        Forces and tangent.
    damage : casadi.MX, shape (16,)
        Lost fraction [1] of each zone's modulus.
    p : SimpleNamespace
        Parameters by name.

    Returns
    -------
    casadi.MX, shape (n_q,)
        Displacements [m] from the homogeneous stretch; not a number where a force stays above ``TOLERANCE``.
    casadi.MX, scalar
        Largest :math:`\rho c^2` [Pa] there.
    casadi.MX, scalar
        Twice the largest principal Green-Lagrange strain [1] there.

    Notes
    -----
    A fixed number of Newton steps from the homogeneous stretch, with sparse LDL factors of the symmetric in-plane tangent,
    so that the function has no iteration that could run away and can be generated as C.
    """
    in_plane = [3 * k + axis for k in range(equations.n_q // 3) for axis in (0, 1)]
    symbols = [ca.MX.sym("q", equations.n_q), ca.MX.sym("damage", damage.numel()), ca.MX.sym("p", len(PARAMETERS))]
    q, d, vector = symbols
    named = by_name(PARAMETERS, vector)
    f, *_ = equations.force_expression(q, d, 0.0, named)
    K = equations.tangent_expression(q, d, 0.0, named, axes=2)
    q_next = q + 0.0
    q_next[in_plane] += ca.solve(K, f[in_plane], "ldl")
    newton = ca.Function("newton", symbols, [q_next])

    q = ca.MX.zeros(equations.n_q)
    for _ in range(NEWTON_STEPS):
        q = newton(q, damage, in_order(PARAMETERS, {row.name: getattr(p, row.name) for row in PARAMETERS}))
    f, wave, strain = equations.force_expression(q, damage, 0.0, p)
    scale = p.youngs_modulus * p.thickness * p.side_length / equations.mesh.elements_per_side * stretch(p) ** 3
    return ca.if_else(ca.norm_inf(f) <= TOLERANCE * scale, q, float("nan")), wave, strain

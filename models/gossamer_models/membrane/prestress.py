r"""Static equilibrium of the stretched, unloaded membrane, as part of ``init``.

Symbols: ``q`` displacements [m] from the homogeneous stretch, ``r`` their in-plane part, ``K`` in-plane tangent [N/m].
"""

from __future__ import annotations

import casadi as ca

from .equations import MembraneEquations
from .params import named

NEWTON_STEPS = 8
# largest force left on a node, over modulus * thickness * element size * stretch^3; round-off is 1e-16 of it
TOLERANCE = 1e-11


def prestress(equations: MembraneEquations, damage: ca.MX, p: ca.MX) -> tuple[ca.MX, ca.MX]:
    r"""Write the in-plane equilibrium with damaged zones.

    Parameters
    ----------
    equations : MembraneEquations
        Forces and tangent.
    damage : casadi.MX, shape (16,)
        Lost fraction [1] of each zone's modulus.
    p : casadi.MX, shape (10,)
        Parameters.

    Returns
    -------
    casadi.MX, shape (n_q,)
        Displacements [m] from the homogeneous stretch; not a number where the residual stays above ``TOLERANCE``.
    casadi.MX, scalar
        Largest :math:`\rho c^2` [Pa] there.

    Notes
    -----
    A fixed number of Newton steps from the homogeneous stretch, with sparse LDL factors of the symmetric in-plane tangent,
    so that the function has no iteration that could run away and can be generated as C.
    """
    plane = [3 * k + d for k in range(equations.n_q // 3) for d in (0, 1)]
    q = ca.MX.sym("q", equations.n_q)
    zero = ca.MX(0.0)
    d, parameters = ca.MX.sym("damage", damage.shape[0]), ca.MX.sym("p", p.shape[0])
    f, _ = equations.force_expression(q, d, zero, parameters)
    K = equations.tangent_expression(q, d, zero, parameters, directions=(0, 1))
    q_next = q + 0.0
    q_next[plane] += ca.solve(K, f[plane], "ldl")
    newton = ca.Function("newton", [q, d, parameters], [q_next])

    q = ca.MX.zeros(equations.n_q)
    for _ in range(NEWTON_STEPS):
        q = newton(q, damage, p)
    f, wave = equations.force_expression(q, damage, zero, p)
    v = named(p)
    stretch = 1.0 + 2.0 * v["edge_displacement"] / v["side_length"]
    scale = v["youngs_modulus"] * v["thickness"] * v["side_length"] / equations.mesh.elements_per_side * stretch**3
    return ca.if_else(ca.norm_inf(f) <= TOLERANCE * scale, q, ca.DM(equations.n_q * [float("nan")])), wave

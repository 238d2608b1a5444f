r"""Implicit time integration.

Symbols: ``q``, ``v``, ``a`` displacements, velocities, accelerations; ``f`` pressure minus internal forces [N]; ``K``
tangent [N/m]; ``M`` mass [kg]; ``c`` mass damping [1/s]; ``alpha``, ``beta``, ``gamma`` of the HHT method [1]; ``h`` step
[s].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from numpy.typing import ArrayLike

from ..arrays import Vector
from ..errors import ParameterError
from .assembly import MembraneEquations
from .newton import solve_newton
from .params import MembraneParams
from .statics import TOLERANCE, static_deflection

Mass = Literal["lumped", "consistent"]


@dataclass(frozen=True, eq=False)
class MembraneHistory:
    """A computed motion.

    Attributes
    ----------
    time : ndarray, shape (steps + 1,)
        Times [s], from 0.
    q, v : ndarray, shape (steps + 1, n_q)
        Displacements [m] from the homogeneous stretch and velocities [m/s] of the interior nodes.
    """

    time: Vector
    q: Vector
    v: Vector


def integrate_implicit(
    equations: MembraneEquations,
    params: MembraneParams,
    steps: int,
    h: float = 3e-4,
    damage: ArrayLike = 0.0,
    alpha: float = 0.0,
    mass: Mass = "lumped",
) -> MembraneHistory:
    r"""Integrate from rest in the prestressed equilibrium, under the built-in pressure, to verify ``membrane_model``.

    This is the method of the finite element programs that the membrane is compared with. The FMU steps explicitly.

    Parameters
    ----------
    equations : MembraneEquations
        The mesh and its forces.
    params : MembraneParams
        The membrane and its pressure.
    steps : int
        Number of steps.
    h : float
        Step [s].
    damage : array_like
        Lost fraction [1] of each zone's modulus, shape (16,) or scalar.
    alpha : float
        Numerical damping [1], -1/3 to 0; 0 is Newmark's average acceleration method.
    mass : {"lumped", "consistent"}
        Which mass matrix.

    Returns
    -------
    MembraneHistory

    Raises
    ------
    ParameterError
        ``alpha``, ``h`` or ``steps`` has no meaning.
    ConvergenceError
        Newton's method failed in some step.

    Notes
    -----
    The method of [1]_ with :math:`\beta = (1-\alpha)^2/4`, :math:`\gamma = 1/2 - \alpha`, applied to all forces, damping and
    follower pressure included:

    .. math:: M a_{n+1} = (1+\alpha)\,(f - cMv)_{n+1} - \alpha\,(f - cMv)_n.

    References
    ----------
    .. [1] H. M. Hilber, T. J. R. Hughes, R. L. Taylor, Earthquake Engineering & Structural Dynamics 5(3), 283-292, 1977,
       doi:10.1002/eqe.4290050306.
    """
    if not (-1.0 / 3.0 <= alpha <= 0.0 and h > 0.0 and steps >= 1):
        msg = f"alpha={alpha:g}, h={h:g} s, steps={steps}: need -1/3 <= alpha <= 0, h > 0 and at least one step"
        raise ParameterError(msg)
    p = params.vector()
    M = equations.lumped_mass(params) if mass == "lumped" else equations.consistent_mass(params)
    c, beta, gamma = params.mass_damping, (1.0 - alpha) ** 2 / 4.0, 0.5 - alpha
    M_effective = M * ((1.0 + (1.0 + alpha) * c * gamma * h) / (beta * h**2))
    Q, V = np.zeros((steps + 1, equations.n_q)), np.zeros((steps + 1, equations.n_q))

    def force(q: Vector, pressure: float) -> Vector:
        return np.asarray(equations.force(q, damage, pressure, p)).ravel()

    def system(
        q: Vector, pressure: float, q_free: Vector, v_free: Vector, old: Vector
    ) -> tuple[Vector, scipy.sparse.csc_matrix]:
        a = (q - q_free) / (beta * h**2)
        v = v_free + gamma * h * a
        r = M @ a - (1.0 + alpha) * (force(q, pressure) - c * (M @ v)) + alpha * old
        K = equations.tangent(q, damage, pressure, p).sparse()
        return r, M_effective + (1.0 + alpha) * K

    q, v = static_deflection(equations, params, damage=damage), np.zeros(equations.n_q)
    f = force(q, params.pressure(0.0))
    a = scipy.sparse.linalg.spsolve(M, f)
    Q[0] = q
    for k in range(steps):
        pressure = params.pressure((k + 1) * h)
        q_free = q + h * v + h**2 * (0.5 - beta) * a
        v_free = v + h * (1.0 - gamma) * a
        arguments = (pressure, q_free, v_free, f - c * (M @ v))
        q_guess = q_free + beta * h**2 * a
        q = solve_newton(system, arguments, q_guess, TOLERANCE * params.side_length, f"implicit step {k + 1}")
        a = (q - q_free) / (beta * h**2)
        v = v_free + gamma * h * a
        f = force(q, pressure)
        Q[k + 1], V[k + 1] = q, v
    return MembraneHistory(np.asarray(np.arange(steps + 1) * h, dtype=np.float64), Q, V)

r"""Other ways to solve the square's equations than the product's: load steps, and implicit time steps.

Symbols: ``q``, ``v``, ``a`` displacements from the homogeneous stretch, velocities, accelerations; ``f`` pressure minus
internal forces [N]; ``r`` residual; ``K`` tangent [N/m]; ``M`` mass [kg]; ``c`` mass damping [1/s]; ``alpha``, ``beta``,
``gamma`` of the HHT method [1]; ``h`` step [s].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse.linalg
from gossamer_models import ConvergenceError, ParameterError

TOLERANCE = 1e-9  # correction [side lengths] at which Newton's method ends; the error left is about its square


def solve_newton(system, arguments, q, tolerance, what, max_iterations=25):
    """Find the root of ``system(q, *arguments) -> (r, K)`` by Newton's method."""
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
    msg = f"{what} did not converge: last correction {change:.3e} > {tolerance:.3e} within {max_iterations} iterations. "
    msg += "Raise the prestress, or take more load steps or shorter time steps."
    raise ConvergenceError(msg)


def static_deflection(equations, params, pressure=0.0, damage=0.0, load_steps=4):
    """Find the equilibrium under a constant follower pressure; the built-in pressure does not act.

    The load steps grow like the cube of their number, since a membrane is softest at first.
    """
    p = params.vector()

    def system(q, load):
        f = equations.force(q, damage, load, p)
        return np.asarray(f).ravel(), -equations.tangent(q, damage, load, p).sparse()

    q = np.zeros(equations.n_q)
    for load in [0.0] if pressure == 0.0 else [pressure * (k / load_steps) ** 3 for k in range(load_steps + 1)]:
        q = solve_newton(system, (load,), q, TOLERANCE * params.side_length, f"membrane equilibrium at {load:g} Pa")
    return q


@dataclass(frozen=True, eq=False)
class History:
    """Times [s], shape (steps + 1,); displacements [m] and velocities [m/s], shape (steps + 1, n_q)."""

    time: np.ndarray
    q: np.ndarray
    v: np.ndarray


def integrate_implicit(equations, params, steps, h=3e-4, damage=0.0, alpha=0.0, mass="lumped"):
    r"""Integrate from rest in the prestressed equilibrium, under the built-in pressure, as other programs do.

    Notes
    -----
    The method of [1]_ with :math:`\beta = (1-\alpha)^2/4`, :math:`\gamma = 1/2 - \alpha`, applied to all forces, damping and
    follower pressure included; ``alpha`` = 0 is Newmark's average acceleration:

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

    def force(q, pressure):
        return np.asarray(equations.force(q, damage, pressure, p)).ravel()

    def system(q, pressure, q_free, v_free, old):
        a = (q - q_free) / (beta * h**2)
        v = v_free + gamma * h * a
        r = M @ a - (1.0 + alpha) * (force(q, pressure) - c * (M @ v)) + alpha * old
        return r, M_effective + (1.0 + alpha) * equations.tangent(q, damage, pressure, p).sparse()

    q, v = static_deflection(equations, params, damage=damage), np.zeros(equations.n_q)
    f = force(q, params.pressure(0.0))
    a = scipy.sparse.linalg.spsolve(M, f)
    Q[0] = q
    for k in range(steps):
        pressure = params.pressure((k + 1) * h)
        q_free = q + h * v + h**2 * (0.5 - beta) * a
        v_free = v + h * (1.0 - gamma) * a
        arguments, guess = (pressure, q_free, v_free, f - c * (M @ v)), q_free + beta * h**2 * a
        q = solve_newton(system, arguments, guess, TOLERANCE * params.side_length, f"implicit step {k + 1}")
        a = (q - q_free) / (beta * h**2)
        v = v_free + gamma * h * a
        f = force(q, pressure)
        Q[k + 1], V[k + 1] = q, v
    return History(np.arange(steps + 1) * h, Q, V)

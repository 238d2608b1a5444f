r"""Constrained Gauss-Newton with the linear parameters eliminated; ``separable.py`` states when to use which method.

Symbols: ``x`` parameters, ``q`` those of them in which the residual is linear, ``f(x)`` coefficients, ``g(x) >= 0``
constraints, ``p(x)`` regularisation, ``A`` matrix of the record, ``b`` measurement,

.. math:: \min_x \tfrac12 \|A f(x) - b\|^2 + \tfrac12 \|p(x)\|^2, \quad l \le x \le u,\; g(x) \ge 0.

Derivatives of f, g and p come from CasADi; A is compressed by QR once, so a longer record does not cost more.
"""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr, solve_triangular
from scipy.optimize import nnls

from ..arrays import Matrix, Rows, Vector
from ..errors import ConvergenceError
from ..stepper import bind

ROUNDING = 1e-12  # tolerated violation of a constraint, relative to its size or 1


@dataclass(frozen=True, kw_only=True)
class Problem:
    r"""What to minimize.

    Attributes
    ----------
    A : ndarray, shape (m, K)
        Matrix of the record, rows weighted.
    b : ndarray, shape (m,)
        Measurement, weighted.
    model : casadi.Function
        ``x -> (f, g, p)``, shapes (n,) -> (K,), (G,), (S,); g and p are linear in q.
    linear : ndarray of bool, shape (n,)
        Which parameters belong to q.
    lower, upper : ndarray, shape (n,)
        Bounds l and u.
    """

    A: Matrix
    b: Vector
    model: ca.Function
    linear: Rows
    lower: Vector
    upper: Vector


@dataclass(frozen=True, kw_only=True)
class Solution:
    """Where the iteration ended.

    Attributes
    ----------
    x : ndarray, shape (n,)
        Parameters.
    cost : float
        Half the sum of squares, prior included.
    iterations : int
        Steps taken.
    converged : bool
        False if the steps ran out.
    """

    x: Vector
    cost: float
    iterations: int
    converged: bool


def compress(A: Matrix, b: Vector) -> tuple[Matrix, Vector]:
    """Return a triangular system with the same sums of squares."""
    if A.shape[0] <= A.shape[1] + 1:
        return A, b
    R = qr(np.column_stack([A, b]), mode="r", check_finite=False)[0][: A.shape[1] + 1]
    return R[:, :-1], R[:, -1]


def solve_constrained(E: Matrix, e: Vector, G: Matrix, h: Vector) -> Vector:
    r"""Minimize :math:`\|E x - e\|` subject to :math:`G x \ge h`; E has full column rank.

    Notes
    -----
    Least distance programming, chapter 23 of [1]_: with E = QR the problem is the nearest point of a polyhedron, whose dual
    is a non-negative least-squares problem with as many unknowns as constraints. Few of many constraints bind, so
    a constraint is added when the solution violates it; the last solution violates none.

    References
    ----------
    .. [1] C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, SIAM, 1995, doi:10.1137/1.9781611971217.
    """
    n = E.shape[1]
    R = qr(np.column_stack([E, e]), mode="r", check_finite=False)[0]
    R, free = R[:n, :n], R[:n, n]
    x = solve_triangular(R, free, check_finite=False)
    taken = np.zeros(h.size, dtype=bool)
    while (violated := (h - G @ x > ROUNDING * np.maximum(1.0, np.abs(h))) & ~taken).any():
        taken |= violated
        x = _nearest(R, free, G[taken], h[taken])
    return np.asarray(x, dtype=float)


def _nearest(R: Matrix, free: Vector, G: Matrix, h: Vector) -> Vector:
    r"""Minimize :math:`\|R x - free\|` subject to all constraints at once; R is triangular."""
    GR = solve_triangular(R, G.T, trans="T", check_finite=False).T
    short = h - GR @ free
    size = np.maximum(np.linalg.norm(GR, axis=1), 1e-300)
    dual, level = (GR / size[:, None]).T, short / size
    scale = float(np.abs(level).max())
    system = np.vstack([dual, level / scale])
    multipliers, _ = nnls(system, np.append(np.zeros(free.size), 1.0), maxiter=50 * h.size)
    nearest = system @ multipliers
    gap = 1.0 - nearest[-1]
    if gap < 1e-13:
        msg = "the constraints of the fit contradict each other. Widen the bounds of the parameters."
        raise ConvergenceError(msg)
    return np.asarray(solve_triangular(R, free + scale * nearest[:-1] / gap), dtype=float)


class GaussNewton:
    r"""Gauss-Newton on the nonlinear parameters, constrained, damped.

    Parameters
    ----------
    problem : Problem
        What to minimize.

    Notes
    -----
    Variable projection in the form of Algorithm III of [1]_: a step of the full, linearised problem moves the nonlinear
    parameters, then the linear ones are solved for anew. Every inner problem is a least-squares problem with linear
    inequalities and is solved exactly.

    References
    ----------
    .. [1] A. Ruhe, P. A. Wedin, SIAM Review 22(3), 318-337, 1980, doi:10.1137/1022057.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.linear, self.others = np.flatnonzero(problem.linear), np.flatnonzero(~problem.linear)
        q, t = ca.MX.sym("q", self.linear.size), ca.MX.sym("t", self.others.size)
        x = ca.vertcat(q, t)[np.argsort(np.concatenate([self.linear, self.others])).tolist()]
        values = problem.model.call([x], True, False)  # inlined, so that zeros of the derivatives are seen
        self._rows = np.cumsum([value.numel() for value in values])[:-1]
        stacked = ca.vertcat(*values)
        self._value, self._by_q, self._by_t = (
            _Fast(ca.Function(name, [q, t], [ca.densify(result)]), self.linear, self.others)
            for name, result in (("value", stacked), ("by_q", ca.jacobian(stacked, q)), ("by_t", ca.jacobian(stacked, t)))
        )
        self._projected_at = b""
        self._projected: list[Matrix] = []
        self.A, self.b = compress(problem.A, problem.b)

    def stacked(self, x: Vector) -> Vector:
        """Return A f(x) - b followed by p(x): the terms of the sum of squares."""
        f, _, p = self._parts(self._value(x)[:, 0])
        return np.concatenate([self.A @ f - self.b, p])

    def cost(self, x: Vector) -> float:
        """Return half the sum of squares, prior included."""
        r = self.stacked(x)
        return 0.5 * float(r @ r)

    def slopes(self, x: Vector) -> tuple[Matrix, Matrix]:
        """Return the derivatives of A f(x) and of p(x)."""
        by_q, by_t = self._slopes_by_q(x), self._slopes_by_t(x)
        dr, dp = np.empty((self.b.size, x.size)), np.empty((by_q[2].shape[0], x.size))
        for columns, slopes in ((self.linear, by_q), (self.others, by_t)):
            dr[:, columns], dp[:, columns] = slopes[0], slopes[2]
        return dr, dp

    def project(self, x: Vector) -> Vector:
        """Replace the linear parameters by the best ones for the others."""
        return self._step(x, self.linear, self._slopes_by_q(x), 0.0)

    def minimize(
        self, x: Vector, *, most: int = 60, tolerance: float = 1e-5, watch: Callable[[int, float], None] | None = None
    ) -> Solution:
        """Iterate from a start.

        Parameters
        ----------
        x : ndarray, shape (n,)
            Start within the bounds; its linear parameters do not matter.
        most : int
            Most iterations.
        tolerance : float
            Relative decrease of the cost at which to stop.
        watch : callable, optional
            Called with the number of every iteration and the cost reached.

        Returns
        -------
        Solution
            The best point.
        """
        x = self.project(x)
        cost, damping, small = self.cost(x), 1e-3, 0
        everything = np.concatenate([self.linear, self.others])
        for iteration in range(most):
            slopes = [np.hstack(pair) for pair in zip(self._slopes_by_q(x), self._slopes_by_t(x), strict=True)]
            while True:
                trial = self._step(x, everything, slopes, damping)
                trial = self.project(np.where(self.problem.linear, x, trial))
                found = self.cost(trial)
                if found <= cost and (self._parts(self._value(trial)[:, 0])[1] > -1e-7).all():  # but for rounding
                    break
                damping *= 6.0
                if damping > 1e8:
                    return Solution(x=x, cost=cost, iterations=iteration, converged=True)
            small = small + 1 if cost - found < tolerance * cost else 0
            x, cost, damping = trial, found, max(damping / 5.0, 1e-9)
            if watch is not None:
                watch(iteration + 1, cost)
            if small >= 2:
                return Solution(x=x, cost=cost, iterations=iteration + 1, converged=True)
        return Solution(x=x, cost=cost, iterations=most, converged=False)

    def _slopes_by_q(self, x: Vector) -> list[Matrix]:
        """Return the derivatives of A f, g, p by q: they do not depend on q, so a step uses those of the projection."""
        at = x[self.others].tobytes()
        if at != self._projected_at:
            df, dg, dp = self._parts(self._by_q(x).copy())
            self._projected_at, self._projected = at, [self.A @ df, dg, dp]
        return self._projected

    def _slopes_by_t(self, x: Vector) -> list[Matrix]:
        df, dg, dp = self._parts(self._by_t(x))
        return [self.A @ df, dg, dp]

    def _parts(self, stacked: Matrix) -> list[Matrix]:
        return np.split(stacked, self._rows)

    def _step(self, x: Vector, moving: NDArray[np.int_], slopes: list[Matrix], damping: float) -> Vector:
        """Solve the linearised problem for some of the parameters; slopes are the derivatives of A f, g, p by them."""
        lower, upper = self.problem.lower[moving] - x[moving], self.problem.upper[moving] - x[moving]
        f, g, p = self._parts(self._value(x)[:, 0])
        J = np.vstack([slopes[0], slopes[2]])
        r = np.concatenate([self.A @ f - self.b, p])
        size = np.linalg.norm(J, axis=0)
        free = np.where(self.problem.linear[moving], 1e-9, np.sqrt(damping)) * np.maximum(size, 1e-6 * size.max())
        E = np.vstack([J, np.diag(free)])
        e = -np.concatenate([r, np.zeros(free.size)])
        identity = np.eye(free.size)
        below, above = np.isfinite(lower), np.isfinite(upper)
        G = np.vstack([slopes[1], identity[below], -identity[above]])
        h = np.concatenate([-g, lower[below], -upper[above]])
        touched = G.any(axis=1)
        step = solve_constrained(E, e, G[touched], h[touched])
        moved = x.copy()
        moved[moving] += np.clip(step, lower, upper)
        return moved


class _Fast:
    """Evaluate a CasADi function of two parts of a vector into an array made once: conversion costs more than evaluation."""

    def __init__(self, function: ca.Function, *parts: NDArray[np.int_]) -> None:
        self._parts = [(part, np.zeros(part.size)) for part in parts]
        self._result = np.zeros(function.size_out(0), order="F")
        self._run = bind(function, [values for _, values in self._parts], [self._result.reshape(-1, order="F")])

    def __call__(self, x: Vector) -> Matrix:
        """Return the result at x; the next call overwrites it."""
        for part, values in self._parts:
            values[:] = x[part]
        self._run()
        return self._result

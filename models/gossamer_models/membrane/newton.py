r"""Newton's method for a membrane at rest, outside of the model's functions: from a known equilibrium, or from none.

Symbols: ``q`` displacements of the moving nodes [m], M of them; ``f`` forces [N]; ``K`` = -df/dq tangent [N/m]; ``M``
stiffnesses of the nodes [N/m]; ``mu`` shift [1]; ``u`` inputs and ``p`` parameters in the model's order.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse
from scipy.sparse.linalg import SuperLU, splu

from ..arrays import Vector
from ..stepper import Evaluator
from ..variables import Variable, by_name
from .assembly import MembraneEquations
from .equilibrium import balance, tangent

SOFTEST = 1e-9  # added to the tangent, over the stiffness of a node: what a slack film lacks
SOFTEST_BEAM = 1e-13  # the same where there are beams, which bend as easily
MOST_STEPS = 60
CONTRACTION = 0.5  # of the forces in a step with kept factors; if they fall less, the tangent is factored anew
STALLED = 1e3  # over the forces that rounding leaves: accepted where they fall no further
FULL_STEPS, RELEASED, LEAST_SHARE = 20, 1e-6, 1e-3  # at a time; share of the forces that may be left; of them at once
_SHARES = (1.0, 0.5, 0.2, 0.05, 0.01)  # of a Newton step, until the forces fall
_LEAST_SHIFT, _FALL = 1e-9, 0.1  # of mu, and its factor after a step
_SHORTENED = 12  # times that a step is shortened, at most
_REFUSED = 15  # shifts at most: a film that is slack all over is left to relaxation


class Newton:
    """Forces and tangent of a membrane at rest, and Newton's method on them.

    Parameters
    ----------
    equations : MembraneEquations
        Those without loops.
    variables : tuple of Variable
        Table of the model.

    Attributes
    ----------
    balance : casadi.Function
        ``balance(u, p, q) -> (f, accepted)``: forces [N] at these displacements, zero where held, and the largest force over
        the stiffness of its node [m/s2] that rounding leaves.
    free : ndarray of int
        Places in q of the displacements that are not held.
    given : tuple of ndarray
        Start values of inputs and parameters, in the model's order.
    """

    def __init__(self, equations: MembraneEquations, variables: tuple[Variable, ...]) -> None:
        structure, n = equations.structure, equations.n_q
        inputs, parameters = ([v for v in variables if v.causality == kind] for kind in ("input", "parameter"))
        self.given = tuple(np.array([v.start or 0.0 for v in rows]) for rows in (inputs, parameters))
        self._stiffness = np.repeat(structure.stiffness[structure.moving], 3)
        self.free = np.flatnonzero(structure.free.reshape(-1, 3)[structure.moving].ravel())
        u, p, q = arguments = [ca.MX.sym(*of) for of in (("u", len(inputs)), ("p", len(parameters)), ("q", n))]
        by_name_u, by_name_p = by_name(inputs, u), by_name(parameters, p)
        f, _, accepted = balance(equations, q, by_name_u, by_name_p)
        self.balance = ca.Function("balance", arguments, [ca.densify(f), accepted])
        self._balance = Evaluator(self.balance)
        x = equations.positions(q, by_name_u, by_name_p)
        shared = equations.shared(by_name_u, by_name_p, ca.MX(0.0), equations.gas_of_start(by_name_u))
        K = tangent(equations, x, shared, by_name_u, by_name_p)[self.free.tolist(), self.free.tolist()]
        self._has_beams = bool(structure.setup.beams)
        self._tangent = Evaluator(ca.Function("tangent", arguments, [K.nz[:]]))  # in the order of scipy
        self._pattern = np.array(K.sparsity().row()), np.array(K.sparsity().colind())
        columns = np.repeat(np.arange(len(self.free)), np.diff(self._pattern[1]))
        self._diagonal = np.flatnonzero(self._pattern[0] == columns)

    def tangent(self, u: Vector, p: Vector, q: Vector) -> scipy.sparse.csc_matrix:
        """Return K [N/m] for the free displacements."""
        shape = (len(self.free), len(self.free))
        return scipy.sparse.csc_matrix((*self._tangent(u, p, q), *self._pattern), shape=shape)

    def stiffened(self, u: Vector, p: Vector, q: Vector) -> scipy.sparse.csc_matrix:
        """Return the tangent that can be factored where the film is slack."""
        return self._shifted(self.tangent(u, p, q), SOFTEST_BEAM if self._has_beams else SOFTEST)

    def _shifted(self, K: scipy.sparse.csc_matrix, mu: float) -> scipy.sparse.csc_matrix:
        found = K.copy()
        found.data[self._diagonal] += mu * self._stiffness[self.free]
        return found

    def left(self, u: Vector, p: Vector, q: Vector) -> tuple[Vector, float]:
        """Return the forces on free displacements [N], and the largest over what is accepted."""
        f, (accepted,) = self._balance(u, p, q)
        left = float(np.max(np.abs(f / self._stiffness))) / float(accepted)
        return np.asarray(f[self.free]), left if np.isfinite(left) else np.inf

    def _released(self, u: Vector, p: Vector, q: Vector) -> Vector | None:
        r"""Return the equilibrium that full steps reach as the forces that are left at ``q`` are released bit by bit.

        Notes
        -----
        Solves :math:`f(q_t) = (1 - t)\,f(q)` for rising t. On the way a beam, which bends far more easily than it stretches,
        is stretched by each step and relieved by the next, so that forces do not fall in every step.
        """
        first, _ = self.left(u, p, q)
        done, share = 0.0, 1.0
        while done < 1.0 and share > LEAST_SHARE:
            goal, to, last = min(1.0, done + share), q.copy(), np.inf
            for _ in range(FULL_STEPS):
                f, left = self.left(u, p, to)
                rest = f - (1.0 - goal) * first
                if left == np.inf or np.linalg.norm(rest) <= (RELEASED * np.linalg.norm(first) if goal < 1.0 else 0.0):
                    break
                if goal == 1.0 and (left <= 1.0 or last <= left <= STALLED):
                    return to
                last = left
                to[self.free] += factored(self.stiffened(u, p, to)).solve(rest)
            else:
                left = np.inf
            if left < np.inf:
                q, done, share = to, goal, 2.0 * share
            else:
                share /= 4.0
        return None

    def start(self, begin: Vector | None = None) -> Vector | None:
        """Return the equilibrium of the start values, None if none is reached.

        Parameters
        ----------
        begin : ndarray, shape (3 M,), optional
            Displacements to begin with [m]; None for the place of the mesh.
        """
        u, p = self.given
        q = np.zeros(len(self._stiffness)) if begin is None else begin
        return self._by_any_steps(u, p, q) if len(self.free) else None  # else all nodes are held

    def _by_any_steps(self, u: Vector, p: Vector, begin: Vector) -> Vector | None:
        """Return the equilibrium that the energy falls to, or that forces are released to where there are beams."""
        found = self._downhill(u, p, begin)
        return self._released(u, p, begin) if found is None and self._has_beams else found

    def _downhill(self, u: Vector, p: Vector, q: Vector) -> Vector | None:
        r"""Return the equilibrium that steps reach in each of which the energy falls.

        Notes
        -----
        Steps :math:`d = (K + \mu M)^{-1} f`, whose shift rises until the tangent is positive along d, and falls after each.
        A step is shortened until the energy falls in it by the trapezoidal rule, :math:`f' \cdot d > -f \cdot d/2` with
        the forces f' after it. It ends where the forces are accepted and fall no further, and gives up after some shifts.
        """
        mu, refused = 0.0, 0
        f, left = self.left(u, p, q)
        if left == np.inf:
            return None
        K = self.stiffened(u, p, q)
        for _ in range(MOST_STEPS):
            step = factored(self._shifted(K, mu)).solve(f)
            falls = f @ step
            if left <= 1.0 and falls == 0.0:  # forces that are nothing
                return q
            if not falls > 0.0:  # f.d = d.(K + mu M) d
                mu, refused = max(_LEAST_SHIFT, mu / _FALL), refused + 1
                if refused > _REFUSED:
                    break
                continue
            share = 1.0
            for _ in range(_SHORTENED):
                to = q.copy()
                to[self.free] += share * step
                f_to, left_to = self.left(u, p, to)
                ahead = f_to @ step if left_to < np.inf else -np.inf
                if ahead > -0.5 * falls:
                    break
                share *= min(max(falls / (falls - ahead), _FALL), 0.5)
            else:
                break
            if left <= 1.0 and left_to >= left:
                return q
            q, f, left, mu = to, f_to, left_to, _FALL * mu if mu > _LEAST_SHIFT else 0.0
            K = self.stiffened(u, p, q)
        return q if left <= 1.0 else None

    def reach(self, u: Vector, p: Vector, known: Known) -> Vector | None:
        """Return the equilibrium that is reached from one that is known, None if none is."""
        found = self._fallen(u, p, known)
        return self._by_any_steps(u, p, known.q) if found is None else found

    def _fallen(self, u: Vector, p: Vector, known: Known) -> Vector | None:
        """Return the equilibrium that steps reach in each of which the forces fall."""
        q, solve, is_kept = known.q.copy(), known.factors(self.stiffened), True
        f, left = self.left(u, p, q)
        for _ in range(MOST_STEPS):
            if left <= 1.0:
                return q
            step = solve(f)
            fallen = None
            for share in _SHARES[: 1 if is_kept else None]:
                to = q.copy()
                to[self.free] += share * step
                f_to, left_to = self.left(u, p, to)
                if np.isfinite(left_to) and np.linalg.norm(f_to) < (CONTRACTION if is_kept else 1.0) * np.linalg.norm(f):
                    fallen = to, f_to, left_to
                    break
            if fallen is not None:
                q, f, left = fallen
                is_kept = True
                continue
            if not is_kept:
                return q if left <= STALLED else None
            solve, is_kept = factored(self.stiffened(u, p, q)).solve, False
        return None


class Known:
    """An equilibrium, with the factors of its tangent once they are needed."""

    def __init__(self, u: Vector, p: Vector, q: Vector) -> None:
        self.u, self.p, self.q = u, p, q
        self._solve: Callable[[Vector], Vector] | None = None

    def factors(self, tangent: Callable[..., scipy.sparse.csc_matrix]) -> Callable[[Vector], Vector]:
        """Return what solves with its tangent."""
        solve = self._solve or factored(tangent(self.u, self.p, self.q)).solve
        self._solve = solve
        return solve

    def __reduce__(self) -> tuple[type[Known], tuple[Vector, Vector, Vector]]:  # without the factors
        return Known, (self.u, self.p, self.q)


def factored(K: scipy.sparse.csc_matrix) -> SuperLU:
    """Return the factors of a tangent, whose pattern is symmetric: half of what an order for others would leave."""
    return splu(K, permc_spec="MMD_AT_PLUS_A")


def column(value: Any) -> Vector:  # noqa: ANN401
    """Return the numbers of a CasADi matrix column by column."""
    return np.asarray(value).ravel(order="F")

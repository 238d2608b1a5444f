r"""Contribution of one record to a fit: the terms of a fractional model as columns, and their derivatives.

Symbols: :math:`\theta` = (orders :math:`a_k`, rates :math:`p_l`, exponents :math:`q_l`); ``s`` strain over full
scale [1]; ``Phi`` columns of unit coefficient in the order strain, terms on the strain, terms on its quadrature (models with
phases), fading integrals (model-1), one (where the resistance at rest is fitted).
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from ..arrays import Matrix, Rows, Vector
from ..fitting.separable import Derivative
from ..modes import PowerLawKernels, phi_1, phi_2
from .artifact import ModelName
from .operators import covering, integral_modes, quadrature, slope_modes, started
from .settings import FractionalSettings


class RecordColumns:
    """Terms of one model on one record.

    Parameters
    ----------
    s : ndarray, shape (m,)
        Strain over full scale [1].
    h : float
        Sampling step [s].
    rows : ndarray of bool, shape (m,)
        Samples to return.
    settings : FractionalSettings
        Model, numbers of terms and times of the memory.
    rest : bool
        Whether a constant is among the columns.
    """

    def __init__(self, s: Vector, h: float, rows: Rows, settings: FractionalSettings, *, rest: bool) -> None:
        model, kernels = settings.model, PowerLawKernels(settings.shortest, settings.longest)
        covering(s, h, kernels)
        self._s, self._rows, self._rest = s[rows], rows, rest
        self._n_terms, self._n_fading, self._first_fading = settings.terms, settings.n_fading, settings.first_fading
        parts = (s,) if model == "sub-model-1" else (s, quadrature(s))
        self._memories = [_memory(part, h, model, kernels.rates)[rows] for part in parts]
        a = ca.SX.sym("a")
        g = kernels.weights(1.0 - a if model == "model-1" else a)
        self._weights = ca.Function("weights", [a], [g, ca.jacobian(g, a)])
        self._fading = _fading(s, h)

    @property
    def count(self) -> int:
        """Number of columns."""
        return self._first_fading + self._n_fading + self._rest

    def evaluate(self, theta: Vector) -> tuple[Matrix, list[Derivative]]:
        r"""Return the columns, shape (m, n), and their derivatives by each element of :math:`\theta`, shape (N + 2 L,)."""
        N, L = self._n_terms, self._n_fading
        Phi = np.zeros((self._s.size, self.count))
        Phi[:, 0] = self._s
        by_order: list[Derivative] = []
        by_rate: list[Derivative] = []
        by_exponent: list[Derivative] = []
        for k, a in enumerate(theta[:N]):
            g, dg = (np.array(each).ravel() for each in self._weights(a))
            columns = np.arange(1 + k, self._first_fading, N)
            Phi[:, columns] = np.column_stack([memory @ g for memory in self._memories])
            by_order.append((columns, np.column_stack([memory @ dg for memory in self._memories])))
        for k, (p, q) in enumerate(zip(theta[N : N + L], theta[N + L :], strict=True)):
            column = np.array([self._first_fading + k])
            value, dp, dq = (np.array(each).reshape(-1, 1)[self._rows] for each in self._fading(p, q))
            Phi[:, column] = value
            by_rate.append((column, dp))
            by_exponent.append((column, dq))
        if self._rest:
            Phi[:, -1] = 1.0
        return Phi, [*by_order, *by_rate, *by_exponent]


def _memory(v: Vector, h: float, model: ModelName, rates: Vector) -> Matrix:
    """Return the modes of a record and, last, the column that the mass of the kernel multiplies, shape (m, n + 1)."""
    if model != "model-1":
        return np.column_stack([integral_modes(v, h, rates), started(v)])
    memory = np.column_stack([slope_modes(v, h, rates), np.diff(v, prepend=v[:1]) / h])
    memory[0] = 0.0  # as in ``model.predict``
    return memory


def _fading(s: Vector, h: float) -> ca.Function:
    r"""Return :math:`(p, q) \to \int_0^t e^{-p(t-\tau)} s^q\,d\tau` [s] at all samples, and its derivatives."""
    z, p, q, ends, stretched = (ca.SX.sym(name, n) for name, n in (("z", 1), ("p", 1), ("q", 1), ("e", 2), ("on", 2)))
    # s**q from the logarithms of s at both ends of a sample; zero where s is not positive
    power = stretched * ca.exp(q * ends)
    late = phi_2(p * h)
    sample = ca.exp(-p * h) * z + h * ((phi_1(p * h) - late) * power[0] + late * power[1])
    state = ca.SX.sym("state", 3)  # z and its derivatives by p and q
    chain = ca.jacobian(sample, z)
    following = ca.vertcat(sample, chain * state[1] + ca.jacobian(sample, p), chain * state[2] + ca.jacobian(sample, q))
    following = ca.substitute(following, z, state[0])
    step = ca.Function("sample", [state, ends, stretched, p, q], [following])
    logs = np.log(np.maximum(s, 1e-300))
    on = (s > 0.0).astype(float)
    n = s.size - 1
    P, Q = ca.MX.sym("p"), ca.MX.sym("q")
    run = step.mapaccum("record", n)
    found = run(
        ca.DM.zeros(3),
        ca.DM(np.vstack([logs[:-1], logs[1:]])),
        ca.DM(np.vstack([on[:-1], on[1:]])),
        ca.repmat(P, 1, n),
        ca.repmat(Q, 1, n),
    )
    whole = ca.horzcat(ca.DM.zeros(3), found)
    return ca.Function("fading", [P, Q], [whole[0, :], whole[1, :], whole[2, :]])

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
from ..modes import PowerLawKernels
from .artifact import ModelName
from .operators import covering, fading_integral, integral_modes, quadrature, slope_modes, started
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
    rest_fitted : bool
        Whether a constant is among the columns.
    """

    def __init__(self, s: Vector, h: float, rows: Rows, settings: FractionalSettings, *, rest_fitted: bool) -> None:
        model, kernels = settings.model, PowerLawKernels(settings.shortest, settings.longest)
        covering(s, h, kernels)
        self._strain, self._step, self._rows, self._rest_fitted = s, h, rows, rest_fitted
        self._n_terms, self._n_fading, self._first_fading = settings.terms, settings.n_fading, settings.first_fading
        parts = (s,) if model == "sub-model-1" else (s, quadrature(s))
        self._memories = [_memory(part, h, model, kernels.rates)[rows] for part in parts]
        a = ca.SX.sym("a")
        g = kernels.weights(1.0 - a if model == "model-1" else a)
        self._weights = ca.Function("weights", [a], [g, ca.jacobian(g, a)])

    @property
    def count(self) -> int:
        """Number of columns."""
        return self._first_fading + self._n_fading + self._rest_fitted

    def evaluate(self, theta: Vector) -> tuple[Matrix, list[Derivative]]:
        r"""Return the columns, shape (m, n), and their derivatives by each element of :math:`\theta`, shape (N + 2 L,)."""
        N, L = self._n_terms, self._n_fading
        Phi = np.zeros((int(self._rows.sum()), self.count))
        Phi[:, 0] = self._strain[self._rows]
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
            value, dp, dq = (part[self._rows, None] for part in fading_integral(self._strain, self._step, p, q))
            Phi[:, column] = value
            by_rate.append((column, dp))
            by_exponent.append((column, dq))
        if self._rest_fitted:
            Phi[:, -1] = 1.0
        return Phi, [*by_order, *by_rate, *by_exponent]


def _memory(v: Vector, h: float, model: ModelName, rates: Vector) -> Matrix:
    """Return the modes of a record and, last, the column that the mass of the kernel multiplies, shape (m, n + 1)."""
    if model != "model-1":
        return np.column_stack([integral_modes(v, h, rates), started(v)])
    memory = np.column_stack([slope_modes(v, h, rates), np.diff(v, prepend=v[:1]) / h])
    memory[0] = 0.0  # as in ``model.predict``
    return memory

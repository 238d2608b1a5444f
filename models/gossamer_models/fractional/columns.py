r"""What one record contributes to a fit: the terms of a fractional model as columns, and their derivatives.

Symbols: :math:`\theta` = (orders :math:`a_k`, rates :math:`p_l`, exponents :math:`q_l`); ``Phi`` columns of unit
coefficient in the order strain, terms on the strain, terms on its quadrature (models with phases), fading integrals
(model-1), one (where the resistance at rest is fitted).
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ..sensor.relaxation import phi_1, phi_2
from .artifact import ModelName
from .kernels import ModeGrid
from .operators import grid_of, modes, quadrature, rise_modes, started

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Columns:
    """Terms of one model on one record.

    Parameters
    ----------
    s : ndarray, shape (m,)
        Strain over full scale [1].
    h : float
        Sampling step [s].
    kept : slice
        Samples to return.
    model : {"model-1", "sub-model-1", "sub-model-2"}
        What the terms are.
    n_terms, n_fading : int
        Number of fractional and of fading terms.
    grid : ModeGrid
        Rates of the memory.
    offset : bool
        Whether a constant is among the terms.
    """

    def __init__(
        self,
        s: Vector,
        h: float,
        kept: slice,
        model: ModelName,
        n_terms: int,
        n_fading: int,
        grid: ModeGrid,
        *,
        offset: bool = False,
    ) -> None:
        grid_of(s, h, grid)
        self._offset = offset
        self.n_terms = n_terms
        self.n_fading = n_fading if model == "model-1" else 0
        self._s, self._kept, self._model = s[kept], kept, model
        parts = (s,) if model == "sub-model-1" else (s, quadrature(s))
        self._memories = [_memory(part, h, model, grid.rates)[kept] for part in parts]
        a = ca.SX.sym("a")
        g = grid.weights(1.0 - a if model == "model-1" else a)
        self._weights = ca.Function("weights", [a], [g, ca.jacobian(g, a)])
        self._fading = _fading(s, h)

    @property
    def n_columns(self) -> int:
        """Number of coefficients."""
        return self.first_fading + self.n_fading + self._offset

    @property
    def first_fading(self) -> int:
        """Place of the first fading integral."""
        return 1 + len(self._memories) * self.n_terms

    def evaluate(self, theta: Vector) -> tuple[Matrix, list[Matrix]]:
        r"""Return the columns and their derivatives.

        Parameters
        ----------
        theta : ndarray, shape (N + 2 L,)
            Orders [1], rates [1/s] and exponents [1].

        Returns
        -------
        Phi : ndarray, shape (m, n_columns)
            Columns.
        slopes : list of ndarray, shape (m, n_columns)
            Derivative by each element of ``theta``.
        """
        N, L = self.n_terms, self.n_fading
        Phi = np.zeros((self._s.size, self.n_columns))
        Phi[:, 0] = self._s
        slopes = [np.zeros_like(Phi) for _ in theta]
        for k, a in enumerate(theta[:N]):
            g, dg = (np.array(each).ravel() for each in self._weights(a))
            for i, memory in enumerate(self._memories):
                column = 1 + i * N + k
                Phi[:, column], slopes[k][:, column] = memory @ g, memory @ dg
        for k, (p, q) in enumerate(zip(theta[N : N + L], theta[N + L :], strict=True)):
            column = self.first_fading + k
            value, by_rate, by_exponent = (np.array(each).ravel()[self._kept] for each in self._fading(p, q))
            Phi[:, column], slopes[N + k][:, column], slopes[N + L + k][:, column] = value, by_rate, by_exponent
        if self._offset:
            Phi[:, -1] = 1.0
        return Phi, slopes


def _memory(v: Vector, h: float, model: ModelName, rates: Vector) -> Matrix:
    """Return the modes of a record and, last, what the mass of the kernel weighs, shape (m, n + 1)."""
    if model != "model-1":
        return np.column_stack([modes(v, h, rates), started(v)])
    memory = np.column_stack([rise_modes(v, h, rates), np.diff(v, prepend=v[:1]) / h])
    memory[0] = 0.0  # as in ``model.predict``
    return memory


def _fading(s: Vector, h: float) -> ca.Function:
    r"""Return :math:`(p, q) \to \int_0^t e^{-p(t-\tau)} s^q\,d\tau` [s] at all samples, and its derivatives."""
    z, p, q, ends, stretched = (ca.SX.sym(name, n) for name, n in (("z", 1), ("p", 1), ("q", 1), ("e", 2), ("on", 2)))
    v = stretched * ca.exp(
        q * ends
    )  # s**q from the logarithms of s at both ends of a sample; zero where s is not positive
    late = phi_2(p * h)
    sample = ca.exp(-p * h) * z + h * ((phi_1(p * h) - late) * v[0] + late * v[1])
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

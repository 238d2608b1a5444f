r"""Densities over the Preisach plane as functions of few parameters.

Symbols: bins (i, j), ``i`` counting :math:`\alpha` and ``j <= i`` counting :math:`\beta`, numbers 1 to N; ``mu(i, j)``,
``eta(i, j)`` [1]; ``line`` = i - j and ``k`` = i - 1 of the same cell in the tables; :math:`b_l` amplitudes and
:math:`m_l, n_l` wave numbers of modal functions [1]. All densities are linear in part of their parameters; they are CasADi
expressions or constant matrices.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy import sparse

from ...arrays import Matrix, Vector


def modal_field(amplitudes: ca.MX, m: ca.MX, n: ca.MX, places: Vector) -> ca.MX:
    r"""Return a sum of modal functions on all cells, Eqs. (4.14) to (4.17) of the thesis.

    Parameters
    ----------
    amplitudes, m, n : casadi.MX, shape (M,)
        :math:`b_l` and the wave numbers :math:`m_l, n_l` [1].
    places : ndarray, shape (N,)
        Middles of the bins over the range of the modes [1], see ``bin_places``.

    Returns
    -------
    casadi.MX, shape (N (N + 1) / 2,)
        :math:`\sum_l b_l [\cos(\pi m_l i/N)\cos(\pi n_l j/N) + \cos(\pi n_l i/N)\cos(\pi m_l j/N)]` in the order of
        ``numpy.triu_indices``.

    Notes
    -----
    The diagonal of bin (i, j) is the cell of line i - j at :math:`\alpha` bin i, so bins and cells correspond one to one.
    Places i/N are taken at the middle of the bins. With the cosines as matrices :math:`C_m, C_n` of shape (N, M) the whole
    plane is :math:`S + S^T`, :math:`S = C_m\,\mathrm{diag}(b)\,C_n^T`: few operations, hence quickly differentiated ones.
    """
    line, k = np.triu_indices(places.size)
    axis = ca.DM(np.pi * places)
    cos_m, cos_n = ca.cos(ca.mtimes(axis, m.T)), ca.cos(ca.mtimes(axis, n.T))
    S = ca.mtimes(ca.mtimes(cos_m, ca.diag(amplitudes)), cos_n.T)
    return ca.vec(S + S.T)[(k + places.size * (k - line)).tolist()]


def bin_places(n_lines: int, seen: float) -> Vector:
    """Return the middles of the bins over the fitted range of strain [1], shape (N,).

    Beyond that range the result is 1, so densities keep their value at its end: the data determine nothing there.
    """
    return np.minimum((np.arange(n_lines) + 0.5) / n_lines / seen, 1.0)


def reversible_beyond(n_lines: int, seen: float) -> sparse.csr_array:
    """Return a matrix that moves the weight of lines wider than the fitted range of strain to the elastic line.

    No record within that range switches such operators down, so their hysteresis is unknown. The first loading follows
    the density, and hysteresis appears only if the data require it.

    Parameters
    ----------
    n_lines : int
        Lines of the tables.
    seen : float
        Largest strain that is fitted, over full scale [1].

    Returns
    -------
    scipy.sparse.csr_array, shape (N (N + 1) / 2, N (N + 1) / 2)
        The identity on narrower lines; wider ones are added to the cell of line 0 at the same alpha.
    """
    line, k = np.triu_indices(n_lines)
    target = np.where(line / n_lines < seen, np.arange(line.size), k)
    return sparse.csr_array((np.ones(line.size), (target, np.arange(line.size))), shape=(line.size, line.size))


def elastic_field(amplitudes: ca.MX, places: Vector) -> ca.MX:
    r"""Return :math:`\sum_l b_l \cos(\pi l \alpha)`, l = 0, 1, ..., on the bins of the elastic line, shape (N,)."""
    return ca.mtimes(ca.DM(np.cos(np.pi * np.outer(places, np.arange(amplitudes.numel())))), amplitudes)


def wave_numbers(count: int) -> tuple[Vector, Vector]:
    """Return the lowest pairs m >= n of wave numbers to start from, each of shape (count,)."""
    pairs = sorted(((m, n) for m in range(count) for n in range(m + 1)), key=lambda pair: (sum(pair), pair[0]))
    chosen = np.array(pairs[:count], dtype=float)
    return chosen[:, 0], chosen[:, 1]


def hat_functions(n_lines: int, n_knots: int) -> tuple[Matrix, Matrix]:
    """Return hat functions on all cells of the triangle.

    Parameters
    ----------
    n_lines, n_knots : int
        Lines of the tables, and knots of the hats along either axis.

    Returns
    -------
    hats : ndarray, shape (N (N + 1) / 2, n_knots (n_knots + 1) / 2)
        Values [1] at the cells' middles, zero on the elastic line 0.
    spring : ndarray, shape (N (N + 1) / 2, n_knots)
        The same along the elastic line, zero elsewhere.
    """
    line, k = np.triu_indices(n_lines)

    def along(x: Vector) -> Matrix:
        return np.maximum(0.0, 1.0 - np.abs(x[:, None] * (n_knots - 1) - np.arange(n_knots)))

    alpha, beta = along((k + 0.5) / n_lines), along((k - line + 0.5) / n_lines)
    columns = []
    for a in range(n_knots):
        for b in range(a + 1):
            column = alpha[:, a] * beta[:, b]
            if b == a and a + 1 < n_knots:  # the half hat above the diagonal belongs to its foot
                column = column + alpha[:, a] * beta[:, a + 1]
            columns.append(column)
    hysteretic = (line > 0)[:, None]
    return np.array(columns).T * hysteretic, alpha * ~hysteretic

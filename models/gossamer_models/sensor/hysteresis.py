r"""Modified Preisach plane of Eq. (4.7) of the thesis as a bank of lines.

Symbols: ``s`` normalised strain [1] in 0..1; ``N`` lines :math:`\alpha - \beta = 2 r_i = i/N`, line 0 an anhysteretic
spring; ``front[i]`` = :math:`\alpha_i = w_i + r_i` [1]: below it, the operators of line i are switched up (:math:`w_i` is
the play operator of half-width :math:`r_i`; on the other axis the same operators end at :math:`\beta_i = \alpha_i - i/N`);
``k`` bin of width 1/N along :math:`\alpha`; ``up[i]``, ``down[i]`` cumulative weights [1] of ``mu`` and ``nu = eta*mu``
below the front.

Every corner of the tables lies at a multiple of 1/N in both :math:`\alpha` and :math:`\beta`; the inverse relies on it.
"""

import casadi as ca
import numpy as np

from ..arrays import Vector

Table = Vector


def move_fronts(front: ca.MX, strain: ca.MX) -> ca.MX:
    r"""Advance the switching fronts by one monotone change of strain.

    Parameters
    ----------
    front : casadi.MX, shape (N,) or (N, P)
        Fronts :math:`\alpha_i` [1] before the change, not decreasing in i; of P sensors side by side.
    strain : casadi.MX, scalar or shape (1, P)
        Normalised strain [1] after it.

    Returns
    -------
    casadi.MX, shape (N,) or (N, P)
        Fronts after it.

    Notes
    -----
    The play operator :math:`w_i = \max(s - r_i, \min(s + r_i, w_i))` of [1]_ written for :math:`\alpha_i = w_i + r_i`:
    rising strain sets the fronts that it passes to exactly ``s``, so equal histories give equal bits.
    Rate independent: no step size appears, and none may be added here.

    References
    ----------
    .. [1] K. Kuhnen, European Journal of Control 9(4), 407-418, 2003, doi:10.3166/ejc.9.407-418.
    """
    strain, width = down(strain, front), across(widths(front.shape[0]), front)
    return ca.fmax(strain, ca.fmin(strain + width, front))


def resting_fronts(n_lines: int, strain: ca.MX) -> ca.MX:
    """Return the fronts [1], shape (n_lines,), after the first monotone loading from zero to ``strain`` [1]."""
    return ca.fmax(strain, widths(n_lines))


def widths(n_lines: int) -> ca.DM:
    """Return the widths [1], shape (n_lines,), of the operators of every line."""
    return ca.DM(np.arange(n_lines) / n_lines)


def across(column: ca.MX | ca.DM, like: ca.MX) -> ca.MX | ca.DM:
    """Repeat a column, shape (n,), for every sensor of ``like``, shape (n, P); what has their shape stays as it is."""
    return column if like.shape[1] == column.shape[1] else ca.repmat(column, 1, like.shape[1])


def down(row: ca.MX, like: ca.MX) -> ca.MX:
    """Repeat a row, shape (1, P), for every line of ``like``, shape (n, P); of one sensor it stays the scalar it is."""
    return row if like.shape[1] == 1 else ca.repmat(row, like.shape[0], 1)


def cumulate(front: ca.MX, mu: Table, nu: Table) -> tuple[ca.MX, ca.MX]:
    r"""Add up the weights of all operators below the fronts, line by line.

    Parameters
    ----------
    front : casadi.MX, shape (N,) or (N, P)
        Fronts :math:`\alpha_i` [1].
    mu, nu : ndarray, shape (N, N)
        Weights [1] of up- and down-switching, zero for k < i.

    Returns
    -------
    up, down : casadi.MX, of the shape of ``front``
        :math:`M_i = \sum_k \mu_{ik} \min(\max(\alpha_i - k/N, 0), 1/N)` and the same sum with :math:`\nu` [1].
    """
    N = mu.shape[0]
    k = ca.fmin(ca.floor(N * front), N - 1.0)  # the bin of each front
    up = _weight_below(front, k, mu)
    return up, up if np.array_equal(mu, nu) else _weight_below(front, k, nu)


def _weight_below(front: ca.MX, k: ca.MX, table: Table) -> ca.MX:
    """Look up the weight [1] below the bins ``k`` and add the part of each that lies below its front."""
    N = table.shape[0]
    below = np.zeros_like(table)
    below[:, 1:] = np.cumsum(table, axis=1)[:, :-1] / N
    place = across(ca.DM(N * np.arange(N)), k) + k
    full, density = (ca.MX(ca.DM(values.reshape(-1)))[place] for values in (below, table))
    return full + density * (front - k / N)

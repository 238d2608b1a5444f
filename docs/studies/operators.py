r"""Fractional integral and derivative of a sampled record, by the modes that the fractional models run.

Symbols: ``u`` record in steps of ``h`` [s]; :math:`a` order [1]. A time that is linear in its length is what they cost. They
are those of Riemann and Liouville, Eqs. (3.1) and (3.2) of [1]_, and differ from Caputo's in one term: the derivative of a
record that does not start at zero begins with :math:`u_0 t^{-a}/\Gamma(1-a)`, which is infinite at t = 0.

References
----------
.. [1] M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite
   Sensors, dissertation, Virginia Tech, 2010, Chapter 3.
"""

from __future__ import annotations

import numpy as np
from gossamer_models.fractional.model import check_covered, memory
from gossamer_models.modes import PowerLawKernels, check_order
from scipy.special import gamma

from .style import Vector


def integral(u: Vector, h: float, order: float, kernels: PowerLawKernels | None = None) -> Vector:
    r"""Return :math:`J^a u` [unit of u times s**order], Eq. (3.2) of [1]_, shape (m,).

    Parameters
    ----------
    u : ndarray, shape (m,)
        Samples; for a record linear in between, the result is exact up to the relative error of the kernel, 1e-6.
    h : float
        Sampling step [s].
    order : float
        :math:`a` [1], 0 < a < 1.
    kernels : PowerLawKernels or None
        Kernels to use; None for those that the record needs.

    Raises
    ------
    ParameterError
        The order is outside 0..1.
    DataError
        The record is not one column of finite numbers, or ``kernels`` do not cover it.
    """
    kernels = _covering(u, h, kernels)
    return np.asarray(memory(u, h, kernels.rates, of_slope=False) @ kernels.at_order(order))


def derivative(u: Vector, h: float, order: float, kernels: PowerLawKernels | None = None) -> Vector:
    r"""Return :math:`D^a u` [unit of u times s**-order], Eq. (3.1) of [1]_, shape (m,); arguments as in ``integral``.

    Notes
    -----
    :math:`D^a u = J^{1-a} \dot u + u_0 t^{-a}/\Gamma(1-a)`, with :math:`\dot u` constant over a sample. The value at
    t = 0 is zero if the record starts at zero, else infinite.
    """
    kernels = _covering(u, h, kernels)
    check_order(order)
    found = memory(u - u[0], h, kernels.rates, of_slope=True) @ kernels.at_order(1.0 - order)
    return np.asarray(found + initial_term(u, h, order))


def _covering(u: Vector, h: float, kernels: PowerLawKernels | None) -> PowerLawKernels:
    """Return the kernels to use, which cover the record."""
    if kernels is None and u.size > 1 and 0.0 < h < np.inf:
        kernels = PowerLawKernels(h, h * max(u.size - 1, 2))
    check_covered(u, h, kernels or PowerLawKernels(1e-4, 1e5))
    return kernels or PowerLawKernels(1e-4, 1e5)


def initial_term(u: Vector, h: float, order: float) -> Vector:
    r"""Return :math:`u_0 t^{-a}/\Gamma(1-a)`, shape (m,), Eq. (3.11): the term of the derivative from the first sample."""
    if u[0] == 0.0:
        return np.zeros(u.size)
    t = h * np.arange(1, u.size)
    return np.asarray(u[0] * np.concatenate([[np.inf], t**-order / gamma(1.0 - order)]))

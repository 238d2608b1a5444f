r"""Laws of the membrane's material: stress from strain, in plane stress.

Symbols: ``e`` twice the Green-Lagrange strain, a symmetric 2 x 2 matrix, ``E1 >= E2`` its principal values over two [1],
``n1``, ``n2`` their directions, ``D`` = E/(1 - nu^2) [Pa], ``nu`` Poisson's ratio [1], ``S`` second Piola-Kirchhoff stress
[Pa]. At small strain all laws are Hooke's.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Entry: TypeAlias = ca.MX  # or ca.SX
Matrix: TypeAlias = NDArray[np.object_]  # of entries
Stress: TypeAlias = Callable[[Matrix, Entry, Entry], Matrix]

# keeps the direction of the larger principal strain finite where both are equal; 1e-12 relative to a stretch
_TINY = 1e-24


def principal(e: Matrix) -> tuple[Entry, Entry]:
    """Return trace and spread of e: half of trace plus and minus spread are its principal values."""
    spread = ca.sqrt((e[0, 0] - e[1, 1]) ** 2 + 4.0 * e[0, 1] ** 2 + _TINY)
    return e[0, 0] + e[1, 1], spread


def st_venant_kirchhoff(e: Matrix, D: Entry, nu: Entry) -> Matrix:
    r"""Return :math:`S = \tfrac12 D\,[(1-\nu)\,e + \nu\,\mathrm{tr}(e)\,1]`; compression is carried."""
    shear = D / 2.0 * (1.0 - nu) * e[0, 1]
    return matrix([[D / 2.0 * (e[0, 0] + nu * e[1, 1]), shear], [shear, D / 2.0 * (e[1, 1] + nu * e[0, 0])]])


def hencky(e: Matrix, D: Entry, nu: Entry) -> Matrix:
    r"""Return the stress of Hencky's law [1]_, linear in the logarithmic strains :math:`h_i = \ln\lambda_i`.

    Notes
    -----
    The energy per reference volume is :math:`\tfrac12 D\,(h_1^2 + 2\nu h_1 h_2 + h_2^2)`, so that the principal stresses are
    :math:`S_i = D\,(h_i + \nu h_j)/\lambda_i^2`. In tension it is softer than St Venant-Kirchhoff's law.

    References
    ----------
    .. [1] L. Anand, Journal of Applied Mechanics 46(1), 78-82, 1979, doi:10.1115/1.3424532.
    """
    trace, spread = principal(e)
    c1, c2 = 1.0 + (trace + spread) / 2.0, 1.0 + (trace - spread) / 2.0  # squares of the stretches
    difference = ca.log1p(spread / c2) / 2.0  # of the logarithmic strains, accurate where both are nearly equal
    h2 = ca.log(c2) / 2.0
    h1 = h2 + difference
    mean = D / 2.0 * ((h1 + nu * h2) / c1 + (h2 + nu * h1) / c2)
    slope = D / (c1 * c2) * (c1 * (1.0 - nu) * difference / spread - (h1 + nu * h2))
    return _coaxial(e, trace, mean, slope)


def relaxed(e: Matrix, D: Entry, nu: Entry) -> Matrix:
    r"""Return the stress of tension-field theory [1]_: wrinkles form where the membrane would be compressed.

    Notes
    -----
    St Venant-Kirchhoff's stress and a correction that is exactly zero where the membrane is taut:

    .. math:: S = S_{svk} + D m\,(n_2 n_2 + \nu\,n_1 n_1) + E k\,n_1 n_1, \qquad
        m = \max(0, -(E_2 + \nu E_1)), \quad k = \max(0, -E_1).

    Wrinkled, it leaves the uniaxial tension :math:`S_1 = E E_1`; slack, nothing.

    References
    ----------
    .. [1] A. C. Pipkin, IMA Journal of Applied Mathematics 36(1), 85-99, 1986, doi:10.1093/imamat/36.1.85.
    """
    trace, spread = principal(e)
    E1, E2 = (trace + spread) / 4.0, (trace - spread) / 4.0
    m, k = ca.fmax(0.0, -(E2 + nu * E1)), ca.fmax(0.0, -E1)
    taut = st_venant_kirchhoff(e, D, nu)
    S1, S2 = D * (nu * m + (1.0 - nu**2) * k), D * m
    found: Matrix = taut + _coaxial(e, trace, (S1 + S2) / 2.0, (S1 - S2) / spread)
    return found


def neo_hookean(e: Matrix, D: Entry, nu: Entry) -> Matrix:
    r"""Return the stress of a compressible neo-Hookean material, rubber at a Poisson's ratio near 1/2.

    Notes
    -----
    Of the energy :math:`\tfrac\mu2\,(\mathrm{tr}\,C_3 - 3 + (J^{-2\beta} - 1)/\beta)`, :math:`\beta = \nu/(1-2\nu)`,
    Eq. (67) of [1]_ with f = 1. Free of stress across, the thickness stretches by
    :math:`\lambda_3^2 = (\det C)^{-\nu/(1-\nu)}`, and with :math:`\mu = D\,(1-\nu)/2`

    .. math:: S = \mu\,(1 - \lambda_3^2\,C^{-1}), \qquad C = 1 + e.

    References
    ----------
    .. [1] P. J. Blatz, W. L. Ko, Transactions of the Society of Rheology 6(1), 223-251, 1962, doi:10.1122/1.548937.
    """
    determinant = e[0, 0] * e[1, 1] - e[0, 1] ** 2
    growth = e[0, 0] + e[1, 1] + determinant  # of the squared area, det C - 1
    thinning = ca.expm1(-nu / (1.0 - nu) * ca.log1p(growth))  # lambda_3^2 - 1
    mu = D * (1.0 - nu) / 2.0 / (1.0 + growth)
    along = [mu * (e[a, a] + determinant - thinning * (1.0 + e[1 - a, 1 - a])) for a in range(2)]
    across = mu * (1.0 + thinning) * e[0, 1]
    return matrix([[along[0], across], [across, along[1]]])


def torn(S: Matrix, along: Entry, across: Entry, nu: Entry) -> Matrix:
    r"""Return the stress of a membrane that keeps shares of its stiffness along its axes, from the stress S of a whole one.

    Notes
    -----
    In plane stress the shares :math:`l_1, l_2` divide what strain each stress alone causes along its own axis,
    :math:`e_1 = (S_1/l_1 - \nu S_2)/E`, as where yarns are cut in one direction; strain across and shear stay. With the
    strains :math:`e_1 = (S_1 - \nu S_2)/E` that S belongs to this is solved for the new stress.
    """
    first, second = S[0, 0] - nu * S[1, 1], S[1, 1] - nu * S[0, 0]
    scale = 1.0 / (1.0 / (along * across) - nu**2)
    one, two = scale * (first / across + nu * second), scale * (nu * first + second / along)
    return matrix([[one, S[0, 1]], [S[1, 0], two]])


@dataclass(frozen=True, slots=True)
class Law:
    """A law of the material.

    Attributes
    ----------
    stress : callable
        ``stress(e, D, nu) -> S``.
    text : str
        What it does, in the lists that ``make goldens`` writes into pages and help.
    linear : bool
        Whether stress is linear in the Green-Lagrange strain where the membrane is taut.
    wrinkles : bool
        Whether it carries no compression.
    """

    stress: Stress
    text: str
    linear: bool = False
    wrinkles: bool = False


LAWS = {
    "st_venant_kirchhoff": Law(st_venant_kirchhoff, "carries compression", linear=True),
    "hencky": Law(hencky, "linear in the logarithmic strain, for large strain"),
    "neo_hookean": Law(neo_hookean, "rubber, for large strain"),
    "relaxed": Law(relaxed, "wrinkles where the membrane would be compressed", linear=True, wrinkles=True),
}


def matrix(rows: list[list[Any]]) -> Matrix:
    """Make a matrix of numbers or CasADi matrices; NumPy by itself would look into those."""
    found = np.empty((len(rows), len(rows[0])), dtype=object)
    for place in np.ndindex(found.shape):
        found[place] = rows[place[0]][place[1]]
    return found


def _coaxial(e: Matrix, trace: Entry, mean: Entry, slope: Entry) -> Matrix:
    """Return the symmetric matrix with the directions of e, from mean and slope of its principal values over those of e."""
    along = [mean + slope * (e[a, a] - trace / 2.0) for a in range(2)]
    across = slope * e[0, 1]
    return matrix([[along[0], across], [across, along[1]]])

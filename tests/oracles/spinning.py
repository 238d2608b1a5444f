"""A thin disc that spins: its stress in closed form, and its vibrations across it, apart from all membrane code.

Symbols: ``a``, ``b`` outer and inner radius [m], ``nu`` Poisson's ratio, ``n`` nodal diameters, ``s`` nodal circles; stress
in units of density * (rate * a)^2, squared frequencies in units of the squared rate of spin.
"""

import numpy as np
import scipy.linalg
from numpy.polynomial import Legendre, Polynomial
from numpy.polynomial.legendre import leggauss

DEGREE, POINTS = 24, 400


def free_disc(n, s, nu):
    """Return the squared frequency of a whole disc, Lamb and Southwell, Proc. R. Soc. A 99, 272-280, 1921."""
    k = n + 2 * s
    return ((3.0 + nu) * k * (k + 2) - (1.0 + 3.0 * nu) * n**2) / 8.0


def stresses(r, hub, nu):
    """Return radial and hoop stress at r/a, of a disc that a rigid hub of radius hub = b/a holds and whose rim is free."""
    p, q = (3.0 + nu) / 8.0, (1.0 + 3.0 * nu) / 8.0
    # sigma_r = A + B/r^2 - p r^2, sigma_t = A - B/r^2 - q r^2; no stress at 1, sigma_t = nu sigma_r at the hub
    A, B = np.linalg.solve([[1.0, 1.0], [1.0 - nu, -(1.0 + nu) / hub**2]], [p, (q - nu * p) * hub**2])
    return A + B / r**2 - p * r**2, A - B / r**2 - q * r**2


def hubbed_disc(n, hub, nu, count):
    """Return the lowest squared frequencies with n nodal diameters, by Ritz' method."""
    x, weight = leggauss(POINTS)
    r, w = hub + (1.0 - hub) * (1.0 + x) / 2.0, (1.0 - hub) / 2.0 * weight
    radial, hoop = stresses(r, hub, nu)
    shapes = [(Polynomial([1.0, 1.0]) * Legendre.basis(k).convert(kind=Polynomial)) for k in range(DEGREE)]
    v = np.array([shape(x) for shape in shapes])
    slope = np.array([shape.deriv()(x) for shape in shapes]) * 2.0 / (1.0 - hub)
    K = slope @ np.diag(w * r * radial) @ slope.T + n**2 * v @ np.diag(w * hoop / r) @ v.T
    M = v @ np.diag(w * r) @ v.T
    return scipy.linalg.eigh(K, M, eigvals_only=True)[:count]

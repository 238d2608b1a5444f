r"""Fractional operators as the thesis prints them, sums over the whole record and turned phases; and small models.

Symbols: ``u`` samples, ``h`` sampling step [s], ``j`` number of a sample.
"""

from __future__ import annotations

import numpy as np
from gossamer_models.fitting import Record
from gossamer_models.fractional import FadingTerm, FractionalArtifact, FractionalTerm, predict
from gossamer_models.fractional.model import quadrature
from gossamer_models.modes import check_order
from numpy.typing import NDArray
from scipy.special import gamma
from studies.operators import initial_term

Vector = NDArray[np.float64]

H = 0.5
TIME = H * np.arange(401)
STRAIN = 0.075 * np.interp(TIME, [0.0, 50.0, 100.0, 150.0, 200.0], [0.0, 1.0, 0.0, 1.0, 0.0])
SCALES = {"full_scale_strain": 0.075, "resistance_change": 300.0, "rest_resistance": 1000.0}
INTEGRALS = FractionalArtifact(
    model="sub-model-1",
    direct=0.4,
    terms=(FractionalTerm(coefficient=0.12, order=0.3), FractionalTerm(coefficient=0.01, order=0.8)),
    **SCALES,
)
TURNED = FractionalArtifact(
    model="sub-model-2",
    direct=0.4,
    terms=(FractionalTerm(coefficient=0.12, order=0.3, phase=-0.4), FractionalTerm(coefficient=0.02, order=0.7, phase=0.2)),
    **SCALES,
)
DERIVATIVES = FractionalArtifact(
    model="model-1",
    direct=0.3,
    terms=(FractionalTerm(coefficient=0.5, order=0.4, phase=-0.7),),
    fading=(FadingTerm(coefficient=0.02, rate=0.05, exponent=1.4), FadingTerm(coefficient=0.5, rate=2.0, exponent=0.8)),
    **SCALES,
)
ALL = (INTEGRALS, TURNED, DERIVATIVES)


def integral_sum(u: Vector, h: float, order: float) -> Vector:
    """Return the fractional integral by the sum of Eq. (3.4); exact for linear samples, its cost grows as m**2."""
    check_order(order)
    j = np.arange(u.size, dtype=float)
    steps = (j + 1.0) ** (1.0 + order) - j ** (1.0 + order)
    history = np.convolve(steps, np.diff(u))[: u.size - 1]
    found = (1.0 + order) * j**order * u[0] + np.concatenate([[0.0], history])
    return np.asarray(h**order / gamma(2.0 + order) * found)


def derivative_sum(u: Vector, h: float, order: float) -> Vector:
    """Return the fractional derivative by the sum of Eq. (3.3); exact for linear samples, its cost grows as m**2."""
    check_order(order)
    j = np.arange(u.size, dtype=float)
    steps = (j + 1.0) ** (1.0 - order) - j ** (1.0 - order)
    history = h**-order / gamma(2.0 - order) * np.convolve(steps, np.diff(u))[: u.size - 1]
    return np.asarray(np.concatenate([[0.0], history]) + initial_term(u, h, order))


def turned(u: Vector, phase: float) -> Vector:
    r"""Return the record with each Fourier component turned by :math:`\pi b/2`, shape (m,).

    Parameters
    ----------
    u : ndarray, shape (m,)
        The whole record.
    phase : float
        :math:`b` [1].

    Notes
    -----
    Eq. (3.17) of the thesis with sine and cosine exchanged: what is printed turns by a quarter more than Eq. (3.18)
    says. :math:`\cos(\omega t + \varphi) = \cos\varphi \cos\omega t - \sin\varphi \sin\omega t` for every component,
    so the record and its ``quadrature`` span all phases. The mean is the cosine of frequency zero.
    """
    return np.asarray(np.cos(0.5 * np.pi * phase) * u - np.sin(0.5 * np.pi * phase) * quadrature(u))


def record(artifact, noise=0.0, seed=0, **changes):
    resistance = predict(artifact, STRAIN, H) + noise * np.random.default_rng(seed).standard_normal(STRAIN.size)
    values = {"time": TIME, "strain": STRAIN, "resistance": resistance, "lines": np.arange(TIME.size) + 2, **changes}
    return Record(name="record", **values)

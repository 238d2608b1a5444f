"""The network of a window in NumPy, many cases at once, as training needs it; ``posterior.py`` is its definition.

Symbols: ``x`` centred block means [1], ``c`` components, ``s2`` variance of the noise of a block mean [1], ``lam``
variances of the components.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix
from .features import SECTORS, SENSORS, Components
from .fuzzy_rules import QUADRANT, FuzzyRules
from .perceptron import Perceptron
from .posterior import FLOOR, IMAGE_ZONES, SPREAD, SPREADS, degrees_of_freedom, image_signs
from .posterior_artifact import HEADS, ZONES, PosteriorWindow

Rows = NDArray[Any]  # of single or double precision


class Features(NamedTuple):
    """Features of the network, shape (n, K + 1), components, shape (n, K), and variance of the noise, shape (n, 1)."""

    features: Rows
    c: Rows
    s2: Rows


def analyse(parts: Components | PosteriorWindow, x: Rows) -> Features:
    """Return the features of block means, shape (n, 4, M)."""
    y = np.tensordot(x - parts.mean, SECTORS, (1, 1))  # (n, M, 4)
    c = np.empty((len(x), len(parts.sectors)))
    outside = np.sum(y * y, axis=(1, 2))
    for sector in range(SENSORS):
        some = parts.sectors == sector
        V = parts.axes[:, some]
        c[:, some] = y[:, :, sector] @ V
        left = y[:, :, sector] - c[:, some] @ V.T
        outside += np.sum(left * left, axis=1) - np.sum(y[:, :, sector] ** 2, axis=1)
    s2 = outside[:, None] / (SENSORS * degrees_of_freedom(parts)) + FLOOR**2
    return Features(features(parts.variances, c, s2), c, s2)


def features(lam: Rows, c: Rows, s2: Rows) -> Rows:
    """Return the features of components, shape (n, K), and the variance of the noise, shape (n, 1)."""
    return np.hstack([c * np.sqrt(lam) / (lam + s2), 0.5 * np.log10(s2) + s2.dtype.type(3.5)])


def network_of(window: PosteriorWindow) -> Perceptron | FuzzyRules:
    """Return the network of a window."""
    arrays: list[Rows] = list(window.encoder)
    return FuzzyRules(arrays) if window.network == "neuro-fuzzy" else Perceptron(arrays)


def all_heads(net: Perceptron | FuzzyRules, features: Rows, signs: Rows) -> Rows:
    """Evaluate the heads of all zones, shape (n, 48), from the images of the features."""
    found = np.empty((len(features), HEADS, ZONES), features.dtype)
    for sign, zones in zip(signs.T, IMAGE_ZONES, strict=True):
        found[:, :, zones] = net.values(features * sign)[-1].reshape(-1, HEADS, QUADRANT)
    return found.reshape(len(features), -1)


def deviation(spread: Rows) -> Rows:
    """Return the standard deviation [1] that the third head states."""
    return np.asarray(SPREAD * np.exp(np.clip(spread, -SPREADS, SPREADS)), spread.dtype)


def damage_of(heads: Rows) -> Rows:
    """Return the estimated damage [1], shape (n, 16), that heads, shape (n, 48), state."""
    return np.asarray(np.where(heads[:, :ZONES] >= 0.0, np.clip(heads[:, ZONES : 2 * ZONES], 0.0, 1.0), 0.0))


def heads_of(window: PosteriorWindow, found: Features) -> Matrix:
    """Evaluate the heads, shape (n, 48), of a window."""
    return all_heads(network_of(window), found.features, image_signs(window.sectors))


def explain(window: PosteriorWindow, found: Features) -> Matrix:
    """Return what the decoder makes of the answer, shape (n, K), to compare with the components."""
    hidden = network_of(window).values(found.features)[-2]
    given = np.hstack([damage_of(heads_of(window, found)), hidden @ window.latent])
    return Perceptron(list(window.decoder)).values(given)[-1] * window.scales

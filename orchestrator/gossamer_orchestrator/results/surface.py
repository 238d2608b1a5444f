r"""Strain of the faces of a membrane, and where it wrinkles, from the places of its nodes.

Symbols: ``T`` and ``t`` tangents in the reference and now [m], ``R`` reference tangents by local axes, ``g`` = t R^-1
the deformation gradient, ``E`` = (g^T g - I)/2 the Green-Lagrange strain, ``E1`` >= ``E2`` principal values, ``nu``
Poisson's ratio. All at the centre of each face: exact for triangles of constant strain, of second order for
quadrilaterals.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..fmi.shape import Array, Integers, Surface

TAUT, WRINKLED, SLACK = 0, 1, 2
_NO_STRAIN = 1e-9  # [1], of rounding


class FaceStrains(NamedTuple):
    """What the faces strain, arrays of shape (n,).

    Attributes
    ----------
    largest : ndarray
        Largest principal nominal strain of the geometry [1].
    mark : ndarray of int
        ``TAUT``, ``WRINKLED`` or ``SLACK``.
    """

    largest: Array
    mark: Integers


def face_strains(surface: Surface, places: Array, eigenstrain: Array) -> FaceStrains:
    r"""Measure the faces.

    Parameters
    ----------
    surface : Surface
        The membrane without strain.
    places : ndarray, shape (N, 3)
        Where its nodes are [m].
    eigenstrain : ndarray, shape (R, 3)
        Strain beyond the geometry [1]: along the first axis, across, shear.

    Notes ----- The mixed criterion of [1]_ on the strain with the eigenstrain: slack where :math:`E_1 \le 0`; else
    wrinkled where the smaller principal stress of Hooke's law, :math:`\propto E_2 + \nu E_1`, is negative; else taut.
    Damage changes no sign.

    References
    ----------
    .. [1] D. G. Roddeman et al., Journal of Applied Mechanics 54(4), 884-887, 1987, doi:10.1115/1.3173133.
    """
    T, t = _tangents(surface, surface.nodes), _tangents(surface, places)
    R = _local_axes(T, surface.direction[surface.region]) @ T
    g = t @ np.linalg.inv(R)
    E = (np.swapaxes(g, 1, 2) @ g - np.eye(2)) / 2.0
    largest = np.sqrt(np.maximum(1.0 + 2.0 * _principal(E)[0], 0.0)) - 1.0
    along, across, shear = eigenstrain[surface.region].T
    E1, E2 = _principal(E + np.stack([np.stack([along, shear], axis=-1), np.stack([shear, across], axis=-1)], axis=1))
    wrinkled = E2 + surface.poisson_ratio[surface.region] * E1 < -_NO_STRAIN
    return FaceStrains(largest, np.where(wrinkled, np.where(E1 <= 0.0, SLACK, WRINKLED), TAUT))


def _tangents(surface: Surface, places: Array) -> Array:
    """Return the derivatives of the places by the parent coordinates at the centres, shape (n, 3, 2)."""
    a, b, c, d = (places[surface.faces[:, k]] for k in range(4))
    triangle = (surface.faces[:, 3] < 0)[:, None]
    s = np.where(triangle, b - a, (b + c - a - d) / 2.0)
    t = np.where(triangle, c - a, (c + d - a - b) / 2.0)
    return np.stack([s, t], axis=-1)


def _local_axes(T: Array, direction: Array) -> Array:
    """Return the first local axis, a direction projected on the faces, and the second, shape (n, 2, 3)."""
    normal = np.cross(T[..., 0], T[..., 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    first = direction - np.sum(direction * normal, axis=1, keepdims=True) * normal
    lost = np.linalg.norm(first, axis=1, keepdims=True) < 1e-6 * np.linalg.norm(direction, axis=1, keepdims=True)
    other = np.roll(direction, 1, axis=1)
    first = np.where(lost, other - np.sum(other * normal, axis=1, keepdims=True) * normal, first)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normal, first)], axis=1)


def _principal(E: Array) -> tuple[Array, Array]:
    """Return the principal values of symmetric matrices, the larger one first."""
    mean, half = (E[:, 0, 0] + E[:, 1, 1]) / 2.0, (E[:, 0, 0] - E[:, 1, 1]) / 2.0
    radius = np.hypot(half, E[:, 0, 1])
    return mean + radius, mean - radius

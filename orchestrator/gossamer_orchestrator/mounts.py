r"""How heavy a body is where a membrane is mounted on it, and what to say where it is too light for an extrapolated force.

Symbols: ``m`` mass [kg], ``c`` centre of mass [m] and ``J`` inertia about it [kg m2] of the body, with the membrane's edge;
``r`` place of the membrane from c [m]. A force along a unit vector n there moves it as a mass of
:math:`1/(1/m + (r \times n)^T J^{-1} (r \times n))`, 1/(1/m + l^2/J) with the lever l about a principal axis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ENOUGH = 4.0  # times the membrane's mass, below which the energy of an undamped membrane grows by 1 % in a second

HUB = ("mass", *(f"centre_of_mass[{k}]" for k in (1, 2, 3)), *(f"inertia[{k}]" for k in range(1, 7)), "extrapolation")
HELD = ("held_mass", *(f"held_first_moment[{k}]" for k in (1, 2, 3)), *(f"held_inertia[{k}]" for k in range(1, 7)))
MOVING = ("moving_mass", *(f"moving_first_moment[{k}]" for k in (1, 2, 3)))


def matrix(six: Array) -> Array:
    """Return a symmetric matrix from xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def of_point(c: Array) -> Array:
    """Return the inertia of a unit mass at a place [m]."""
    return np.asarray(c @ c * np.eye(3) - np.outer(c, c))


def with_edge(m: float, c: Array, J: Array, held: Array) -> tuple[float, Array, Array]:
    """Return mass, centre and inertia about it of a body with the edge of a membrane, the numbers of ``HELD``."""
    mass = m + held[0]
    centre = (m * c + held[1:4]) / mass
    return mass, centre, J + m * of_point(c) + matrix(held[4:]) - mass * of_point(centre)


def too_light(m: float, c: Array, J: Array, membrane: Array) -> str:
    """Say so where a body with the membrane's edge is too light for it, the numbers of ``HELD`` and ``MOVING``."""
    whole = membrane[0] + membrane[10]
    if not (np.isfinite([m, *J.flat, *membrane]).all() and m > 0.0 and np.linalg.eigvalsh(J).min() > 0.0):
        return ""  # a mass at a point, or numbers that the run refuses
    r = (membrane[1:4] + membrane[11:]) / whole - c
    lever = np.cross(r, np.eye(3)).T  # r x n by columns
    apparent = 1.0 / np.linalg.eigvalsh(np.eye(3) / m + lever.T @ np.linalg.solve(J, lever)).max()
    if not apparent < ENOUGH * whole:
        return ""
    return (
        f"it is mounted where its carrier moves like {apparent:.3g} kg, {apparent / whole:.2g} times its own mass. Below "
        f"about {ENOUGH:g} a force that arrives one step late adds energy: an eighth as much with half the step"
    )

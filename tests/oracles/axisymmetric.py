"""Membranes of revolution under pressure as ordinary differential equations along their meridian, solved by collocation.

Symbols: ``S`` length along the meridian of the reference shape, ``R`` its radius; ``r`` and ``z`` current radius and height;
``l1 = |d(r, z)/dS|``, ``l2 = r/R`` stretches along and around; ``T1``, ``T2`` nominal tensions [N/m], the derivatives of the
energy per reference area; ``H = R T1 cos``, ``V = R T1 sin`` what a radian of the meridian pulls outward and up. Where the
energy less the work of the pressure p in the volume is least,

    dH/dS = T2 - p r dz/dS,    V = p r^2/2 + c

(A. E. Green, J. E. Adkins, Large Elastic Deformations, Oxford 1960, chapter 4), for a meridian that has the gas on its left;
the disc's has it on its right, so that p changes its sign.
"""

import numpy as np
from scipy.integrate import solve_bvp


def st_venant_kirchhoff(l1, l2, modulus, nu):
    """Nominal tensions of St Venant-Kirchhoff's law for a thickness of one."""
    e1, e2 = (l1**2 - 1.0) / 2.0, (l2**2 - 1.0) / 2.0
    return modulus / (1.0 - nu**2) * np.array([(e1 + nu * e2) * l1, (e2 + nu * e1) * l2])


def hencky(l1, l2, modulus, nu):
    """Nominal tensions of Hencky's law for a thickness of one."""
    h1, h2 = np.log(l1), np.log(l2)
    return modulus / (1.0 - nu**2) * np.array([(h1 + nu * h2) / l1, (h2 + nu * h1) / l2])


def neo_hookean(l1, l2, modulus, nu):
    """Nominal tensions of rubber that thins freely, for a thickness of one: mu (l - l3^2/l)."""
    squared = (l1 * l2) ** (-2.0 * nu / (1.0 - nu))
    return modulus / (2.0 * (1.0 + nu)) * np.array([l1 - squared / l1, l2 - squared / l2])


def _stretch(law, T1, l2):
    """Return the stretch along that carries a tension, by Newton's method with differences."""
    l1 = np.ones_like(T1)
    for _ in range(60):
        slope = (law(l1 + 1e-7, l2)[0] - law(l1 - 1e-7, l2)[0]) / 2e-7
        step = (law(l1, l2)[0] - T1) / slope
        l1 = np.clip(l1 - step, 0.3, 5.0)
        if np.abs(step).max() < 1e-13:
            break
    return l1


def disc(radius, pressure, law):
    """Return radius and height at 2,001 reference radii of a flat disc that is held at its rim; ``law(l1, l2)`` in N/m."""
    first = 1e-5 * radius

    def equations(S, y, _):
        r, _, H = y
        V = -pressure * r**2 / 2.0  # downhill from the middle
        T = np.hypot(H, V)
        l2 = r / S
        l1 = _stretch(law, T / S, l2)
        dr, dz = l1 * H / T, l1 * V / T
        return np.array([dr, dz, law(l1, l2)[1] + pressure * r * dz])

    def ends(a, b, middle):
        stretch = middle[0]
        return np.array([a[0] - stretch * first, a[2] - first * law(stretch, stretch)[0], b[0] - radius, b[1]])

    S = np.linspace(first, radius, 201)
    small = (pressure * radius / law(1.0 + 1e-6, 1.0 + 1e-6)[0] * 1e-6) ** (1.0 / 3.0)
    height, stretch = 0.6 * small * radius, 1.0 + small**2 / 4.0
    y = np.array(
        [S * (1.0 + (stretch - 1.0) * (1.0 - S / radius)), height * (1.0 - (S / radius) ** 2), S * law(stretch, stretch)[0]]
    )
    found = solve_bvp(equations, ends, S, y, p=[stretch], tol=1e-8, max_nodes=100_000)
    assert found.success, found.message
    places = np.linspace(first, radius, 2001)
    return places, found.sol(places)[:2]


def torus(ring, tube, pressure, law):
    """Return radius and height at 2,001 places, from the outer to the inner equator, of a torus about the z axis."""

    def equations(S, y, p):
        r, _, H = y
        R = ring + tube * np.cos(S / tube)
        V = pressure * r**2 / 2.0 + p[0]
        T = np.hypot(H, V)
        l1 = _stretch(law, T / R, r / R)
        dr, dz = l1 * H / T, l1 * V / T
        return np.array([dr, dz, law(l1, r / R)[1] - pressure * r * dz])

    S = np.linspace(0.0, np.pi * tube, 401)
    angle = S / tube
    tension = pressure * tube * (2.0 * ring + tube * np.cos(angle)) / (2.0 * (ring + tube * np.cos(angle)))
    y = np.array(
        [ring + tube * np.cos(angle), tube * np.sin(angle), -(ring + tube * np.cos(angle)) * tension * np.sin(angle)]
    )
    found = solve_bvp(
        equations,
        lambda a, b, p: np.array([a[1], a[2], b[1], b[2]]),
        S,
        y,
        p=[-pressure * ring**2 / 2.0],
        tol=1e-9,
        max_nodes=100_000,
    )
    assert found.success, found.message
    places = np.linspace(0.0, np.pi * tube, 2001)
    return places, found.sol(places)[:2]

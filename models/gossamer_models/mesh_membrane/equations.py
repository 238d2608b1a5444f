r"""The forces of a membrane on a mesh.

Symbols: ``x`` node positions [m], node by node as (x, y, z), shape (3 N,); ``f`` nodal forces [N]; ``h`` thickness [m],
``rho`` density [kg/m3], ``D`` = E h/(1 - nu^2) stiffness [N/m] of each of the G combinations; ``V`` volume of gas [m3].
All elements of a kind are one expression with a column per element; see ``membrane.element``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ..membrane.assembly import sum_at
from ..membrane.element import Element, Extras, balance, element_points, tangents
from ..membrane.law import Entry, matrix
from .structure import Elements, Structure


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """What the elements of each of the G combinations share, columns of shape (G,).

    Attributes
    ----------
    D : casadi.MX
        Stiffness [N/m].
    pressure : casadi.MX
        Follower pressure along the normal [Pa].
    eigenstrain : sequence of casadi.MX or None
        Twice the strain beside the geometric one [1]: along the first local axis, along the second, across.
    light : casadi.MX or None
        Direction in which light travels [1], shape (3,).
    absorbed, mirrored : casadi.MX or None
        Pressure of light [Pa], the share that is absorbed and the share that is mirrored.
    """

    D: Entry
    pressure: Entry
    eigenstrain: tuple[Entry, Entry, Entry] | None = None
    light: Entry | None = None
    absorbed: Entry | None = None
    mirrored: Entry | None = None


@dataclass(frozen=True, slots=True)
class Forces:
    """What all elements give.

    Attributes
    ----------
    f : casadi.MX, shape (3 N,)
        Load less stress [N].
    rate : casadi.MX, scalar
        Bound of the square of the highest angular frequency [1/s2].
    strain : casadi.MX, scalar
        Twice the largest principal Green-Lagrange strain [1].
    compressed : casadi.MX, scalar
        Share of the area where the smaller principal stress of Hooke's law is below zero [1].
    """

    f: ca.MX
    rate: ca.MX
    strain: ca.MX
    compressed: ca.MX


def forces(structure: Structure, x: ca.MX, state: State) -> Forces:
    r"""Write the nodal forces of stress, follower pressure and light.

    Notes
    -----
    The bound of the frequency is that of the element whose own is highest: ``geometry.stiffest`` times the square of the
    wave speed at its fastest point. With inertia along the surface scaled by k, waves along it are slower by sqrt(k), and
    transverse ones, whose speed is :math:`\sqrt{S/\rho}`, are not.
    """
    f, rates, strains, area = ca.MX.zeros(3 * len(structure.mesh.nodes)), [], [], ca.MX(0.0)
    areal = np.array([r.density * r.thickness for r in structure.setup.regions])[structure.region]
    k = structure.setup.inplane_mass
    for block in structure.elements:
        parts, wave, strain, compressed = _block(structure, block, x, state)
        f += sum_at(_places(block).reshape(-1), ca.vec(parts), 3 * len(structure.mesh.nodes))
        if k > 1.0:
            wave = ca.fmax(wave / k, wave - 1.0 - strain)
        D = ca.vec((state.D / ca.DM(areal))[block.combination.tolist()]).T
        rates.append(ca.mmax(ca.DM(block.stiffest).T * D * columns_max(wave)))
        strains.append(ca.mmax(strain))
        area += ca.sum1(ca.sum2(compressed))
    return Forces(f, ca.mmax(ca.vertcat(*rates)), ca.mmax(ca.vertcat(*strains)), area / structure.areas.sum())


def _block(structure: Structure, block: Elements, x: ca.MX, state: State) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
    element, n = block.element, len(block.nodes)
    points = len(element.w)

    def spread(values: Entry) -> Entry:  # of combinations over points and elements
        return ca.repmat(ca.vec(values[block.combination.tolist()]).T, points, 1)

    ratios = np.array([r.poisson_ratio for r in structure.setup.regions])
    nu = float(ratios[0]) if np.ptp(ratios) == 0.0 else spread(ca.DM(ratios[structure.region]))
    extras: dict[str, Any] = {}
    if state.eigenstrain is not None:
        along, across, shear = (spread(part) for part in state.eigenstrain)
        extras["eigenstrain"] = matrix([[along, shear], [shear, across]])
    if state.light is not None:
        extras |= {
            "light": ca.vertsplit(state.light),
            "absorbed": spread(state.absorbed),
            "mirrored": spread(state.mirrored),
        }
    w = ca.repmat(ca.DM(element.w), 1, n)
    at = element_points(_tangents(block, x), element, w, spread(state.D), nu, spread(state.pressure), Extras(**extras))
    parts: tuple[ca.MX, ca.MX, ca.MX, ca.MX] = ca.cse(
        [balance(at.P, at.load, element), at.wave, at.strain, at.compressed]
    )
    return parts


def volume(structure: Structure, x: ca.MX) -> ca.MX:
    r"""Write the volume [m3] that the enclosing faces bound: :math:`\tfrac13 \oint x \cdot n\,\mathrm{d}A`.

    Notes
    -----
    Of an open surface whose edge stays, its change is that of the volume behind it.
    """
    total = ca.MX(0.0)
    for block in structure.elements:
        T = _tangents(block, x)
        at = [_values(block.element, column) for column in _positions(block, x)]
        w = ca.mtimes(ca.DM(block.element.w), ca.DM(structure.enclosing[block.combination].astype(float)).T)
        total += ca.sum1(ca.sum2(w * sum(a * b for a, b in zip(at, np.cross(T[:, 0], T[:, 1]), strict=True)))) / 3.0
    return total


def columns_max(values: ca.MX) -> ca.MX:
    """Return the largest entry of every column."""
    rows = ca.vertsplit(values)
    found = rows[0]
    for row in rows[1:]:
        found = ca.fmax(found, row)
    return found


def _places(block: Elements) -> np.ndarray:
    """Return the places in x of x of the nodes of each element, then y, then z, shape (n, 3 m)."""
    return (3 * block.nodes[:, None, :] + np.arange(3)[:, None]).reshape(len(block.nodes), -1)


def _positions(block: Elements, x: ca.MX) -> list[ca.MX]:
    columns = ca.reshape(x[_places(block).reshape(-1).tolist()], -1, len(block.nodes))
    x_y_z: list[ca.MX] = ca.vertsplit(columns, block.nodes.shape[1])
    return x_y_z


def _tangents(block: Elements, x: ca.MX) -> np.ndarray:
    return tangents(_positions(block, x), block.element)


def _values(element: Element, column: ca.MX) -> ca.MX:
    for factor in element.N:
        column = ca.mtimes(factor, column)
    return column

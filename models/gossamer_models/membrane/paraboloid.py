r"""The paraboloid of revolution that fits a surface best: how good an antenna it is.

Symbols: ``x`` places of the nodes [m], ``w`` their areas over that of all [1]; in the axes of the drawn paraboloid, from its
vertex, ``X``; its focal length ``f`` [m], :math:`\kappa = 1/(4f)`; a motion by ``t`` [m] and a rotation vector ``phi`` [rad]
across the axis.

The distance of a node along the normal is, to first order and after the motion is taken back,
:math:`r = (z - \kappa \rho^2) / \sqrt{1 + 4 \kappa^2 \rho^2}` with :math:`\rho^2 = x^2 + y^2`. The best fit makes the sum of
w r^2 least; Gauss-Newton steps from the drawn shape find it. To a shallow dish a tilt is nearly a motion across, so that
roughness turns the axis: of 0.1 mm, random from node to node, by 0.04 degrees where f is 1 m.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..arrays import Matrix, Vector
from ..mistakes import Mistake, raise_any
from .boundary import members_of
from .geometry import Geometry
from .setup import Paraboloid, Setup
from .surface import Integers, SurfaceMesh

STEPS = 3  # of Gauss and Newton: of a motion by 2 % of f they leave 1e-7
TINY = 1e-30  # under roots, which have derivatives then
FAR, UNLIKE = 0.02, 0.1  # shares of the size, by which nodes may be off at the start, and of the focal length


@dataclass(frozen=True, eq=False)
class BestFit:
    """What fits a paraboloid to the nodes of some faces.

    Attributes
    ----------
    drawn : Paraboloid
        As drawn.
    nodes : ndarray of int, shape (n,)
        Nodes of its faces.
    axes : ndarray, shape (3, 3)
        Unit vectors across, across and along its axis, row by row.
    areas : ndarray, shape (n,)
        Areas of the nodes over that of all [1].
    """

    drawn: Paraboloid
    nodes: Integers
    axes: Matrix
    areas: Vector

    def __call__(self, x: ca.MX) -> dict[str, ca.MX]:
        """Return rms [m], focal shift [m] and pointing error [rad] by the names of outputs, from places, shape (3, n)."""
        X, w = ca.mtimes(ca.DM(self.axes), x - ca.DM(np.array(self.drawn.vertex))), ca.DM(self.areas)
        A, b = ca.SX.sym("A", 6, 6), ca.SX.sym("b", 6)
        solved = ca.Function("solved", [A, b], [ca.solve(A, b)])
        theta = ca.MX(ca.DM([0.0] * 5 + [0.25 / self.drawn.focal_length]))
        for _ in range(STEPS):
            r, J = _distances(X, theta)
            weighed = J * ca.repmat(w.T, 6, 1)
            theta = theta - solved(ca.mtimes(weighed, J.T), ca.mtimes(weighed, r))
        r, _ = _distances(X, theta)
        found = ca.sqrt(ca.dot(w, r**2) + TINY), 0.25 / theta[5] - self.drawn.focal_length, ca.norm_2(theta[3:5] + TINY)
        return dict(zip(self.drawn.outputs, found, strict=True))


def best_fits(setup: Setup, mesh: SurfaceMesh, measured: Sequence[Geometry]) -> tuple[BestFit, ...]:
    """Return what fits each paraboloid of a setup to nodes of a mesh, whose blocks are measured.

    Raises
    ------
    DescriptionError
        The faces of one are far from it, or do not tell its focal length.
    """
    found = [_best_fit(mesh, measured, each) for each in setup.surfaces]
    raise_any([*_unlike(found, mesh)])
    return tuple(found)


def _best_fit(mesh: SurfaceMesh, measured: Sequence[Geometry], drawn: Paraboloid) -> BestFit:
    faces = members_of(mesh, drawn.groups)
    areas = np.zeros(len(mesh.nodes))
    for block, found in zip(mesh.blocks, measured, strict=True):
        mine = faces[block.faces]
        np.add.at(areas, block.elements[mine], found.node_areas[mine])
    nodes = np.flatnonzero(areas)
    along = np.array(drawn.axis) / np.linalg.norm(drawn.axis)
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    across /= np.linalg.norm(across)
    return BestFit(drawn, nodes, np.array([across, np.cross(along, across), along]), areas[nodes] / areas[nodes].sum())


def _distances(X: ca.MX, theta: ca.MX) -> tuple[ca.MX, ca.MX]:
    """Return distances of places, shape (3, n), from a paraboloid that is moved and bent, shape (n,), and J, shape (6, n).

    Where phi is small, which is what J is for, its derivatives are those of a turn about the axes by themselves.
    """
    X, phi, kappa = X - theta[:3], ca.vertcat(theta[3:5], 0.0), theta[5]
    size = ca.sumsqr(phi) + TINY
    sine, rest = ca.sin(ca.sqrt(size)) / ca.sqrt(size), 2.0 * ca.sin(ca.sqrt(size) / 2.0) ** 2 / size
    x, y, z = ca.vertsplit(X - sine * ca.mtimes(ca.skew(phi), X) + rest * (ca.mtimes(phi, ca.mtimes(phi.T, X)) - size * X))
    squared = x**2 + y**2
    along = 1.0 / ca.sqrt(1.0 + 4.0 * kappa**2 * squared)
    across = -2.0 * kappa * along
    J = ca.vertcat(
        -across * x, -across * y, -along, across * y * z - along * y, along * x - across * x * z, -along * squared
    )
    return ((z - kappa * squared) * along).T, J


def _unlike(fits: list[BestFit], mesh: SurfaceMesh) -> Iterator[Mistake]:
    for i, fit in enumerate(fits):
        name, f = fit.drawn.name, fit.drawn.focal_length
        x = ca.MX.sym("x", 3, fit.nodes.size)
        rms, shift, pointing = (float(each) for each in ca.Function("fit", [x], [*fit(x).values()])(mesh.nodes[fit.nodes].T))
        if not (rms <= FAR * mesh.size and abs(shift) <= UNLIKE * f and pointing <= UNLIKE):
            text = (
                f"the faces of the surface {name!r} form no such paraboloid: the best fit has a focal length of "
                f"{f + shift:.4g} m in place of {f:g}, its axis is off by {np.degrees(pointing):.2g} degrees, and they are "
                f"{rms:.2g} m away from it. Check 'axis', 'vertex', 'focal_length' and 'groups'."
            )
            yield Mistake(("surfaces", i, "focal_length"), text)

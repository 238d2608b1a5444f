r"""The shape of a membrane as it was built: how far a survey finds it from its drawing, along the normal.

Symbols: ``X`` places on the drawn mesh [m], ``w`` deviation along its normal [m], ``c`` coefficients [m] of monomials in
coordinates from -1 to 1, ``A`` modes at places, which are orthonormal over the nodes; ``n`` points, ``k`` modes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Matrix, Vector
from ..errors import ConvergenceError, DataError, require
from .gauges import nearest_place
from .geometry import geometry
from .model import membrane_model
from .setup import Built, monomials
from .statics import Equilibrium
from .structure import Structure, make_structure
from .surface import SurfaceMesh

DEGREES = (0, 1, 2, 3, 4)  # of monomials
AWAY = 0.05  # of the size: points that are further from the surface are in another unit or frame
ROUNDS = 2  # of equilibria
SAME = 1.05  # of the least distance of points that are left out: from there on the lowest degree is taken
DEPENDENT = 1e-3  # of the largest singular value: combinations of monomials that are nearly 0 on the surface
SPARE, FEWEST = 4, 8  # points more than modes, and at all, at least


@dataclass(frozen=True, kw_only=True)
class Surveyed:
    """What a survey tells of a shape.

    Attributes
    ----------
    built : Built
        Deviation from the drawing.
    modes : int
        How many smooth modes it is made of.
    before, after : float
        Distances of the points from the surface in equilibrium, as drawn and as built [m], root mean square.
    left_out : float
        Distance of a point from a surface that was fitted without it [m], root mean square.
    """

    built: Built
    modes: int
    before: float
    after: float
    left_out: float


def as_built(mesh: SurfaceMesh, built: Built) -> SurfaceMesh:
    """Return a drawn mesh with all nodes moved along its normals, those that are held too."""
    normals = np.zeros_like(mesh.nodes)
    for block in mesh.blocks:
        X = mesh.nodes[block.elements]
        along = np.tile([1.0, 0.0, 0.0], (len(X), 1))
        np.add.at(normals, block.elements, geometry(X, block.order, "st_venant_kirchhoff", along).node_normals)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return replace(mesh, nodes=mesh.nodes + built.deviation(mesh.nodes)[:, None] * normals)


def with_shape(structure: Structure, built: Built) -> Structure:
    """Return a drawn structure with the shape that was built; its mesh is as fine as it is."""
    fine = replace(structure.setup, built=built, refine=0)
    found = make_structure(fine, as_built(structure.mesh, built))
    return replace(found, setup=replace(fine, refine=structure.setup.refine))


def surveyed(structure: Structure, points: Matrix) -> Surveyed:
    """Find the shape whose equilibrium under the loads of the start goes through measured points.

    Parameters
    ----------
    structure : Structure
        As drawn.
    points : ndarray, shape (n, 3)
        Of the surface [m], in the axes of the mesh.

    Raises
    ------
    DataError
        There are too few points, one is no number or away from the surface, or the shape is known already.
    ConvergenceError
        The membrane has no equilibrium.

    Notes
    -----
    Least squares of smooth modes: all polynomials of the coordinates up to the lowest degree by which points that are left
    out are predicted as well as by any. What points are away from the equilibrium moves the shape without stress, twice.
    """
    require(structure.setup.built is None, "the setup has a shape as built. Begin with the drawing.", DataError)
    bad = next(iter(np.flatnonzero(~np.isfinite(points).all(axis=1)).tolist()), None)
    require(bad is None, f"point {(bad or 0) + 1} of the survey has no three numbers. Write them, or remove it.", DataError)
    msg = f"a survey of {len(points)} points tells no shape. Measure {FEWEST} or more, all over the surface."
    require(len(points) >= FEWEST, msg, DataError)
    mesh = structure.mesh
    low, high = mesh.nodes.min(axis=0), mesh.nodes.max(axis=0)
    x, y, z = ((low + high) / 2.0).tolist()
    built, found = Built(centre=(x, y, z), size=mesh.size, coefficients=(0.0,)), structure
    away, X = _distances(found, mesh, points)
    before = _rms(away)
    modes = {degree: _modes(mesh, built, degree) for degree in DEGREES}
    fits = {d: _fitted(mode, d, built, X, away) for d, mode in modes.items() if mode.shape[1] + SPARE <= len(points)}
    least = min(left_out for _, left_out in fits.values())
    best = next(degree for degree, (_, left_out) in fits.items() if left_out <= SAME * least)
    change, left_out = fits[best]
    c = np.zeros(len(change))
    for _ in range(ROUNDS):
        c = c + change
        built = replace(built, coefficients=tuple(c.tolist()))
        found = with_shape(structure, built)
        away, X = _distances(found, mesh, points)
        change = _fitted(modes[best], best, built, X, away)[0]
    return Surveyed(built=built, modes=modes[best].shape[1], before=before, after=_rms(away), left_out=left_out)


def _distances(structure: Structure, drawn: SurfaceMesh, points: Matrix) -> tuple[Vector, Matrix]:
    """Return how far points are above a membrane in equilibrium [m], and where they are on the drawn mesh, shape (n, 3)."""
    found = Equilibrium(structure, membrane_model(structure)).solve({})
    nodes = structure.mesh.nodes + found.displacement[0]
    require(
        bool(np.isfinite(nodes).all()),
        "the membrane has no equilibrium under its loads at the start, so its shape at rest is not known. Check them.",
        ConvergenceError,
    )
    there = replace(structure.mesh, nodes=nodes)
    place, normal, weights = (np.array(each) for each in zip(*(nearest_place(there, p) for p in points), strict=True))
    far = np.linalg.norm(points - place, axis=1)
    worst = int(np.argmax(far))
    if far[worst] > AWAY * drawn.size:
        x, y, z = points[worst].tolist()
        msg = (
            f"point {worst + 1} of the survey, ({x:.4g}, {y:.4g}, {z:.4g}) m, is {far[worst]:.3g} m from the surface, more "
            f"than {100.0 * AWAY:g} % of its size of {drawn.size:.3g} m. Check its unit, and that its axes and origin are "
            "those of the mesh."
        )
        raise DataError(msg)
    return np.sum((points - place) * normal, axis=1), weights @ drawn.nodes


def _modes(mesh: SurfaceMesh, frame: Built, degree: int) -> Matrix:
    """Return coefficients of monomials that give modes of mean square 1 over the nodes, shape (monomials, k)."""
    P = monomials(frame.coordinates(mesh.nodes), degree) / np.sqrt(len(mesh.nodes))
    _, size, V = np.linalg.svd(P, full_matrices=False)
    kept = size > DEPENDENT * size[0]
    return np.asarray(V[kept].T / size[kept])


def _fitted(modes: Matrix, degree: int, frame: Built, X: Matrix, away: Vector) -> tuple[Vector, float]:
    """Return coefficients of least squares [m], and the distance of points that are left out one by one [m], rms."""
    Q, R = np.linalg.qr(monomials(frame.coordinates(X), degree) @ modes)
    leverage = np.sum(Q**2, axis=1)
    left = (away - Q @ (Q.T @ away)) / np.maximum(1.0 - leverage, 1e-9)
    return modes @ np.linalg.lstsq(R, Q.T @ away, rcond=DEPENDENT)[0], _rms(left)


def _rms(x: Vector) -> float:
    return float(np.sqrt(np.mean(x**2)))

r"""Strain gauges on a surface.

Symbols: ``point`` and ``direction`` of a gauge in space, ``s``, ``t`` parent coordinates [1], ``T`` reference tangents [m],
``delta`` parent coordinates of a unit line along the gauge [1/m]. What the line has become is a weighted sum of node
positions, whose length less one is the strain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..arrays import Matrix, Vector
from ..errors import DataError
from .element import derivative_matrix, gauss_points, lobatto_points, value_matrix
from .setup import Place, Sensor
from .surface import Block, SurfaceMesh

SAMPLES = 5  # of a gauge with a length, Gauss-Legendre
BESIDE = 0.005  # of the size: how far beside a gauge others tell what a move changes, at least
_ACROSS = 1e-2  # part of a direction that lies in the surface, at least
_BENT = 0.05  # share of a gauge that a curved surface may take from it
_NEAREST = 12  # elements looked into
_ROUND = 1.5  # times the distance of its nodes from their middle, within which an element lies
_THERE = 1e-13  # how far a point on an element may seem to be from it, shares of the size


@dataclass(frozen=True, eq=False)
class Gauge:
    """One gauge: its samples.

    Attributes
    ----------
    lines : sparse array, shape (samples, N)
        Weights of the node positions that give a unit line along the gauge [1].
    weights : ndarray, shape (samples,)
        Weights of the mean [1].
    away : float
        Largest distance of a sample from the surface [m].
    """

    lines: scipy.sparse.csr_array
    weights: Vector
    away: float


@dataclass(frozen=True, eq=False)
class Gauges:
    """Many gauges at once.

    Attributes
    ----------
    sensors : tuple of Sensor
        Where they are, G of them.
    lines : sparse array, shape (S, N)
        Weights of the node positions that give a unit line along each sample.
    means : sparse array, shape (G, S)
        Weights of the samples in each gauge.
    """

    sensors: tuple[Sensor, ...]
    lines: scipy.sparse.csr_array
    means: scipy.sparse.csr_array

    def strain(self, x: Matrix) -> Matrix:
        """Return the nominal strain [1], shape (G, n), from node positions [m], shape (N, 3, n)."""
        became = (self.lines @ x.reshape(len(x), -1)).reshape(-1, *x.shape[1:])
        return np.asarray(self.means @ np.sqrt(np.sum(became**2, axis=1)) - 1.0)

    def only(self, which: list[int]) -> Gauges:
        """Return some of the gauges."""
        means = self.means[which]
        return Gauges(tuple(self.sensors[k] for k in which), self.lines, means)


def stacked(sensors: tuple[Sensor, ...], gauges: list[Gauge], nodes: int) -> Gauges:
    """Put gauges together."""
    if not gauges:
        return Gauges((), scipy.sparse.csr_array((0, nodes)), scipy.sparse.csr_array((0, 0)))
    lines = scipy.sparse.csr_array(scipy.sparse.vstack([found.lines for found in gauges]))
    means = scipy.sparse.csr_array(
        scipy.sparse.block_diag([scipy.sparse.csr_array(found.weights[None]) for found in gauges])
    )
    return Gauges(sensors, lines, means)


def gauge(mesh: SurfaceMesh, point: Vector, direction: Vector, length: float) -> Gauge:
    """Place a gauge on the reference surface; samples beyond an edge are moved to the nearest place on it."""
    offsets, weights = gauss_points(SAMPLES) if length > 0.0 else (np.zeros(1), np.ones(1))
    _, middle, along = _line(mesh, point, direction)
    rows, away = [], float(np.linalg.norm(middle - point))
    for offset in offsets:
        row, place, _ = _line(mesh, middle + offset * length * along, direction)
        rows.append(row)
        away = max(away, abs(float((place - middle) @ along) - offset * length) - _BENT * length)
    return Gauge(scipy.sparse.csr_array(np.array(rows)), weights, away)


def moved_gauge(mesh: SurfaceMesh, normals: Vector, sensor: Sensor, move: Place = (0.0, 0.0)) -> Gauge:
    """Place a gauge that is off its point, along its direction and across it [m].

    Notes
    -----
    Its reading is linear in the move: that at its point, and differences of gauges on both sides. These are an element apart
    where the strain is all but constant within elements, of order 1.
    """
    if sensor.line:
        return _on_line(mesh, sensor)
    own = _placed(mesh, sensor)
    lines, weights, reach = [own.lines], [own.weights], _reach(mesh)
    for way, by in enumerate(move):
        ends = [beside(mesh, normals, sensor, side * reach, way) for side in (1.0, -1.0)] if by else []
        if ends:
            there = place_matrix(mesh, np.array([end.point for end in ends])) @ mesh.nodes  # on the membrane
            slope = by / max(float(np.linalg.norm(there[0] - there[1])), _THERE * mesh.size)
            for end, factor in zip(ends, (slope, -slope), strict=True):
                found = _placed(mesh, end)
                lines.append(found.lines)
                weights.append(factor * found.weights)
    return Gauge(scipy.sparse.csr_array(scipy.sparse.vstack(lines)), np.concatenate(weights), own.away)


def beside(mesh: SurfaceMesh, normals: Vector, sensor: Sensor, by: float, way: int) -> Sensor:
    """Return a sensor beside its place [m], along its direction or, for a way of 1, across it."""
    if sensor.line and way == 1:  # there is nothing across
        return sensor
    away = np.linalg.norm(mesh.nodes - np.array(sensor.point), axis=1)
    node = int(np.argmin(np.where(normals.any(axis=1), away, np.inf)))  # of a face: nodes of lines alone have no normal
    along = np.array(sensor.direction) / np.linalg.norm(sensor.direction)
    step = along if way == 0 else np.cross(normals[node], along)
    x, y, z = (np.array(sensor.point) + by * step / np.linalg.norm(step)).tolist()
    return replace(sensor, point=(x, y, z))


def _on_line(mesh: SurfaceMesh, sensor: Sensor) -> Gauge:
    """Place a gauge on a cable or beam: the segment nearest to its point, and all whose middle lies within its length."""
    pairs, point = mesh.lines[sensor.line], np.array(sensor.point)
    X = mesh.nodes[pairs]
    e = X[:, 1] - X[:, 0]
    length = np.linalg.norm(e, axis=1)
    share = np.clip(np.sum((point - X[:, 0]) * e, axis=1) / length**2, 0.0, 1.0)
    away = np.linalg.norm(X[:, 0] + share[:, None] * e - point, axis=1)
    chosen = np.linalg.norm(X.mean(axis=1) - point, axis=1) <= sensor.gauge_length / 2.0
    chosen[np.argmin(away)] = True
    rows = np.zeros((int(chosen.sum()), len(mesh.nodes)))
    np.put_along_axis(rows, pairs[chosen], np.array([-1.0, 1.0]) / length[chosen, None], axis=1)
    return Gauge(scipy.sparse.csr_array(rows), length[chosen] / length[chosen].sum(), float(away.min()))


def _placed(mesh: SurfaceMesh, sensor: Sensor) -> Gauge:
    return gauge(mesh, np.array(sensor.point), np.array(sensor.direction), sensor.gauge_length)


def _reach(mesh: SurfaceMesh) -> float:
    """Return how far beside a gauge others are read [m]."""
    first = [np.diff(mesh.nodes[block.elements[:, :2]], axis=1) for block in mesh.blocks if block.order < 2]  # sides
    return max([BESIDE * mesh.size, *(float(np.linalg.norm(side, axis=2).mean()) for side in first)])


def place_matrix(mesh: SurfaceMesh, points: Vector) -> Vector:
    """Return the weights of the nodes that interpolate at the places nearest to points, shape (points, N)."""
    matrix = np.zeros((len(points), len(mesh.nodes)))
    for row, point in zip(matrix, points, strict=True):
        _, block, k, st, _place = _element_at(mesh, point)
        row[block.elements[k]] = shape_functions(block.order, st)[0]
    return matrix


def nearest_place(mesh: SurfaceMesh, point: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the place of a mesh that is nearest to a point, the normal there, and the weights of the nodes, shape (N,)."""
    _, block, k, st, place = _element_at(mesh, point)
    N, D = shape_functions(block.order, st)
    s, t = D.T @ mesh.nodes[block.elements[k]]
    weights = np.zeros(len(mesh.nodes))
    weights[block.elements[k]] = N
    return place, np.cross(s, t) / np.linalg.norm(np.cross(s, t)), weights


def _element_at(mesh: SurfaceMesh, point: Vector) -> tuple[float, Block, int, Vector, Vector]:
    """Return distance, block, number and parent coordinates of the element nearest to a point, and the place on it."""
    best: tuple[float, Block, int, Vector, Vector] | None = None
    for block in mesh.blocks:
        centres = mesh.nodes[block.elements].mean(axis=1)
        near = cKDTree(centres).query(point, k=min(_NEAREST, len(centres)))[1]
        for k in np.atleast_1d(near):
            X = mesh.nodes[block.elements[k]]
            reach = _ROUND * np.linalg.norm(X - centres[k], axis=1).max()
            if best is not None and np.linalg.norm(point - centres[k]) - reach > best[0]:
                continue
            st, distance, place = _nearest(block.order, X, point)
            if best is None or distance < best[0]:
                best = (distance, block, int(k), st, place)
            if distance <= _THERE * mesh.size:  # no other element is nearer
                break
    assert best is not None  # a mesh has elements
    return best


def _line(mesh: SurfaceMesh, point: Vector, direction: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the weights of a unit line at the place nearest to a point, that place, and the line."""
    _, block, k, st, place = _element_at(mesh, point)
    _N, D = shape_functions(block.order, st)
    T = D.T @ mesh.nodes[block.elements[k]]  # (2, 3)
    delta = np.linalg.lstsq(T.T, direction / np.linalg.norm(direction), rcond=None)[0]
    if (length := np.linalg.norm(delta @ T)) < _ACROSS:
        msg = f"its direction {direction.tolist()} is across the surface. Name one that lies in it, nearly."
        raise DataError(msg)
    delta /= length
    row = np.zeros(len(mesh.nodes))
    row[block.elements[k]] = D @ delta
    return row, place, delta @ T


def _nearest(order: int, X: Vector, point: Vector) -> tuple[Vector, float, Vector]:
    """Find the place of an element nearest to a point by Gauss-Newton, kept inside."""
    st = np.full(2, 1.0 / 3.0) if order == 0 else np.zeros(2)
    for _ in range(30):
        N, D = shape_functions(order, st)
        change = np.linalg.lstsq((D.T @ X).T, point - N @ X, rcond=None)[0]
        moved = _inside(order, st + change)
        done = np.abs(moved - st).max() < 1e-14
        st = moved
        if done:
            break
    place = shape_functions(order, st)[0] @ X
    return st, float(np.linalg.norm(place - point)), place


def _inside(order: int, st: Vector) -> Vector:
    if order > 0:
        return np.clip(st, -0.5, 0.5)
    st = np.clip(st, 0.0, 1.0)
    return st / max(1.0, float(st.sum()))


def shape_functions(order: int, st: Vector) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Evaluate the shape functions, shape (m,), and their parent derivatives, shape (m, 2), at one place."""
    if order == 0:
        return np.array([1.0 - st.sum(), *st]), np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    nodes, _ = lobatto_points(order + 1)
    (vs, vt), (ds, dt) = ([f(nodes, np.array([u]))[0] for u in st] for f in (value_matrix, derivative_matrix))
    return np.kron(vt, vs), np.column_stack([np.kron(vt, ds), np.kron(dt, vs)])

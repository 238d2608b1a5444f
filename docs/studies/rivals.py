"""Regressions on lags that measured records are compared with: a ridge, a perceptron and a small recurrent network.

Symbols: ``u`` input and ``y`` output over their ranges in training [1]; ``X`` lags and low-passes of u; hidden state ``h``,
gates ``z`` and ``r`` of the recurrent network. All are fitted in time order: the last fifth of the training stretch decides
when to stop. They are written here with NumPy, are no part of the product and know nothing of sensors.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from gossamer_models.automatic.compare import features_of, regression
from gossamer_models.fitting import Record
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Rows = NDArray[np.bool_]
SIZES = (32, 16)  # units of the perceptron
UNITS = 12  # of the recurrent network
STEPS, RATE = 600, 5e-3  # of Adam
WINDOW = 120  # samples of a sequence; the state is carried from one to the next
HELD = 0.2  # of the training stretch
SEED = 0


def rivals(record: Record, train: Rows, u: Vector, y: Vector) -> dict[str, Vector]:
    """Return what each regression gives for y from u, shape (m,), by name."""
    scale_u, scale_y = (u[train].min(), np.ptp(u[train])), (y[train].min(), np.ptp(y[train]))
    v, w = (u - scale_u[0]) / scale_u[1], (y - scale_y[0]) / scale_y[1]
    times = np.geomspace(3.0 * float(np.median(np.diff(record.time))), 0.25 * float(np.ptp(record.time[train])), 8)
    X = features_of(record.time, v, times)
    X = (X - X[train].mean(axis=0)) / (X[train].std(axis=0) + 1e-9)
    found = {
        "ridge on lags": regression((record,), (u,), (y,), (train,))[0],
        "perceptron 32-16": scale_y[0] + scale_y[1] * _perceptron(X, w, train),
        "recurrent network of 12": scale_y[0] + scale_y[1] * _recurrent(v, w, train),
    }
    return {name: np.asarray(values) for name, values in found.items()}


def _split(train: Rows) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    places = np.flatnonzero(train)
    end = round((1.0 - HELD) * places.size)
    return places[:end], places[end:]


def _adam(parameters: list[Vector], step: Callable[[], tuple[list[Vector], float]], steps: int = STEPS) -> list[Vector]:
    """Minimize; ``step`` returns derivatives and the error on the held samples; the best parameters are returned."""
    first, second = ([np.zeros_like(p) for p in parameters] for _ in range(2))
    best, least = [p.copy() for p in parameters], np.inf
    for k in range(1, steps + 1):
        slopes, error = step()
        if error < least:
            best, least = [p.copy() for p in parameters], error
        for p, g, m, s in zip(parameters, slopes, first, second, strict=True):
            m += 0.1 * (g - m)
            s += 0.001 * (g * g - s)
            p -= RATE * (m / (1.0 - 0.9**k)) / (np.sqrt(s / (1.0 - 0.999**k)) + 1e-9)
    return best


def _perceptron(X: Vector, y: Vector, train: Rows) -> Vector:
    rng = np.random.default_rng(SEED)
    sizes = [X.shape[1], *SIZES, 1]
    parameters: list[Vector] = []
    for a, b in pairwise(sizes):
        parameters += [rng.normal(size=(a, b)) / np.sqrt(a), np.zeros(b)]
    fitted, held = _split(train)

    def forward(x: Vector) -> list[Vector]:
        layers = [x]
        for k in range(0, len(parameters), 2):
            z = layers[-1] @ parameters[k] + parameters[k + 1]
            layers.append(np.tanh(z) if k + 2 < len(parameters) else z)
        return layers

    def step() -> tuple[list[Vector], float]:
        layers = forward(X[fitted])
        back = 2.0 * (layers[-1] - y[fitted, None]) / fitted.size
        slopes: list[Vector] = []
        for k in reversed(range(0, len(parameters), 2)):
            slopes = [layers[k // 2].T @ back + 1e-5 * parameters[k], back.sum(axis=0), *slopes]
            if k:
                back = (back @ parameters[k].T) * (1.0 - layers[k // 2] ** 2)
        return slopes, float(np.mean((forward(X[held])[-1][:, 0] - y[held]) ** 2))

    parameters[:] = _adam(parameters, step)
    return np.asarray(forward(X)[-1][:, 0])


def _recurrent(u: Vector, y: Vector, train: Rows) -> Vector:
    """Return the output of a gated recurrent unit, trained on all windows at once, each from the state reached before."""
    rng = np.random.default_rng(SEED)
    n = UNITS
    parameters: list[Vector] = []
    for _ in range(3):  # gates z and r, candidate
        parameters += [rng.normal(size=(n, n)) / np.sqrt(n), rng.normal(size=n), np.zeros(n)]
    parameters += [rng.normal(size=n) / np.sqrt(n), np.array([0.0, 1.0])]
    fitted, held = _split(train)
    begins = np.arange(fitted[0], fitted[-1] - WINDOW, WINDOW)
    end = int(held[-1]) + 1

    def sigmoid(x: Vector) -> Vector:
        return 0.5 * (1.0 + np.tanh(0.5 * x))

    def cell(h: Vector, x: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        Wz, az, cz, Wr, ar, cr, Wn, an, cn = parameters[:9]
        z = sigmoid(h @ Wz + x[:, None] * az + cz)
        r = sigmoid(h @ Wr + x[:, None] * ar + cr)
        c = np.tanh((r * h) @ Wn + x[:, None] * an + cn)
        return (1.0 - z) * h + z * c, z, r, c

    def run(until: int) -> tuple[Vector, Vector]:
        h, states, outputs = np.zeros((1, n)), np.empty((until, n)), np.empty(until)
        w, d = parameters[9:]
        for k in range(until):
            states[k] = h[0]
            h = cell(h, u[k : k + 1])[0]
            outputs[k] = h[0] @ w + d[0] + d[1] * u[k]
        return states, outputs

    cached: dict[str, Vector] = {}

    def step() -> tuple[list[Vector], float]:
        count = int(cached.get("count", np.array(0)))
        if count % 10 == 0:  # states at the beginnings of the windows, and the held error, are renewed now and then
            cached["states"], cached["outputs"] = run(end)
        cached["count"] = np.array(count + 1)
        h, tape = cached["states"][begins], []
        Wz, Wr, Wn = parameters[0], parameters[3], parameters[6]
        w, d = parameters[9:]
        slopes = [np.zeros_like(p) for p in parameters]
        for k in range(WINDOW):
            x = u[begins + k]
            new, z, r, c = cell(h, x)
            off = 2.0 * (new @ w + d[0] + d[1] * x - y[begins + k]) / (begins.size * WINDOW)
            tape.append((h, x, z, r, c, new, off))
            h = new
        back = np.zeros_like(h)
        for h, x, z, r, c, new, off in reversed(tape):
            slopes[9] += off @ new
            slopes[10] += np.array([off.sum(), off @ x])
            back = back + off[:, None] * w
            dz, dc = back * (c - h) * z * (1.0 - z), back * z * (1.0 - c**2)
            dh = back * (1.0 - z)
            dm = dc @ Wn.T
            dr = dm * h * r * (1.0 - r)
            for place, gate, before in ((0, dz, h), (3, dr, h), (6, dc, r * h)):
                slopes[place] += before.T @ gate
                slopes[place + 1] += x @ gate
                slopes[place + 2] += gate.sum(axis=0)
            back = dh + dm * r + dz @ Wz.T + dr @ Wr.T
        return slopes, float(np.mean((cached["outputs"][held] - y[held]) ** 2))

    parameters[:] = _adam(parameters, step, STEPS // 2)
    return run(u.size)[1]

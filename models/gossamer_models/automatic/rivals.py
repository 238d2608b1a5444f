"""Networks that a sensor's compensator is compared with: a perceptron on lags, and a small recurrent network.

Symbols: ``u`` input and ``y`` output over their ranges in training [1]; hidden state ``h``, gates ``z`` and ``r`` of the
recurrent network. Both are fitted in time order: the last fifth of the training samples decides when to stop. They know
nothing of sensors.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from ..arrays import Matrix, Vector
from ..detector.networks import Perceptron

SIZES = (32, 16)  # units of the perceptron
UNITS = 12  # of the recurrent network
STEPS, RATE = 600, 5e-3  # of Adam
MOST_SAMPLES = 6000  # to train on
WINDOW = 120  # samples of a sequence; the state is carried from one to the next
RENEWED = 50  # steps after which these states are
HELD = 0.2  # of the training samples
SEED = 0


def _adam(parameters: list[Any], step: Callable[[], tuple[list[Any], float]], steps: int = STEPS) -> list[Any]:
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


def perceptron(X: Matrix, y: Vector) -> Callable[[Matrix], Vector]:
    """Return a perceptron trained on samples in the order of time: features, shape (m, f), and output, shape (m,)."""
    rng = np.random.default_rng(SEED)
    mean, size = X.mean(axis=0), X.std(axis=0) + 1e-9
    X = (X - mean) / size
    sizes = [X.shape[1], *SIZES, 1]
    net = Perceptron([])
    for a, b in pairwise(sizes):
        net.arrays.extend([rng.normal(size=(a, b)) / np.sqrt(a), np.zeros(b)])
    end = min(round((1.0 - HELD) * y.size), y.size - 1)
    fitted, held = np.arange(0, end, max(1, end // MOST_SAMPLES)), slice(end, None)

    def step() -> tuple[list[Any], float]:
        values = net.values(X[fitted])
        slopes, _ = net.gradients(values, 2.0 * (values[-1] - y[fitted, None]) / fitted.size)
        pulled = [slope + 1e-5 * array * (array.ndim > 1) for slope, array in zip(slopes, net.arrays, strict=True)]
        return pulled, float(np.mean((net.values(X[held])[-1][:, 0] - y[held]) ** 2))

    best = Perceptron(_adam(net.arrays, step))
    return lambda x: np.asarray(best.values((x - mean) / size)[-1][:, 0])


def recurrent(u: Vector, y: Vector) -> Callable[[Vector], Vector]:
    """Return a gated recurrent unit that is trained on a history of input and output, shape (m,).

    All windows are trained at once, each from the state that is reached before it.
    """
    rng = np.random.default_rng(SEED)
    n = UNITS
    parameters: list[Vector] = []
    for _ in range(3):  # gates z and r, candidate
        parameters += [rng.normal(size=(n, n)) / np.sqrt(n), rng.normal(size=n), np.zeros(n)]
    parameters += [rng.normal(size=n) / np.sqrt(n), np.array([0.0, 1.0])]
    end = min(round((1.0 - HELD) * y.size), y.size - 1)
    held, window = slice(end, None), min(WINDOW, end)
    begins = np.arange(0, end - window + 1, window)

    def sigmoid(x: Vector) -> Vector:
        return 0.5 * (1.0 + np.tanh(0.5 * x))

    def cell(h: Vector, x: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        Wz, az, cz, Wr, ar, cr, Wn, an, cn = parameters[:9]
        z = sigmoid(h @ Wz + x[:, None] * az + cz)
        r = sigmoid(h @ Wr + x[:, None] * ar + cr)
        c = np.tanh((r * h) @ Wn + x[:, None] * an + cn)
        return (1.0 - z) * h + z * c, z, r, c

    def run(u: Vector) -> tuple[Matrix, Vector]:
        h, states, outputs = np.zeros((1, n)), np.empty((u.size, n)), np.empty(u.size)
        w, d = parameters[9:]
        for k in range(u.size):
            states[k] = h[0]
            h = cell(h, u[k : k + 1])[0]
            outputs[k] = h[0] @ w + d[0] + d[1] * u[k]
        return states, outputs

    cached: dict[str, Vector] = {}

    def step() -> tuple[list[Vector], float]:
        count = int(cached.get("count", np.array(0)))
        if count % RENEWED == 0:  # states at the beginnings of the windows, and the held error, are renewed now and then
            cached["states"], cached["outputs"] = run(u)
        cached["count"] = np.array(count + 1)
        h, tape = cached["states"][begins], []
        Wz, Wr, Wn = parameters[0], parameters[3], parameters[6]
        w, d = parameters[9:]
        slopes = [np.zeros_like(p) for p in parameters]
        for k in range(window):
            x = u[begins + k]
            new, z, r, c = cell(h, x)
            off = 2.0 * (new @ w + d[0] + d[1] * x - y[begins + k]) / (begins.size * window)
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
    return lambda u: run(u)[1]

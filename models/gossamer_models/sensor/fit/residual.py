r"""Training of the residual network on what a fitted sensor leaves over.

Symbols: ``X`` features over their range [1], ``r`` remaining output [1], ``B`` bound; the parameters are those of
``Residual`` in one vector. The network is small and its training stops early: after as many iterations as
predict the later parts of the training stretch best.
"""

from collections.abc import Callable, Sequence
from itertools import count

import casadi as ca
import numpy as np
from scipy.optimize import minimize

from ...arrays import Matrix, Rows, Vector
from ...fitting.records import Record
from ...variables import pack, unpack
from ..artifact import Residual, SensorArtifact
from ..law import SensorLaw

HIDDEN = 8  # units
MOST_STEPS, LOOK = 150, 5  # iterations, and how many pass between two looks at the held samples
DECAY = 1e-3  # of the squares of the weights, relative to the mean square of what remains
BOUND = 2.0  # times the largest remaining output in training
SPREAD = 0.05  # least range of a feature [1]
WORTH = 0.98  # of the error without the network: less is no reason for one


def features_of(artifact: SensorArtifact, record: Record, full_scale: float) -> Matrix:
    """Return the features of a sensor, shape (m, F), over the strain of a record that starts at rest."""
    law = SensorLaw(artifact)
    strain = np.clip(record.strain / full_scale, 0.0, 1.0)
    rest = law.rest(ca.MX(float(strain[0])))
    x, s, h = ca.MX.sym("x", pack(rest).numel()), ca.MX.sym("s"), ca.MX.sym("h")
    state = law.advance(unpack(rest, x), s, h)
    step = ca.Function("step", [x, s, h], [pack(state), law.features(state)])
    first = ca.Function("first", [], [pack(rest), law.features(rest)])()
    _, later = step.mapaccum("all", strain.size - 1)(first["o0"], strain[1:][None, :], np.diff(record.time)[None, :])
    return np.vstack([first["o1"].full().T, later.full().T])


def train(
    features: Sequence[Matrix],
    remaining: Sequence[Vector],
    rows: Sequence[Rows],
    steps: int,
    *,
    seed: int = 0,
    watch: Callable[[Residual], None] | None = None,
) -> Residual:
    """Train a network on some samples of some records.

    Parameters
    ----------
    features, remaining : sequence of ndarray, shape (m, F) and (m,)
        Of every record: features and remaining output [1].
    rows : sequence of ndarray of bool, shape (m,)
        Samples to train on.
    steps : int
        Iterations of L-BFGS.
    seed : int
        Of the first weights.
    watch : callable, optional
        Called with the network after every iteration.

    Returns
    -------
    Residual
        The network.
    """
    F = np.vstack([f[k] for f, k in zip(features, rows, strict=True)])
    r = np.concatenate([e[k] for e, k in zip(remaining, rows, strict=True)])
    low, high = F.min(axis=0), F.max(axis=0)
    middle, half = 0.5 * (low + high), np.maximum(0.5 * (high - low), 0.5 * SPREAD)
    low, high = middle - half, middle + half
    X, bound = (F - middle) / half, BOUND * float(np.abs(r).max()) + 1e-9
    size, n, H = float(np.mean(r**2)) + 1e-18, F.shape[1], HIDDEN
    rng = np.random.default_rng(seed)
    start = np.concatenate([rng.normal(size=H * n) / np.sqrt(n), np.zeros(H), 0.01 * bound * rng.normal(size=H)])

    def split(p: Vector) -> tuple[Matrix, Vector, Vector]:
        return p[: H * n].reshape(H, n), p[H * n : H * n + H], p[H * n + H :] * bound

    def loss(p: Vector) -> tuple[float, Vector]:
        W, c, w = split(p)
        a = np.tanh(X @ W.T + c)
        t = np.tanh(a @ w / bound)
        off = bound * t - r
        back = (2.0 / (size * r.size)) * off * (1.0 - t**2)
        hidden = (back[:, None] * w) * (1.0 - a**2)
        slope = np.concatenate([(hidden.T @ X).ravel(), hidden.sum(axis=0), (a.T @ back) * bound])
        return float(np.mean(off**2)) / size + DECAY * float(p @ p), slope + 2.0 * DECAY * p

    def network(p: Vector) -> Residual:
        W, c, w = split(p)
        rows_of = tuple(map(tuple, W.tolist()))
        return Residual(
            lowest=tuple(low.tolist()),
            highest=tuple(high.tolist()),
            hidden=rows_of,
            bias=tuple(c.tolist()),
            out=tuple(w.tolist()),
            bound=bound,
        )

    report = None if watch is None else (lambda p: watch(network(p)))
    found = minimize(loss, start, jac=True, method="L-BFGS-B", callback=report, options={"maxiter": steps})
    return network(found.x)


def corrections(residual: Residual, features: Matrix) -> Vector:
    """Return the corrections [1], shape (m,), of features, shape (m, F)."""
    x = ca.MX.sym("x", features.shape[1], features.shape[0])
    function = ca.Function("corrections", [x], [residual.correction(x)])
    return np.asarray(function(features.T).full()[0])


def choose_steps(
    cuts: Sequence[tuple[Sequence[Matrix], Sequence[Vector], Sequence[Rows], Sequence[Rows]]], *, seed: int = 0
) -> int:
    """Return after how many iterations to stop; 0 where a network does not pay.

    Parameters
    ----------
    cuts : sequence of tuple
        Of every cut of the training stretch: features and remaining outputs of a sensor that is fitted to the samples
        before it; these samples; and those after it, which judge.
    seed : int
        Of the first weights.
    """
    curves = []
    for features, remaining, fitted, held in cuts:

        def error(residual: Residual | None) -> float:
            squares = [
                (e[k] - (0.0 if residual is None else corrections(residual, f[k]))) ** 2
                for f, e, k in zip(features, remaining, held, strict=True)  # noqa: B023
                if k.any()
            ]
            return float(np.log(np.mean(np.concatenate(squares)) + 1e-18))

        curve, taken = [error(None)], count(1)

        def watch(network: Residual) -> None:
            if next(taken) % LOOK == 0:  # noqa: B023
                curve.append(error(network))  # noqa: B023

        train(features, remaining, fitted, MOST_STEPS, seed=seed, watch=watch)
        curves.append(curve + [curve[-1]] * (MOST_STEPS // LOOK + 1 - len(curve)))
    mean = np.mean(curves, axis=0)
    best = int(np.argmin(mean))
    return LOOK * best if mean[best] < mean[0] + 2.0 * np.log(WORTH) else 0

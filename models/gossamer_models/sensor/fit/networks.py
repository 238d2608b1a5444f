r"""Training of the small networks of a sensor: on what it leaves over, and for its direct inverse.

Symbols: ``X`` features over their range [1], ``r`` target [1], ``B`` bound; the parameters are those of ``SmallNetwork`` in
one vector. The training of a residual network stops early: after as many iterations as predict the later parts of the
training stretch best.
"""

from collections.abc import Callable, Sequence
from itertools import count
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import minimize

from ...arrays import Matrix, Rows, Vector
from ...fitting.records import Record
from ...variables import pack, unpack
from ..artifact import SensorArtifact, SmallNetwork
from ..direct import DirectLaw
from ..law import SensorLaw

HIDDEN = 8  # units
MOST_STEPS, LOOK = 150, 5  # iterations, and how many pass between two looks at the held samples
DECAY = 1e-3  # of the squares of the weights of a residual network, relative to the mean square of what remains
BOUND = 2.0  # times the largest target in training
AT_ONCE = 100  # samples of one call: to build a call of all of a long record takes longer than to run it
SPREAD = 0.05  # least range of a feature [1]
WORTH = 0.98  # of the error without the network: less is no reason for one


def features_of(artifact: SensorArtifact, record: Record, full_scale: float) -> Matrix:
    """Return the features of a sensor, shape (m, F), over the strain of a record that starts at rest."""
    return memory(SensorLaw(artifact), np.clip(record.strain / full_scale, 0.0, 1.0), record.time)


def memory(law: SensorLaw | DirectLaw, values: Vector, time: Vector, seen: Callable[[Any], ca.MX] | None = None) -> Matrix:
    """Return the features of a law, shape (m, F), whose strain or output [1] has values at some times [s], from rest.

    ``seen`` takes something else from a state.
    """
    which: Any = law
    seen = seen or which.features
    rest = which.rest(ca.MX(float(values[0])))
    x, s, h = ca.MX.sym("x", pack(rest).numel()), ca.MX.sym("s"), ca.MX.sym("h")
    state = which.advance(unpack(rest, x), s, h)
    step = ca.Function("step", [x, s, h], [pack(state), seen(state)])
    first = ca.Function("first", [], [pack(rest), seen(rest)])()
    many, at, found = step.mapaccum("many", AT_ONCE), first["o0"], [first["o1"]]
    for k in range(1, values.size, AT_ONCE):
        part = np.minimum(np.arange(k, k + AT_ONCE), values.size - 1)  # the last place stands for those after the end
        states, features = many(at, values[part][None, :], (time[part] - time[part - 1])[None, :])
        at = states[:, -1]
        found.append(features)
    return np.asarray(ca.horzcat(*found).full().T[: values.size])


def train(
    features: Sequence[Matrix],
    targets: Sequence[Vector],
    rows: Sequence[Rows],
    steps: int,
    *,
    decay: float = DECAY,
    seed: int = 0,
    watch: Callable[[SmallNetwork], None] | None = None,
) -> SmallNetwork:
    """Train a network on some samples of some records.

    Parameters
    ----------
    features, targets : sequence of ndarray, shape (m, F) and (m,)
        Of every record: features, and what the network has to give [1].
    rows : sequence of ndarray of bool, shape (m,)
        Samples to train on.
    steps : int
        Iterations of L-BFGS.
    decay : float
        Weight of the squares of the weights, relative to the mean square of the targets.
    seed : int
        Of the first weights.
    watch : callable, optional
        Called with the network after every iteration.

    Returns
    -------
    SmallNetwork
        The network.
    """
    F = np.vstack([f[k] for f, k in zip(features, rows, strict=True)])
    r = np.concatenate([e[k] for e, k in zip(targets, rows, strict=True)])
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
        return float(np.mean(off**2)) / size + decay * float(p @ p), slope + 2.0 * decay * p

    def network(p: Vector) -> SmallNetwork:
        W, c, w = split(p)
        rows_of = tuple(map(tuple, W.tolist()))
        return SmallNetwork(
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


def corrections(residual: SmallNetwork, features: Matrix) -> Vector:
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

        def error(residual: SmallNetwork | None) -> float:
            squares = [
                (e[k] - (0.0 if residual is None else corrections(residual, f[k]))) ** 2
                for f, e, k in zip(features, remaining, held, strict=True)  # noqa: B023
                if k.any()
            ]
            return float(np.log(np.mean(np.concatenate(squares)) + 1e-18))

        curve, taken = [error(None)], count(1)

        def watch(network: SmallNetwork) -> None:
            if next(taken) % LOOK == 0:  # noqa: B023
                curve.append(error(network))  # noqa: B023

        train(features, remaining, fitted, MOST_STEPS, seed=seed, watch=watch)
        curves.append(curve + [curve[-1]] * (MOST_STEPS // LOOK + 1 - len(curve)))
    mean = np.mean(curves, axis=0)
    best = int(np.argmin(mean))
    return LOOK * best if mean[best] < mean[0] + 2.0 * np.log(WORTH) else 0

r"""A watch that needs no simulation: damage is weighed against stored responses to a load that repeats.

The ground simulates one period of the healthy response, and what damages and nuisances change of it; on board each sample is
multiplied by a column of that table, and a window ends in a small least squares.

Symbols: ``s`` sensors, ``z`` zones, ``q`` nuisances that last, in units of their priors' deviations; ``N`` samples of a
period, ``m`` windows of ``n``; ``r`` residual over the noise, ``D`` what nuisances, then damages, change of it, ``g`` sum of
D r over a window; ``A`` precision of the nuisances.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from ..arrays import Matrix, Vector
from ..errors import ConvergenceError, ParameterError, require
from ..membrane import Structure
from ..step_model import StepModel
from ..variables import Results, Values, fraction, input_, pack, parameter, positive, results_of, unpack
from .evidence import NEGLIGIBLE
from .forward import Forward, finer_of, forward_of
from .nuisances import GAIN, Loads, Nuisances, possible
from .simulation import Place, SensedForward
from .watch import HALF, MOVED, NEIGHBOUR, SETTLED, SURE

KINDS = ("amplitude", "phase", "damping", "modulus", "density", "prestrain")  # nuisances of the membrane and its load
LAGS = (1, 2, 4, 8)  # windows since the onsets that are tried
FADING = 0.98  # of what windows before these say of the nuisances, from window to window
LEARNING = SETTLED + 1  # windows before the first alarm
REPEATS, MOST_PERIODS = 1e-6, 200  # change of a response that has settled, of its range; periods until then
ON_TIME = 0.01  # of a step: how far from one a step may be
LEAST = 20  # samples of a window
PER_PERIOD = 2.0  # windows in a first period of the membrane, nearly
BENT = 0.5  # deviations of the load for its second derivative


@dataclass(frozen=True, kw_only=True)
class StoredResponses:
    """Healthy response to a load that repeats, and what changes it.

    Attributes
    ----------
    zones : tuple of str
        Names of the z zones.
    step : float
        Time between samples [s]; a period of the load is a whole number of them.
    windows : int
        Windows of a period.
    healthy : ndarray, shape (s, N)
        Strain [1] after 1, 2, ... steps of a period.
    lasting : ndarray, shape (q, s, N)
        What a deviation of each nuisance adds: of the membrane and its load, the square of the load's, a gain of each
        sensor, finer elements.
    slopes : ndarray, shape (z, s, N)
        What damage of each zone adds, over the damage [1].
    """

    zones: tuple[str, ...]
    step: float
    windows: int
    healthy: Matrix
    lasting: Matrix
    slopes: Matrix


def stored_responses(
    structure: Structure | Forward | None = None,
    *,
    parameters: Mapping[str, float] | None = None,
    step: float = 3e-4,
    exact_mesh: bool = False,
) -> StoredResponses:
    """Simulate what a watch on board compares readings with, from the same model and priors as ``Watch``.

    Parameters
    ----------
    structure : Structure, Forward or None
        Membrane whose built-in pressure repeats; None for the square of the thesis.
    parameters : mapping of str to float
        Parameters that differ from their start values.
    step : float
        Time between samples [s]; it is changed until a period of the load is a whole number of windows and samples.
    exact_mesh : bool
        Whether readings come from the mesh of the structure, so that half of what finer elements add is no part of them.

    Raises
    ------
    ParameterError
        There is no built-in pressure, or its period has less than 20 samples.
    ConvergenceError
        The response does not repeat within 200 periods.
    """
    forward = forward_of(structure, parameters)
    numbers = {**forward.parameters, **forward.inputs}
    acts = numbers.get("pressure_amplitude", 0.0) > 0.0 and numbers["pressure_frequency"] > 0.0
    require(
        acts, "a watch on board needs a load that repeats. Give the setup a pressure_amplitude and a pressure_frequency."
    )
    period = 1.0 / numbers["pressure_frequency"]
    windows = min(max(1, round(PER_PERIOD * period / forward.period)), int(period / step / LEAST))
    require(windows, f"a period of the load has less than {LEAST} samples. Shorten the step of {step:g} s.")
    samples = round(period / windows / step)
    kinds = tuple(kind for kind in KINDS if kind in possible(numbers, Loads()))
    nuisances = Nuisances(kinds, forward.parameters, forward.inputs, forward.sensors)
    around = np.vstack([np.zeros(len(kinds)), MOVED * np.eye(len(kinds))])
    bent = BENT * np.outer([1.0, -1.0], np.eye(len(kinds))[kinds.index("amplitude")])
    rows = np.vstack([around, bent])
    given = [{name: float(value[0]) for name, value in nuisances.moved(z[None]).items()} for z in rows]
    zones, N, h = len(forward.zones), windows * samples, period / windows / samples
    damages = np.vstack([np.zeros((len(given), zones)), NEIGHBOUR * np.eye(zones)])
    found = _settled(forward, damages, given + [{}] * zones, N, h)
    finer = None if exact_mesh else finer_of(forward)
    added = np.zeros((0, *found.shape[1:]))
    if finer is not None:
        added = HALF * (_settled(finer, damages[:1], [{}], N, h) - found[:1])
    gains = GAIN * found[0][None] * np.eye(forward.sensors)[:, :, None]
    moved = (found[1 : len(around)] - found[0]) / MOVED
    curved = (found[len(given) - 2 : len(given)].sum(axis=0, keepdims=True) - 2.0 * found[:1]) / (2.0 * BENT**2)
    return StoredResponses(
        zones=forward.zones,
        step=h,
        windows=windows,
        healthy=found[0] + added.sum(axis=0),
        lasting=np.concatenate([moved, curved, gains, added]),
        slopes=(found[len(given) :] - found[0]) / NEIGHBOUR,
    )


def _settled(forward: Forward, damages: Matrix, given: list[dict[str, float]], N: int, h: float) -> Matrix:
    """Return a period of the strain of some cases, shape (m, s, N), when it repeats."""
    sensed = SensedForward(forward)
    place = Place.joined([sensed.begin(damage, each, h) for damage, each in zip(damages, given, strict=True)])
    through = np.repeat(damages[:, None], N, axis=1)
    before = np.full((len(damages), forward.sensors, N), np.inf)
    for _ in range(MOST_PERIODS):
        found, _, place = sensed.advance(place, through, {}, h)
        if np.abs(found - before).max() <= REPEATS * np.ptp(found[0], axis=1).min():
            return found
        before = found
    msg = f"the response does not repeat within {MOST_PERIODS} periods of the load. Raise its damping, or lower the load."
    raise ConvergenceError(msg)


@dataclass(frozen=True, slots=True)
class Said:
    """Results of a window; see the table of variables."""

    alarm: ca.MX
    evidence: ca.MX
    sees: ca.MX
    misfit: ca.MX
    valid: ca.MX


@dataclass(frozen=True, slots=True)
class Learned:
    """What ended windows have left.

    Attributes
    ----------
    count : casadi.MX, scalar
        Windows judged.
    scale : casadi.MX, scalar
        Largest mean of the scores of the first windows, at least 1.
    recent : casadi.MX, shape (q + z, R)
        Sums of the last R windows, the newest first.
    kinds : casadi.MX, shape (R,)
        Which of the m windows of a period they are.
    A, b : casadi.MX, shapes (q, q) and (q,)
        Precision of the nuisances by the windows before, and this times their mean.
    said : Said
        Of the last window.
    """

    count: ca.MX
    scale: ca.MX
    recent: ca.MX
    kinds: ca.MX
    A: ca.MX
    b: ca.MX
    said: Said


@dataclass(frozen=True, slots=True)
class Running:
    """The running window: column of the table, whether a sample is missing, sums of D r, and of r and its squares."""

    column: ca.MX
    broken: ca.MX
    g: ca.MX
    total: ca.MX
    squares: ca.MX
    learned: Learned


class StoredWindows:
    """What a window of each kind says of nuisances and damages: constants, and the least squares."""

    def __init__(self, stored: StoredResponses, noise: Vector, false_alarms: float) -> None:
        changes = np.concatenate([stored.lasting, stored.slopes]) / noise[:, None]
        self.q, self.z = len(stored.lasting), len(stored.slopes)
        each = changes.reshape(len(changes), len(noise), stored.windows, -1)
        each = each - each.mean(axis=3, keepdims=True)  # so that an offset does not count
        self.m, self.n = each.shape[2:]
        self.D = each.reshape(changes.shape)
        self.information = G = np.einsum("ksmn,lsmn->mkl", each, each)
        self._precisions = ca.DM(G[:, : self.q, : self.q].reshape(self.m, -1)).T
        self._mixed = ca.DM(G[:, : self.q, self.q :].transpose(0, 2, 1).reshape(self.m, -1)).T
        self._sizes = ca.DM(np.einsum("mkk->mk", G)[:, self.q :]).T
        self._values = self.n * len(noise) - len(noise)
        self._threshold = float(chdtri(1.0, false_alarms / (len(LAGS) * self.z)))

    def start(self) -> Learned:
        """Return what is known before the first window."""
        q, z, R = self.q, self.z, LAGS[-1]
        zero = ca.MX(0.0)
        said = Said(zero, ca.MX.zeros(z), zero, zero, zero)
        return Learned(
            zero, ca.MX(1.0), ca.MX.zeros(q + z, R), ca.MX.zeros(R), ca.MX(ca.densify(ca.DM.eye(q))), ca.MX.zeros(q), said
        )

    def precision(self, kind: ca.MX) -> ca.MX:
        """Return what a window says of the nuisances, shape (q, q)."""
        return ca.reshape(ca.MX(self._precisions)[:, _within(kind, self.m)], self.q, self.q)

    def mixed(self, kind: ca.MX) -> ca.MX:
        """Return what it says of damages and nuisances together, shape (z, q)."""
        return ca.reshape(ca.MX(self._mixed)[:, _within(kind, self.m)], self.q, self.z).T

    def judge(self, x: Learned, g: ca.MX, squares: ca.MX, kind: ca.MX) -> Learned:
        """Add a window that ends to what is learned, as ``Evidence`` does, and weigh damage since each of some onsets."""
        q, R = self.q, LAGS[-1]
        left = x.count > R - 0.5  # the oldest of the recent windows leaves them
        faded = FADING * x.A + (1.0 - FADING) * ca.MX.eye(q) + self.precision(x.kinds[-1])
        A = ca.if_else(left, faded, x.A)
        b = ca.if_else(left, FADING * x.b + x.recent[:q, -1], x.b)
        recent, kinds = ca.horzcat(g, x.recent[:, :-1]), ca.vertcat(kind, x.kinds[:-1])
        here = [ca.if_else(x.count > k - 0.5, 1.0, 0.0) for k in range(R)]
        whole = A + sum(here[k] * self.precision(kinds[k]) for k in range(R))
        V = _inverse_factor(q)(whole)
        mean = V.T @ (V @ (b + ca.sum2(recent[:q, :])))
        beside, sums, sizes = ca.MX.zeros(self.z, q), ca.MX.zeros(self.z), ca.MX.zeros(self.z)
        scores, curvatures = [], []
        for k in range(R):
            beside += here[k] * self.mixed(kinds[k])
            sums += recent[q:, k]
            sizes += here[k] * ca.MX(self._sizes)[:, _within(kinds[k], self.m)]
            if k + 1 in LAGS:
                known = (beside @ V.T) ** 2
                S = sizes - ca.sum2(known)
                seen = NEGLIGIBLE * sizes < S
                S = ca.if_else(seen, S, 1.0)
                scores.append(ca.if_else(seen, (sums - beside @ mean) ** 2 / S, 0.0))
                curvatures.append(ca.if_else(seen, S, 0.0))
        all_scores = ca.horzcat(*scores)
        average = ca.sum1(ca.sum2(all_scores)) / all_scores.numel()
        count = ca.fmin(x.count + 1.0, 1e6)
        scale = ca.if_else(count < LEARNING - 0.5, ca.fmax(x.scale, average), x.scale)
        evidence = _largest(scores) / scale / self._threshold
        ready = count > LEARNING - 0.5
        alarm = ca.fmax(x.said.alarm, ready * (ca.mmax(evidence) > 1.0))
        needed = ca.sqrt(scale) * (np.sqrt(self._threshold) + SURE)
        sees = needed / ca.sqrt(ca.fmax(ca.mmin(_largest(curvatures)), 1e-12))
        explained = 2.0 * ca.dot(mean, g[:q]) - ca.dot(mean, self.precision(kind) @ mean)
        misfit = ca.fmax(squares - explained, 0.0) / self._values
        return Learned(count, scale, recent, kinds, A, b, Said(alarm, evidence, sees, misfit, ready))


def _within(index: ca.MX, count: int) -> ca.MX:
    """Return a place in a table whatever the state says."""
    return ca.fmax(ca.fmin(index, count - 1.0), 0.0)


def _largest(columns: list[ca.MX]) -> ca.MX:
    found = columns[0]
    for each in columns[1:]:
        found = ca.fmax(found, each)
    return found


def _inverse_factor(q: int) -> ca.Function:
    """Return the function of A that gives V, lower triangular, with V A V^T = I."""
    A, L, V = ca.SX.sym("A", q, q), ca.SX.zeros(q, q), ca.SX.zeros(q, q)
    for j in range(q):
        L[j, j] = ca.sqrt(ca.fmax(A[j, j] - ca.sumsqr(L[j, :j]), 1e-9))
        for i in range(j + 1, q):
            L[i, j] = (A[i, j] - ca.dot(L[i, :j], L[j, :j])) / L[j, j]
    for j in range(q):
        V[j, j] = 1.0 / L[j, j]
        for i in range(j + 1, q):
            V[i, j] = -(L[i, j:i] @ V[j:i, j]) / L[i, i]
    return ca.Function("inverse_factor", [A], [ca.densify(V)])


def watch_model(stored: StoredResponses, noise: ArrayLike, false_alarms: float = 1e-5) -> StepModel:
    r"""Build the watch that runs on board.

    Parameters
    ----------
    stored : StoredResponses
        What readings are compared with.
    noise : float or array_like, shape (s,)
        Standard deviation of the noise of each sensor [1].
    false_alarms : float
        Share of the windows that may raise a false alarm.

    Returns
    -------
    StepModel
        Inputs ``strain[1..s]`` [1]; outputs ``alarm``, which stays, ``evidence[1..z]``, ``sees``, ``misfit`` and ``valid``.

    Raises
    ------
    ParameterError
        The noise or the share makes no sense.

    Notes
    -----
    The score statistics are those of ``Evidence``, of windows of fixed length: of damage of one zone since one, two, four
    and eight windows ago, beside nuisances whose priors the ground states and which all windows teach. A constant offset
    of a sensor in a window does not count. Scores are divided by the largest of their means in the first three windows, at
    least 1; these give no alarm.

    What windows before the last eight say of the nuisances fades, from window to window, as if their noise grew: where
    nothing changes a statistic is then no larger than chi2 of one degree of freedom. So false alarms are at most the share
    that is asked for, as long as noise is normal and white and nuisances act linearly. A step that is not one sampling step
    spoils the window; it is not counted.
    """
    sigma = np.broadcast_to(np.asarray(noise, dtype=float), (len(stored.healthy),))
    if not (np.isfinite(sigma).all() and (sigma > 0.0).all() and 0.0 < false_alarms < 1.0):
        msg = f"need a positive noise of each sensor and 0 < false_alarms < 1, not {noise!r} and {false_alarms:g}"
        raise ParameterError(msg)
    windows = StoredWindows(stored, sigma, false_alarms)
    sensors, N = stored.healthy.shape
    rows, n = windows.q + windows.z, windows.n
    table = ca.MX(ca.DM(np.vstack([stored.healthy, windows.D.transpose(1, 0, 2).reshape(-1, N)])))

    def init(_: Values, p: Values) -> tuple[Running, Results]:
        column = ca.fmod(ca.fmod(ca.floor((p.start_time - p.delay) / stored.step + 0.5) - 1.0, N) + N, N)
        learned = windows.start()
        none = ca.MX.zeros(sensors)
        return Running(column, ca.MX(1.0), ca.MX.zeros(rows), none, none, learned), results_of(learned.said)

    def step(x: Running, u: Values, p: Values, h: ca.MX) -> tuple[Running, Results]:  # noqa: ARG001
        steps = h / stored.step
        column = _within(ca.fmod(x.column + ca.floor(steps + 0.5), N), N)
        kind = ca.floor(column / n)
        place = column - n * kind
        begins, ends = place < 0.5, place > n - 1.5
        late = ca.fabs(steps - 1.0) > ON_TIME
        broken = ca.if_else(begins, 0.0, ca.fmax(x.broken, late))
        known = table[:, column]
        r = (u.strain - known[:sensors]) / ca.DM(sigma)
        stay = ca.if_else(begins, 0.0, 1.0)
        g = stay * x.g + ca.reshape(known[sensors:], rows, sensors) @ r
        total, squares = stay * x.total + r, stay * x.squares + r**2
        about = ca.sum1(squares - total**2 / n)
        due = ca.logic_and(ends, broken < 0.5)
        judged = pack(windows.judge(x.learned, g, about, kind))
        learned = unpack(x.learned, ca.conditional(ca.if_else(due, 0, -1), [judged], pack(x.learned), True))
        lacks = ca.logic_or(ca.logic_and(ends, broken > 0.5), ca.logic_and(begins, late))  # late: the end of the last window
        valid = ca.if_else(lacks, 0.0, learned.said.valid)
        said = replace(learned.said, valid=valid)
        learned = replace(learned, said=said)
        return Running(column, broken, g, total, squares, learned), results_of(said)

    return StepModel.written(
        name="watch",
        description=f"Alarm where damage of one of {windows.z} zones explains {sensors} strains better",
        variables=(
            parameter("start_time", "s", "Time since the load had the phase of the setup, at the first sample", 0.0, 0.0),
            parameter("delay", "s", "How much later than the membrane's the strain arrives", 0.0, 0.0),
            *(
                input_(f"strain[{i}]", "1", f"Strain at sensor {i}, prestrain included", 0.0, nominal=0.1)
                for i in range(1, sensors + 1)
            ),
            fraction("alarm", description="1 after an alarm, until init; else 0"),
            *(
                positive(f"evidence[{k}]", description=f"Score of damage in {name} over the threshold of an alarm")
                for k, name in enumerate(stored.zones, start=1)
            ),
            positive("sees", description="Damage that raises an alarm in nine of ten cases, in every zone"),
            positive("misfit", description="Mean square of what nuisances leave of the window, over the noise's"),
            fraction("valid", description="1 if the last window is whole and the first ones are over, else 0"),
        ),
        init=init,
        step=step,
        advice="The strains are probably far beyond anything physical.",
    )


def example_strain(stored: StoredResponses, noise: ArrayLike) -> Matrix:
    """Return strain [1], shape (s, samples), with 30 % of damage in the first zone in the last three windows."""
    windows = LEARNING + LAGS[-1]
    n = stored.healthy.shape[1] // stored.windows
    at = np.arange(-1, windows * n) % stored.healthy.shape[1]
    late = np.arange(-1, windows * n) >= (windows - 3) * n
    rough = np.broadcast_to(noise, len(stored.healthy))[:, None] * np.random.default_rng(1).standard_normal(
        (len(stored.healthy), at.size)
    )
    return np.asarray(stored.healthy[:, at] + 0.3 * late * stored.slopes[0][:, at] + rough)

r"""A watch that needs no simulation: damage is weighed against stored responses to a load that repeats.

The ground simulates one period of the healthy response, and what damages and nuisances change of it; on board each sample is
multiplied by a column of that table, and a window ends in a small least squares.

Symbols: ``s`` sensors, ``z`` zones, ``q`` nuisances that last, in units of their priors' deviations; ``N`` samples of a
period, ``m`` windows of ``n``; ``r`` residual over the noise, ``D`` what nuisances, then damages, change of it, ``d`` what a
shift of the load by a sample changes, ``g`` sum of D r over a window; ``A`` precision of the nuisances.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri

from ..arrays import Matrix, Vector
from ..errors import ParameterError
from ..step_model import StepModel
from ..variables import Results, Values, fraction, input_, modulo, pack, parameter, positive, results_of, unpack
from .evidence import NEGLIGIBLE
from .settled import StoredResponses
from .watch import SURE

LAGS = (1, 2, 4, 8)  # windows since the onsets that are tried
FADING = 0.98  # of what windows before these say of the nuisances, from window to window
SCALING = 10  # windows whose means are the scale of the scores
LEARNING = SCALING + 1  # first window that may raise an alarm
ON_TIME = 0.01  # of a step: how far from one a step may be
APART = 4  # samples between the shifts of the load that are tried
FOLLOWS = 0.1  # of the shift that a window says
DRIFTS = FOLLOWS**2 / 4.0  # of it, for its rate: a jump of the phase is overshot by 14 %
FASTEST = 1e-3  # rate of the shift [1]
SLIPS = 0.55  # shift by which the next column is nearer, with some play


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
    means : casadi.MX, shape (2,)
        Over the first windows, of the scores and of the misfit.
    recent : casadi.MX, shape (q + z, R)
        Sums of the last R windows, the newest first.
    kinds : casadi.MX, shape (R,)
        Which of the m windows of a period they are.
    A, b : casadi.MX, shapes (q, q) and (q,)
        Precision of the nuisances by the windows before, and this times their mean.
    mean : casadi.MX, shape (q,)
        Of the nuisances by all windows.
    said : Said
        Of the last window.
    """

    count: ca.MX
    means: ca.MX
    recent: ca.MX
    kinds: ca.MX
    A: ca.MX
    b: ca.MX
    mean: ca.MX
    said: Said


@dataclass(frozen=True, slots=True)
class Phase:
    """Where in its period the load is.

    Attributes
    ----------
    column : casadi.MX, scalar
        Of the table, nearest to the last sample.
    shift : casadi.MX, scalar
        How much later the sample was [steps].
    rate : casadi.MX, scalar
        Change of the shift from window to window.
    sought : casadi.MX, scalar
        Samples since the phase is sought; N where it is known.
    alike : casadi.MX, shape (J,)
        Products of these samples with the healthy strain from each of J columns on.
    """

    column: ca.MX
    shift: ca.MX
    rate: ca.MX
    sought: ca.MX
    alike: ca.MX


@dataclass(frozen=True, slots=True)
class Running:
    """The running window: whether a sample is missing, sums of D r and of d r, and of r and its squares."""

    phase: Phase
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
        motion = moved(stored.healthy)[0].reshape(each.shape[1:]) / noise[:, None, None]
        motion = motion - motion.mean(axis=2, keepdims=True)
        self.motions = np.einsum("smn,smn->m", motion, motion)
        along = np.einsum("ksmn,smn->km", each, motion)
        self._along = ca.DM(along[: self.q])
        parts = along / np.maximum(self.motions, NEGLIGIBLE)
        each = each - parts[:, None, :, None] * motion  # nor a shift of the load
        self.D, self.d = each.reshape(changes.shape), motion.reshape(len(noise), -1)
        self.information = G = np.einsum("ksmn,lsmn->mkl", each, each)
        slopes = moved(stored.lasting.reshape(-1, self.m * self.n))[0].reshape(self.q, *each.shape[1:])
        late = np.einsum("ksmn,lsmn->mkl", each, slopes / noise[:, None, None])
        self._late = ca.DM(late.transpose(0, 2, 1).reshape(self.m, -1)).T
        self._precisions = ca.DM(G[:, : self.q, : self.q].reshape(self.m, -1)).T
        self._mixed = ca.DM(G[:, : self.q, self.q :].transpose(0, 2, 1).reshape(self.m, -1)).T
        self._sizes = ca.DM(np.einsum("mkk->mk", G)[:, self.q :]).T
        self._values = self.n * len(noise) - len(noise) - 1
        self._threshold = float(chdtri(1.0, false_alarms / (len(LAGS) * self.z)))

    def start(self) -> Learned:
        """Return what is known before the first window."""
        q, z, R = self.q, self.z, LAGS[-1]
        zero = ca.MX(0.0)
        said = Said(zero, ca.MX.zeros(z), zero, zero, zero)
        none, A = ca.MX.zeros(q), ca.MX(ca.densify(ca.DM.eye(q)))
        return Learned(zero, ca.MX.zeros(2), ca.MX.zeros(q + z, R), ca.MX.zeros(R), A, none, none, said)

    def precision(self, kind: ca.MX) -> ca.MX:
        """Return what a window says of the nuisances, shape (q, q)."""
        return ca.reshape(ca.MX(self._precisions)[:, _within(kind, self.m)], self.q, self.q)

    def mixed(self, kind: ca.MX) -> ca.MX:
        """Return what it says of damages and nuisances together, shape (z, q)."""
        return ca.reshape(ca.MX(self._mixed)[:, _within(kind, self.m)], self.q, self.z).T

    def late(self, kind: ca.MX) -> ca.MX:
        """Return what the nuisances change of the sums of a window that is a sample late, shape (q + z, q)."""
        return ca.reshape(ca.MX(self._late)[:, _within(kind, self.m)], self.q + self.z, self.q)

    def shift(self, turn: ca.MX, mean: ca.MX, kind: ca.MX) -> ca.MX:
        """Return how much later in its period samples were than was thought, by a sum of d r; exact over a whole period."""
        known = ca.dot(ca.MX(self._along)[:, _within(kind, self.m)], mean)
        return (turn - known) / max(float(self.motions.mean()), NEGLIGIBLE)

    def judge(self, x: Learned, g: ca.MX, squares: ca.MX, kind: ca.MX, shift: ca.MX, least: ca.MX) -> Learned:
        """Add a window that ends to what is learned, as ``Evidence`` does, and weigh damage since each of some onsets."""
        q, R = self.q, LAGS[-1]
        g = g - shift * (self.late(kind) @ x.mean)
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
        explained = 2.0 * ca.dot(mean, g[:q]) - ca.dot(mean, self.precision(kind) @ mean)
        misfit = ca.fmax(squares - explained, 0.0) / self._values
        all_scores = ca.horzcat(*scores)
        here_now = ca.vertcat(ca.sum1(ca.sum2(all_scores)) / all_scores.numel(), misfit)
        count = ca.fmin(x.count + 1.0, 1e6)
        means = ca.if_else(count < SCALING + 0.5, x.means + (here_now - x.means) / count, x.means)
        scale = ca.fmax(1.0, ca.mmax(means))
        evidence = _largest(scores) / scale / self._threshold
        ready = count > LEARNING - 0.5
        alarm = ca.fmax(x.said.alarm, ready * (ca.mmax(evidence) > least))
        needed = ca.sqrt(scale) * (ca.sqrt(least * self._threshold) + SURE)
        sees = needed / ca.sqrt(ca.fmax(ca.mmin(_largest(curvatures)), 1e-12))
        return Learned(count, means, recent, kinds, A, b, mean, Said(alarm, evidence, sees, misfit, ready))


def moved(healthy: Matrix) -> Matrix:
    """Return the first three derivatives by the place of a sample of rows that repeat, shape (3, s, N)."""
    N = healthy.shape[1]
    turns = 2j * np.pi * np.fft.rfftfreq(N)
    waves = np.fft.rfft(healthy)
    return np.stack([np.fft.irfft(waves * turns**k, N) for k in (1, 2, 3)])


class StoredPeriod:
    """The healthy strain of a period, to find where in it the load is."""

    def __init__(self, healthy: Matrix) -> None:
        self.N = healthy.shape[1]
        self._strain = ca.DM(healthy - healthy.mean(axis=1, keepdims=True))
        self._columns = np.floor(np.arange(-(-self.N // APART)) * self.N / -(-self.N // APART))

    def begin(self, rate: ca.MX) -> Phase:
        """Return that the phase is not known."""
        zero = ca.MX(0.0)
        return Phase(zero, zero, rate, zero, ca.MX.zeros(self._columns.size))

    def seek(self, x: Phase, strain: ca.MX) -> Phase:
        """Add a sample; after those of a period the likeliest phase is known. An offset of a sensor adds nothing then."""
        at = _within(modulo(x.sought + ca.DM(self._columns), self.N), self.N)
        alike = x.alike + (strain.T @ ca.MX(self._strain)[:, at]).T
        best = ca.mmax(alike)
        first = ca.mmin(ca.if_else(alike >= best, ca.DM(np.arange(self._columns.size)), self.N))
        places = np.concatenate([self._columns[-1:] - self.N, self._columns, self._columns[:1] + self.N])
        around = ca.vertcat(alike[-1], alike, alike[0])
        three = [_within(first + k, places.size) for k in range(3)]
        (a, b, c), (ya, yb, yc) = ([ca.MX(table)[place] for place in three] for table in (ca.DM(places), around))
        left, right = (yb - ya) / (b - a), (yb - yc) / (c - b)  # slopes of a parabola through three
        top = b + 0.5 * (left * (c - b) - right * (b - a)) / ca.fmax(left + right, 1e-300)
        place = x.sought + ca.fmax(ca.fmin(top, c), a)
        nearest = ca.floor(place + 0.5)
        column = modulo(nearest, self.N)
        known = x.sought > self.N - 1.5
        return Phase(
            ca.if_else(known, column, 0.0),
            ca.if_else(known, place - nearest, 0.0),
            x.rate,
            x.sought + 1.0,
            ca.if_else(known, 0.0, alike),
        )


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
        Inputs ``strain[1..s]`` [1] and ``acquire``, which lets the phase of the load be sought anew; outputs ``alarm``,
        which stays, ``evidence[1..z]``, ``sees``, ``misfit`` and ``valid``.

    Raises
    ------
    ParameterError
        The noise or the share makes no sense.

    Notes
    -----
    The score statistics are those of ``Evidence``, of windows of fixed length: of damage of one zone since one, two, four
    and eight windows ago, beside nuisances whose priors the ground states and which all windows teach. A constant offset
    of a sensor in a window does not count. Scores are divided by their mean over the first ten windows, or by the mean
    misfit where that is larger, at least by 1; these windows give no alarm.

    Nor does a shift of the load in a window count: what it says of the phase goes into a loop of second order, with a
    poles at 0.94 and 0.96 a window, which has no lag where the clock drifts steadily. The phase is sought among shifts of
    four samples, by the products of the samples of a period with the healthy strain. Strain between two columns comes from
    three derivatives. Where the loop reaches another column, the next window may be lost.

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
    period, known_at = StoredPeriod(stored.healthy), range(0, 4 * sensors, sensors)
    table = ca.MX(ca.DM(np.vstack([stored.healthy, *moved(stored.healthy), windows.d, windows.D.reshape(-1, N)])))

    def init(_: Values, __: Values) -> tuple[Running, Results]:
        learned = windows.start()
        none = ca.MX.zeros(sensors)
        g = ca.MX.zeros(rows + 1)
        return Running(period.begin(ca.MX(0.0)), ca.MX(1.0), g, none, none, learned), results_of(learned.said)

    like = period.begin(ca.MX(0.0))
    x, strain = ca.MX.sym("x", pack(like).numel()), ca.MX.sym("strain", sensors)
    add = ca.Function("add", [x, strain], [pack(period.seek(unpack(like, x), strain))])
    # by names of their own: two switches that CasADi names itself have the same one
    search = ca.Function.conditional("search", [add], ca.Function("keep", [x, strain], [x]))

    def step(x: Running, u: Values, p: Values, h: ca.MX) -> tuple[Running, Results]:
        steps = h / stored.step
        late = ca.fabs(steps - 1.0) > ON_TIME
        begun = unpack(x.phase, ca.if_else(u.acquire > 0.5, pack(period.begin(x.phase.rate)), pack(x.phase)))
        known = begun.sought > N - 0.5
        column = _within(modulo(begun.column + ca.floor(steps + 0.5), N), N)
        kind = ca.floor(column / n)
        place = column - n * kind
        begins, ends = place < 0.5, ca.logic_and(known, place > n - 1.5)
        broken = ca.if_else(known, ca.if_else(begins, 0.0, ca.fmax(x.broken, late)), 1.0)
        at = table[:, column]
        a, b, c, d = (at[k : k + sensors] for k in known_at)
        f = begun.shift
        r = (u.strain - (a + f * (b + f / 2.0 * (c + f / 3.0 * d)))) / ca.DM(sigma)
        stay = ca.if_else(begins, 0.0, 1.0)
        g = stay * x.g + ca.reshape(at[4 * sensors :], sensors, rows + 1).T @ r
        total, squares = stay * x.total + r, stay * x.squares + r**2
        due = ca.logic_and(ends, broken < 0.5)
        along = g[0] ** 2 / ca.fmax(ca.MX(ca.DM(windows.motions))[kind], NEGLIGIBLE)
        about = ca.sum1(squares - total**2 / n) - along
        judged = pack(windows.judge(x.learned, g[1:], about, kind, f, p.least_evidence))
        learned = unpack(x.learned, ca.conditional(ca.if_else(due, 0, -1), [judged], pack(x.learned), True))
        # late where one begins: the end of the last window; unknown: there is none
        lacks = ca.logic_or(ca.logic_and(ends, broken > 0.5), ca.logic_or(ca.logic_and(begins, late), ca.logic_not(known)))
        said = replace(learned.said, valid=ca.if_else(lacks, 0.0, learned.said.valid))
        learned = replace(learned, said=said)
        off = ca.if_else(due, ca.fmax(ca.fmin(windows.shift(g[0], learned.mean, kind), 1.0), -1.0), 0.0)
        rate = ca.fmax(ca.fmin(begun.rate + DRIFTS * off, FASTEST * n), -FASTEST * n)
        shift = f + ca.if_else(ends, rate + FOLLOWS * off, 0.0)
        slip = ca.if_else(shift > SLIPS, 1.0, 0.0) - ca.if_else(shift < -SLIPS, 1.0, 0.0)
        followed = Phase(modulo(column + slip, N), shift - slip, rate, begun.sought, begun.alike)
        whole = ca.if_else(late, pack(period.begin(begun.rate)), pack(begun))  # from the beginning where one is missing
        phase = unpack(begun, ca.if_else(known, pack(followed), search(ca.if_else(known, -1, 0), whole, u.strain)))
        broken = ca.fmax(broken, ca.fabs(slip))
        return Running(phase, broken, g, total, squares, learned), results_of(said)

    return StepModel.written(
        name="watch",
        description=f"Alarm where damage of one of {windows.z} zones explains {sensors} strains better",
        variables=(
            parameter("least_evidence", "1", "Evidence that raises an alarm", 1.0, 0.1, 1e3),
            *(
                input_(f"strain[{i}]", "1", f"Strain at sensor {i}, prestrain included", 0.0, nominal=0.1)
                for i in range(1, sensors + 1)
            ),
            input_(
                "acquire",
                "1",
                "1 if the phase of the load is not known any more, as after a gap or restore; else 0",
                0.0,
                0.0,
                1.0,
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


def example_inputs(stored: StoredResponses, noise: ArrayLike) -> Matrix:
    """Return inputs, shape (s + 1, samples), with 30 % of damage in the first zone in the last three windows."""
    windows = stored.windows + LEARNING + LAGS[-1]
    n = stored.healthy.shape[1] // stored.windows
    at = np.arange(-1, windows * n) % stored.healthy.shape[1]
    late = np.arange(-1, windows * n) >= (windows - 3) * n
    rough = np.broadcast_to(noise, len(stored.healthy))[:, None] * np.random.default_rng(1).standard_normal(
        (len(stored.healthy), at.size)
    )
    strain = stored.healthy[:, at] + 0.3 * late * stored.slopes[0][:, at] + rough
    return np.vstack([strain, np.zeros(at.size)])

r"""The compensator as a particle filter: hypotheses of the strain, each with a sensor of its own, weighed by the resistance.

Symbols: ``s`` strain [1], ``v`` its rate [1/s], ``w`` weights [1] of ``P`` hypotheses, one per column; ``b`` slow error of
the sensor's output and ``c`` of the direct inverse's strain [1], ``vb``, ``vc`` their variances; ``y`` normalised output
[1], ``h`` step [s].

The output of some sensors moves against the strain, or by a gain: no inverse, but the sensor's own model tells how likely a
strain is. One step reads move, predict, weigh, report, select:

1. Move: the rate of strain wanders, rest stays rest; now and then it turns to any other. A few hypotheses go where the
   direct inverse is; while all are lost, more of them begin anew there.
2. Predict: every hypothesis advances its sensor, ``SensorLaw.advance``. Of one that begins anew the static output takes what
   the measured output tells: its past is one that is consistent with the resistance.
3. Weigh: the output, and the direct inverse's strain if there is one, against what was predicted. A slow error of either is
   estimated per hypothesis by a Kalman filter, so a drift is not taken for strain.
4. Report: mean and deviation of the strain ``DELAY`` samples ago, and of the present one.
5. Select: when few hypotheses carry the weight, they replace the others, by tempered weights.

Random numbers are replaced by sequences of low discrepancy, whose place is in the state: the same record gives the same
strain, bit by bit.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import casadi as ca
import numpy as np

from ..sensor.artifact import DEFAULT_TRACKING, ErrorModel, SensorArtifact, Tracking, default_artifact
from ..sensor.direct import DirectLaw, DirectState
from ..sensor.hysteresis import down
from ..sensor.law import SensorLaw, SensorState
from ..sensor.model import SCALE_VARIABLES, TEMPERATURE, clip, model_of, normalised, resting_state, saturated
from ..step_model import StepModel
from ..variables import Results, Values, input_, output, parameter
from .inverse import LATE_VARIABLES

PARTICLES = 96
DELAY = 24  # [samples]
EXPLORING = 0.15  # share of the hypotheses that turn in every step at least; their weights make up for it
EXPLORING_LOST = 0.4  # of them while all are lost
RESTING = 0.3  # largest share of these turns that end at rest: few hypotheses leave a long hold else
AIMED, ANEW = 0.02, 0.15  # shares that go where the direct inverse is, and that begin anew there while all are lost
RENEWED = 0.3  # weight [1] of a hypothesis that begins anew over that of its parent
TAKEN = 2.0  # [1] most of the output that its static part takes
MISSED, ASTRAY = 3.0, 3.0  # standard deviations by which the output is missed, and by which the direct inverse errs slowly
SOON, LONG = 0.05, 0.7  # hypotheses are lost when LONG of the latest 1/SOON samples are missed, 24 in a row
DISBELIEF, MOST_DISBELIEF = 0.02, 3.0  # price [1] per sample of a slow error of the direct inverse beyond that
TEMPER = 0.75  # power of the weights by which selection keeps hypotheses: turns show what they are worth only samples later
CREEP = 1e-9  # [1/s] rate after a hypothesis has met an end of the range: it wanders on, and does not rest
NEVER = 1e6  # stands for infinity
SMALLEST = 1e-300
WIDEST = 0.46  # of half a turn: the rates after a turn are Cauchy distributed up to 8 times their median
UNKNOWN = 0.3  # [1] deviation of the slow errors before the first sample: records begin with relaxation under way
UNLIKELY = 6.0  # standard deviations by which the best hypothesis may miss before the output counts as out of range
FEW = 0.5  # share of the hypotheses that must carry the weight
LOGISTIC = np.sqrt(3.0) / np.pi  # of a logistic distribution with deviation 1
SHORTEST = 1e-9  # [s]
# additive recurrences, see M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018
GOLDEN, PLASTIC = 0.6180339887498949, (0.7548776662466927, 0.5698402909980532)

VARIABLES = (
    *SCALE_VARIABLES,
    parameter(
        "noise", "ohm", "Standard deviation of the resistance's white noise, beyond the model's own", 0.0, 0.0, nominal=0.1
    ),
    input_("resistance", "ohm", "Measured resistance, one sample per step", 100.0, nominal=100.0),
    TEMPERATURE,
    output("strain", "1", "Estimated strain, delay seconds ago", minimum=0.0, nominal=0.1),
    saturated("1 if no hypothesis of the strain explains the resistance, else 0"),
    *LATE_VARIABLES,
)


@dataclass(frozen=True, slots=True)
class Hypotheses:
    """One hypothesis of the strain per column.

    Attributes
    ----------
    sensor : SensorState
        Memory of the sensor; of ``up`` and ``down`` the sums over the lines.
    v, b, c : casadi.MX, shape (1, P)
        Rate of strain [1/s], slow errors of output and of the direct inverse [1].
    past : casadi.MX, shape (P, M + 1)
        Strain [1] of the latest samples, oldest first, one hypothesis per row: so a shift moves no columns apart.
    """

    sensor: SensorState
    v: ca.MX
    b: ca.MX
    c: ca.MX
    past: ca.MX

    def chosen(self, which: ca.MX) -> Hypotheses:
        """Return the hypotheses with some numbers, shape (1, P), in place of these."""
        sensor = SensorState(*(getattr(self.sensor, each.name)[:, which] for each in fields(SensorState)))
        return Hypotheses(sensor, self.v[:, which], self.b[:, which], self.c[:, which], self.past[which, :])


@dataclass(frozen=True, slots=True)
class FilterState:
    """State of the filter.

    Attributes
    ----------
    hypotheses : Hypotheses
        Hypotheses of the strain.
    w : casadi.MX, shape (1, P)
        Their weights [1].
    vb, vc : casadi.MX, scalar
        Variances of the slow errors [1].
    inverse : DirectState, or casadi.MX without an element
        State of the direct inverse.
    steps : casadi.MX, shape (M,)
        The latest steps [s].
    place : casadi.MX, shape (2,)
        Where the sequences are [1].
    lost : casadi.MX, scalar
        Share of the latest samples [1] that no hypothesis explained, or that the direct inverse contradicted.
    """

    hypotheses: Hypotheses
    w: ca.MX
    vb: ca.MX
    vc: ca.MX
    inverse: DirectState | ca.MX
    steps: ca.MX
    place: ca.MX
    lost: ca.MX


def filter_model(artifact: SensorArtifact | None = None, particles: int = PARTICLES, delay: int = DELAY) -> StepModel:
    """Build the particle filter of the strain for any sensor.

    Parameters
    ----------
    artifact : SensorArtifact or None
        Identified sensor; None for the one that ships with the package.
    particles : int
        Number of hypotheses.
    delay : int
        Delay of the strain [samples].

    Returns
    -------
    StepModel
        Input ``resistance`` [ohm]; outputs ``strain`` [1] with its delay and standard deviation, ``present_strain`` [1] and
        ``saturated`` [1].

    Notes
    -----
    A bootstrap filter [1]_ with stratified turns, whose slow errors are integrated out per hypothesis [2]_, and with
    systematic selection.

    References
    ----------
    .. [1] N. J. Gordon, D. J. Salmond, A. F. M. Smith, IEE Proceedings F 140(2), 107-113, 1993,
       doi:10.1049/ip-f-2.1993.0015.
    .. [2] T. Schoen, F. Gustafsson, P.-J. Nordlund, IEEE Transactions on Signal Processing 53(7), 2279-2289, 2005,
       doi:10.1109/TSP.2005.849151.
    """
    artifact = default_artifact() if artifact is None else artifact
    law = SensorLaw(artifact)
    tracking = artifact.tracking or DEFAULT_TRACKING
    inverse = None if tracking.inverse is None else artifact.inverse
    direct = None if inverse is None else DirectLaw(replace(inverse, ahead=(), later=()))

    def init(_: Values, p: Values) -> tuple[FilterState, Results]:
        rest = resting_state(law, p)
        many = replace(rest, up=ca.sum1(rest.up), down=ca.sum1(rest.down))
        many = SensorState(*(ca.repmat(getattr(many, each.name), 1, particles) for each in fields(SensorState)))
        none = ca.MX.zeros(1, particles)
        hypotheses = Hypotheses(many, none, none, none, ca.repmat(rest.s, particles, delay + 1))
        unknown = ca.MX(UNKNOWN**2)
        strain = rest.s * p.full_scale_strain
        zero = dict.fromkeys(("saturated", "strain_deviation", "delay"), ca.MX(0.0))
        state = FilterState(
            hypotheses,
            ca.MX(ca.DM.ones(1, particles)) / particles,
            unknown,
            unknown,
            ca.MX(0, 1) if direct is None else direct.rest(law.output(rest)),
            ca.MX.zeros(delay),
            ca.MX.zeros(2),
            ca.MX(0.0),
        )
        return state, {"strain": strain, "present_strain": strain, **zero}

    def step(x: FilterState, u: Values, p: Values, h: ca.MX) -> tuple[FilterState, Results]:
        y = normalised(u.resistance, u, p)
        inverse, aim = x.inverse, None
        if direct is not None and isinstance(inverse, DirectState):
            inverse = direct.advance(inverse, y, h)
            aim = direct.present(direct.features(inverse))[0]
        place = _fraction(x.place + ca.DM(PLASTIC))
        # move and predict
        s, v, factor, new = _move(x.hypotheses, tracking, aim, place, x.lost > LONG, h)
        sensor = law.advance(x.hypotheses.sensor, s, h)
        sensor, predicted = _anew(law, x.hypotheses.sensor, sensor, new, y, h)
        sensor = replace(sensor, up=ca.sum1(sensor.up), down=ca.sum1(sensor.down))
        # weigh
        noise = (p.noise / p.full_scale_resistance_change) ** 2
        b, vb, miss, log_w = _weigh(x.hypotheses.b, x.vb, y - predicted, new, tracking.output, tracking.tail, noise, h)
        c, vc = x.hypotheses.c, x.vc
        if aim is not None and tracking.inverse is not None:
            # it has grown in steps that each were likely
            beyond = ca.fmax((c / tracking.inverse.slow) ** 2 - ASTRAY**2, 0.0)
            log_w = log_w - ca.if_else(new, 0.0, ca.fmin(DISBELIEF * beyond, MOST_DISBELIEF))
            c, vc, _, more = _weigh(c, vc, aim - s, new, tracking.inverse, tracking.tail, ca.MX(0.0), h)
            log_w = log_w + more
        w = x.w * factor * ca.exp(log_w - ca.mmax(log_w))
        w = w / ca.sum2(w)
        astray = miss > MISSED
        if aim is not None and tracking.inverse is not None:
            astray = ca.logic_or(astray, ca.fabs(ca.dot(w, c)) > ASTRAY * tracking.inverse.slow)
        lost = x.lost + SOON * (astray - x.lost)
        # report
        past = ca.horzcat(x.hypotheses.past[:, 1:], s.T)
        steps = ca.vertcat(x.steps[1:], h)
        then, now = ca.dot(w.T, past[:, 0]), ca.dot(w, s)
        variance = ca.dot(w.T, (past[:, 0] - then) ** 2)
        deviation = ca.sqrt(tracking.factor**2 * variance + tracking.floor**2)
        # select
        hypotheses = Hypotheses(sensor, v, b, c, past)
        tempered = w**TEMPER
        tempered = tempered / ca.sum2(tempered)
        few = ca.sumsqr(tempered) * particles > 1.0 / FEW
        which = ca.if_else(few, _survivors(tempered), ca.DM(np.arange(particles)).T)
        hypotheses = hypotheses.chosen(which)
        kept = (w / ca.fmax(tempered, SMALLEST))[which.T].T
        w = ca.if_else(few, kept / ca.sum2(kept), w)
        return FilterState(hypotheses, w, vb, vc, inverse, steps, place, lost), {
            "strain": then * p.full_scale_strain,
            "saturated": miss > UNLIKELY,
            "present_strain": now * p.full_scale_strain,
            "strain_deviation": deviation * p.full_scale_strain,
            "delay": ca.sum1(steps),
        }

    what = "Particle filter of strain from the resistance of any sensor"
    return model_of(artifact, "compensator", what, VARIABLES, init, step, quiet=True)


def _move(
    old: Hypotheses, tracking: Tracking, aim: ca.MX | None, place: ca.MX, lost: ca.MX, h: ca.MX
) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
    """Return strain [1] and rate [1/s] of every hypothesis after a step, factors of their weights [1], and who begins anew.

    One at rest stays there exactly until it turns.
    """
    P = old.v.shape[1]
    first, second = (
        _fraction(ca.DM(np.arange(P) * ratio % 1.0).T + place[k]) for k, ratio in enumerate((GOLDEN, PLASTIC[0]))
    )
    turns = 1.0 - ca.exp(-tracking.turns * h)
    tried = ca.fmax(turns, EXPLORING + (EXPLORING_LOST - EXPLORING) * lost)
    turn = first < tried
    resting = min(tracking.hold, RESTING)
    moving = (second - resting) / (1.0 - resting)
    other = tracking.rate * ca.tan(WIDEST * np.pi * (2.0 * ca.fmax(moving, 0.0) - 1.0))
    other = ca.if_else(moving < 0.0, 0.0, other)
    likely = ca.if_else(moving < 0.0, tracking.hold / max(resting, SMALLEST), (1.0 - tracking.hold) / (1.0 - resting))
    inside = ca.fmin(ca.fmax(second, 1e-3), 1.0 - 1e-3)
    wandering = old.v + tracking.wander * ca.sqrt(h) * LOGISTIC * ca.log(inside / (1.0 - inside))
    v = ca.if_else(turn, other, ca.if_else(old.v == 0.0, 0.0, wandering))
    factor = ca.if_else(turn, turns / tried * likely, (1.0 - turns) / (1.0 - tried))
    s, new = old.sensor.s + v * h, ca.MX(ca.DM.zeros(1, P))
    if aim is not None:
        new = first > 1.0 - ANEW * lost
        s = ca.if_else(ca.logic_or(first < AIMED, new), aim, s)
        factor = ca.if_else(new, RENEWED, factor)
    ended = ca.logic_or(s < 0.0, s > 1.0)
    return clip(s), ca.if_else(ended, CREEP * (v != 0.0), v), factor, new


def _anew(
    law: SensorLaw, before: SensorState, after: SensorState, new: ca.MX, y: ca.MX, h: ca.MX
) -> tuple[SensorState, ca.MX]:
    """Return the sensors after a step, and the output [1] that they predict.

    A jump of a hypothesis that begins anew excites no relaxation, and its static output, whose past it does not know, takes
    what the measured output ``y`` [1] tells, up to ``TAKEN``: a broken wire is not explained by it.
    """
    held = law.hold(before, h)
    z, g = ca.if_else(down(new, after.z), held.z, after.z), ca.if_else(down(new, after.g), held.g, after.g)
    sensor = replace(after, z=z, g=g)
    predicted = law.output(sensor)
    shift = ca.if_else(new, ca.fmax(ca.fmin(y - predicted, TAKEN), -TAKEN), 0.0)
    return replace(sensor, f=sensor.f + shift), predicted + shift


def _weigh(
    mean: ca.MX, variance: ca.MX, error: ca.MX, new: ca.MX, model: ErrorModel, tail: float, noise: ca.MX, h: ca.MX
) -> tuple[ca.MX, ca.MX, ca.MX, ca.MX]:
    """Weigh errors [1], shape (1, P), by their model, and update the slow parts in them.

    Those of hypotheses that begin anew are not known yet, and these weigh no more than the best of the others.

    Returns
    -------
    mean, variance : casadi.MX, shape (1, P) and scalar
        Slow parts [1] after the sample.
    miss : casadi.MX, scalar
        Least error in standard deviations [1] of hypotheses that do not begin anew.
    log_w : casadi.MX, shape (1, P)
        Logarithms of the likelihoods [1].
    """
    left = ca.exp(-h / model.time)
    mean, variance = left * mean, left**2 * variance + (1.0 - left**2) * model.slow**2
    mean, own = ca.if_else(new, 0.0, mean), ca.if_else(new, model.slow**2, variance)
    white = model.white**2 + noise
    surprise = error - mean
    squares = surprise**2 / (own + white)
    least = ca.mmin(ca.if_else(new, NEVER, squares))
    # a sample that no hypothesis explains is a fault, and tells nothing of the slow part
    trusted = ca.fmin((tail + 1.0) / (tail + least), 1.0)
    log_w = -0.5 * (tail + 1.0) * ca.log1p(squares / tail) - 0.5 * ca.log(own + white)
    best = ca.mmax(ca.if_else(new, -NEVER, log_w))
    log_w = ca.if_else(new, ca.fmin(log_w, best), log_w)
    variance_left = (1.0 - trusted * variance / (variance + white)) * variance
    return mean + own / (own + white) * trusted * surprise, variance_left, ca.sqrt(least), log_w


def _survivors(w: ca.MX) -> ca.MX:
    """Return the columns that systematic selection keeps, shape (1, P), from weights of sum 1."""
    P = w.shape[1]
    below = ca.vertcat(0.0, ca.cumsum(w.T))
    return ca.low(below, ca.DM((np.arange(P) + 0.5) / P), {"lookup_mode": "binary"}).T


def _fraction(x: ca.MX) -> ca.MX:
    return x - ca.floor(x)

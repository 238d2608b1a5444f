r"""The compensator as an estimator: fixed-lag smoothing, memory that commits late, an observer of the drift.

Symbols: ``T`` target, output that the memory does not explain [1]; ``d`` +1 or -1, the direction of motion; ``turn`` and
``turn_variance`` where the present leg has got to, counted from the memory [1]; ``e`` drift, error of the strain [1];
``theta`` relative correction of ``nu``, and so of eta [1]; ``ee, et, tt`` their covariances; ``v`` variance of the smoothed
output [1].

The exact inverse takes noise for motion: every small reversal wipes memory and loses (1 - eta) of itself. Here nothing
is written to memory that may have to be taken back:

1. The last 2 M + 1 resistances are smoothed (``smooth.py``); what follows speaks of the middle, M samples ago.
2. While strain runs on, memory follows at a distance of several standard deviations. The strain itself is found by the
   exact inverse from there, so it does not lag.
3. Once the output has come back by more than noise explains, the turning point is written, at its own best estimate.
4. A Kalman filter keeps the error that this leaves: turning points add to ``e``, an error of eta adds in proportion to
   what switches down. It learns where strain is known: told so, or at the end of its range.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

import casadi as ca

from ..errors import ParameterError
from ..sensor.artifact import SensorArtifact, default_artifact
from ..sensor.model import ADVICE, SCALE_VARIABLES, resting_state, saturated, with_scales
from ..sensor.relaxation import decay
from ..sensor.state import SensorLaw, SensorState
from ..step_model import StepModel
from ..variables import Variable
from .inverse import invert
from .smooth import smooth

HALF_WIDTHS = (3, 8, 24)  # [samples] of the windows; the largest is the delay
AHEAD, BACK = 3.0, 4.0  # standard deviations that tell motion from noise, onward and backward
TREND = 2.5  # the same for the slope
LAST_TURN = 0.5  # of the variance of the last turning point shows until the loop from there closes
ROUNDING = 0.3  # standard deviations of the noise that a sharp turning point loses if it looks round
FORGOTTEN = 0.25  # of an error stays in the remembered turning points when the strain is set right
LEAST_DOUBT = 0.1  # of the doubt about eta stays, whatever was learned
REACH = 0.02  # [1] standard deviation of strain about the end of its range where the model says it is beyond
MOST_DRIFT = 0.3  # [1]; an output further beyond what any strain explains is a broken wire or a meter, never drift
PATIENCE = 32.0  # a resistance out of reach is believed after about PATIENCE**2 / BACK**2 samples
SHORTEST = 1e-9  # [s] stands for the steps before the run, [1] for a movement of nothing

VARIABLES = (
    Variable(
        name="noise",
        causality="parameter",
        unit="ohm",
        description="Standard deviation of the measured resistance's white noise; 0 lets every sample pass",
        start=0.1,
        minimum=0.0,
        nominal=0.1,
    ),
    Variable(
        name="eta_deviation",
        causality="parameter",
        unit="1",
        description="Standard deviation of the relative error of the artifact's eta; 0 trusts it",
        start=0.01,
        minimum=0.0,
        nominal=0.01,
    ),
    Variable(
        name="resistance",
        causality="input",
        unit="ohm",
        description="Measured resistance, one sample per step",
        start=100.0,
        nominal=100.0,
    ),
    Variable(
        name="known",
        causality="input",
        unit="1",
        description="1 if the strain is known now, so that the drift is set back, else 0",
        start=0.0,
        minimum=0.0,
        maximum=1.0,
        discrete=True,
    ),
    Variable(
        name="known_strain",
        causality="input",
        unit="1",
        description="Strain now; read while known is 1",
        start=0.0,
        minimum=0.0,
        nominal=0.1,
    ),
    Variable(
        name="strain",
        causality="output",
        unit="1",
        description="Estimated strain, delay seconds ago",
        minimum=0.0,
        nominal=0.1,
    ),
    saturated(
        description="1 if no strain from 0 to full scale explains the resistance, nor its noise, nor drift; else 0"
    ),
    Variable(
        name="present_strain",
        causality="output",
        unit="1",
        description="Estimated strain now: without delay, less accurate",
        minimum=0.0,
        nominal=0.1,
    ),
    Variable(
        name="strain_deviation",
        causality="output",
        unit="1",
        description="Standard deviation of the error of strain",
        minimum=0.0,
        nominal=0.001,
    ),
    Variable(
        name="delay",
        causality="output",
        unit="s",
        description="By how much strain lags behind the resistance",
        minimum=0.0,
        nominal=1.0,
    ),
    Variable(
        name="eta_correction",
        causality="output",
        unit="1",
        description="Relative correction of the artifact's eta, learned where strain was known or out of range",
        nominal=0.01,
    ),
)


@dataclass(frozen=True, slots=True)
class Drift:
    """Gaussian belief about the error of strain and the error of eta.

    Attributes
    ----------
    theta : casadi.MX, scalar
        Correction of ``nu`` in use, relative [1].
    ee, et, tt : casadi.MX, scalar
        Covariances of the errors of strain and of ``theta`` [1].
    rounding : casadi.MX, scalar
        Error of strain [1] if every turning point that was not seen to be sharp was one; it grows with their number.
    """

    theta: ca.MX
    ee: ca.MX
    et: ca.MX
    tt: ca.MX
    rounding: ca.MX

    def fall(self, drop: ca.MX) -> Drift:
        """Let ``drop`` [1] of output switch down: an error of eta becomes an error of strain."""
        ee = self.ee + 2.0 * drop * self.et + drop**2 * self.tt
        return Drift(self.theta, ee, self.et + drop * self.tt, self.tt, self.rounding)

    def learn(self, error: ca.MX, variance: ca.MX, weight: ca.MX, least: ca.MX) -> Drift:
        """Take in an error of strain [1] with a weight of 0..1; the strain is corrected elsewhere."""
        gain = weight / (self.ee + variance)
        left = 1.0 - gain * self.ee
        theta = self.theta + self.et * error * (weight > 0.0) / (self.ee + variance)
        return Drift(
            theta,
            left * self.ee,
            left * self.et,
            ca.fmax(self.tt - gain * self.et**2, least),
            (1.0 - weight) * self.rounding,
        )

    @property
    def variance(self) -> ca.MX:
        """Variance of the error of strain [1]."""
        return self.ee + self.rounding**2

    def pack(self) -> ca.MX:
        """Return the belief as one column, shape (5,)."""
        return ca.vertcat(self.theta, self.ee, self.et, self.tt, self.rounding)


def estimator_model(artifact: SensorArtifact | None = None, half_widths: tuple[int, ...] = HALF_WIDTHS) -> StepModel:
    r"""Build the estimator of strain for a sensor with noise and an artifact that is not quite right.

    Parameters
    ----------
    artifact : SensorArtifact or None
        Identified sensor; None for the one that ships with the package.
    half_widths : tuple of int
        Half widths [samples] of the smoothing windows, increasing, 3 or more; the largest is the delay.

    Returns
    -------
    StepModel
        Inputs ``resistance`` [ohm], ``known`` [1] and ``known_strain`` [1]; outputs ``strain`` [1] with its delay and
        standard deviation, ``present_strain`` [1] and others.

    Raises
    ------
    ParameterError
        The half widths are not such, or the output of the sensor may move against the strain.

    Notes
    -----
    ``known`` = 1 says that the strain is ``known_strain`` now. It acts when that sample reaches the middle of the window:
    the memory goes there, the output is set to what was measured, and the error found corrects eta in proportion to the
    covariances. One unit of normalised output counts as one unit of normalised strain in the belief about the drift,
    which is the mean slope of any sensor. Strain found beyond the end of its range is drift as well, if it is no more
    than the belief allows and less than ``MOST_DRIFT``; otherwise it is a fault, ``saturated`` is 1 and memory stands still.

    Without noise every window but the sample itself is rejected, and the strain is that of the exact inverse, delayed;
    relaxation of what rises in the first step after a turning point is timed one step late.
    """
    artifact = default_artifact() if artifact is None else artifact
    if not artifact.exactly_invertible:
        msg = (
            "the output of this sensor may move against the strain or has a gain, which the estimator cannot follow. Build "
            "the compensator with the method inverse, or identify the sensor with --extension falling or none."
        )
        raise ParameterError(msg)
    if artifact.inverse is not None:
        msg = (
            "this sensor brings a direct inverse, which the estimator does not use. Build the compensator with the "
            "method inverse, or identify the sensor without --direct-inverse."
        )
        raise ParameterError(msg)
    if not half_widths or half_widths[0] < 3 or any(a >= b for a, b in pairwise(half_widths)):
        msg = f"half widths of the windows are increasing and 3 samples or more, not {half_widths}"
        raise ParameterError(msg)
    law = SensorLaw(artifact)
    M = half_widths[-1]
    sizes = (law.n_states, 2 * M + 1, M + 1, M + 1, M + 1, 5, 5)
    x, h = ca.MX.sym("x", sum(sizes)), ca.MX.sym("h")
    u, p = ca.MX.sym("u", 3), ca.MX.sym("p", len(SCALE_VARIABLES) + 2)
    R0, dR, full_scale, rest_strain, noise, eta_deviation = ca.vertsplit(p)

    rest = resting_state(law, rest_strain, full_scale)
    x0 = ca.vertcat(
        rest.pack(),
        ca.repmat(rest.f, 2 * M + 1),
        ca.DM.zeros(3 * (M + 1)),
        ca.vertcat(1.0, 0.0, 0.0, 0.0, 0.0),
        Drift(ca.MX(0.0), ca.MX(0.0), ca.MX(0.0), eta_deviation**2, ca.MX(0.0)).pack(),
    )
    y0 = ca.vertcat(rest.s * full_scale, 0.0, rest.s * full_scale, 0.0, 0.0, 0.0)
    init = ca.Function("init", [u, p], [x0, y0])

    parts = [x[a:b] for a, b in pairwise(accumulate(sizes, initial=0))]
    state, drift = law.unpack(parts[0]), Drift(*ca.vertsplit(parts[6]))
    d, turn, turn_variance, last_variance, fresh = ca.vertsplit(parts[5])
    new = ((u[0] - R0) / dR, h, u[1], u[2] / full_scale)
    buffers = [ca.vertcat(part[1:], value) for part, value in zip(parts[1:5], new, strict=True)]
    output, steps, known, known_strain = buffers
    known, known_strain = known[0] > 0.5, known_strain[0]
    h_middle, delay = ca.fmax(steps[0], SHORTEST), ca.fmax(ca.sum1(steps[1:]), SHORTEST)
    sigma = noise / dR
    middle, present = (smooth(output, sigma, half_widths, place) for place in (M, 2 * M))
    v = middle.variance

    # where the leg has got to: it runs on, rests, or has turned
    before = state.f + ca.sum1(decay(law.bank, state.z, h_middle))
    T, T_turn = middle.value - before, middle.turn - before
    width = ca.sqrt(v + turn_variance)
    turned = (T - turn) * d < -BACK * width
    onward = (T_turn - turn) * d > 0.0
    moving = ca.logic_or(middle.trend * d > TREND, (T - turn) * d > AHEAD * width)
    fresh = ca.logic_or(moving, ca.logic_and(fresh, onward))
    resting = ca.logic_and(ca.fabs(middle.trend) < TREND, ca.logic_not(fresh))
    gain = ca.if_else(resting, turn_variance / (turn_variance + M * v), 0.0)  # errors last for about M samples
    followed = ca.if_else(fresh, T_turn, turn + gain * (T - turn))
    turn = ca.if_else(turned, turn + d * ca.fmax((T_turn - turn) * d, 0.0), followed)
    turn_variance = ca.if_else(fresh, v, (1.0 - gain) * turn_variance)

    # memory follows at a distance, up to the turning point itself once that is known
    certain = ca.if_else(turned, turn, d * ca.fmax(turn * d - BACK * width, 0.0))
    certain = ca.if_else(known, T, certain)
    reached, outside = _invert(law, state, certain, drift, h_middle)
    moved, drop = _advance(law, state, ca.if_else(known, known_strain, reached), drift, h_middle)
    left = before + certain - moved.output()
    believed = ca.logic_and(left**2 < BACK**2 * (drift.ee + v), ca.fabs(left) < MOST_DRIFT)
    beyond = ca.logic_and(outside, ca.logic_not(known))
    refused = ca.logic_and(beyond, ca.logic_not(believed))
    drop = ca.if_else(refused, 0.0, drop)
    shift = ca.if_else(ca.logic_or(known, ca.logic_and(beyond, believed)), left, 0.0)
    still = replace(state, z=decay(law.bank, state.z, h_middle))
    state = _choose(refused, still, replace(moved, f=moved.f + shift))

    # what is not known: turning points and eta add to it, a known strain or the end of the range takes from it
    lost = abs(1.0 - law.nu.sum() / law.mu.sum())  # of what a turning point is too high or too low
    drift = drift.fall(drop)
    drift = replace(
        drift,
        ee=drift.ee
        + ca.if_else(turned, lost**2 * turn_variance, 0.0)
        + ca.if_else(refused, (left / PATIENCE) ** 2, 0.0),
        rounding=drift.rounding + ca.if_else(turned, lost * ROUNDING * sigma * (1.0 - middle.sharp), 0.0),
    )
    error = ca.if_else(known, known_strain - reached, -shift)
    doubt = ca.if_else(known, (FORGOTTEN * error) ** 2, REACH**2)
    weight = ca.if_else(known, 1.0, ca.fmin(ca.fabs(shift) / REACH, 1.0))
    drift = drift.learn(error, v + doubt, weight, (LEAST_DOUBT * eta_deviation) ** 2)

    T = middle.value - state.output()
    restart = ca.logic_or(turned, known)
    turn = ca.if_else(restart, T, turn - (state.output() - before))
    last_variance = ca.if_else(turned, turn_variance, last_variance)
    turn_variance = ca.if_else(restart, v, turn_variance)
    d = ca.if_else(turned, -d, d)
    s, _ = _invert(law, state, T, drift, h_middle)
    after = present.value - state.f - ca.sum1(decay(law.bank, state.z, delay))
    s_present, _ = _invert(law, state, after, drift, delay)
    floor = ca.sqrt(v) + SHORTEST
    slope = (ca.fabs(T) + floor) / (ca.fabs(s - state.s) + floor)
    deviation = ca.sqrt(v / slope**2 + LAST_TURN * last_variance + drift.variance)

    x_next = ca.vertcat(state.pack(), *buffers, d, turn, turn_variance, last_variance, fresh, drift.pack())
    y = ca.vertcat(
        ca.vertcat(s * full_scale, refused, s_present * full_scale, deviation * full_scale), delay, drift.theta
    )
    step = ca.Function("step", [x, u, p, h], [x_next, y])
    return StepModel(
        name="compensator",
        description="Estimator of strain from the resistance of a hysteretic sensor",
        variables=with_scales((*SCALE_VARIABLES, *VARIABLES), artifact),
        init=init,
        step=step,
        advice=ADVICE,
        provenance=dict(artifact.provenance),
    )


def _invert(law: SensorLaw, state: SensorState, target: ca.MX, drift: Drift, h: ca.MX) -> tuple[ca.MX, ca.MX]:
    """Invert one step with the corrected ``nu``."""
    return invert(law, state, ca.if_else(target < 0.0, target / (1.0 + drift.theta), target), h)


def _advance(law: SensorLaw, state: SensorState, s: ca.MX, drift: Drift, h: ca.MX) -> tuple[SensorState, ca.MX]:
    """Advance the memory with the corrected ``nu``; return what has switched down, too [1]."""
    moved = law.advance(state, s, h)
    drop = ca.fmax(state.f - moved.f, 0.0)
    return replace(moved, f=moved.f - drift.theta * drop), drop


def _choose(condition: ca.MX, yes: SensorState, no: SensorState) -> SensorState:
    pairs = ((getattr(yes, name), getattr(no, name)) for name in SensorState.__slots__)
    return SensorState(*(ca.if_else(condition, *pair) for pair in pairs))

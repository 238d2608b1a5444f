r"""The compensator as an estimator: fixed-lag smoothing, memory that commits late, a Kalman filter of the drift.

Symbols: ``T`` target, output that the memory does not explain [1]; ``v`` variance of the smoothed output [1]; ``theta``
relative correction of ``nu``, and so of eta [1]; ``h`` step [s]; ``M`` delay [samples].

The exact inverse takes noise for motion: every small reversal wipes memory and loses (1 - eta) of itself. The estimator
writes nothing to memory that it may have to take back. One step reads smooth, follow, commit, learn:

1. Smooth the last 2 M + 1 resistances (``estimation.py``). What follows concerns the middle one, M samples ago.
2. Follow the leg, the motion since the last turning point, until the output comes back by more than noise (the leg).
3. Commit to memory what is certain: while strain runs on, all but several standard deviations; after a turning point, its
   best estimate. The exact inverse gives the strain from there, so the strain does not lag further.
4. Learn the error that remains (the drift): turning points add to it, an error of eta adds in proportion to what
   switches down. A known strain and the end of the range reveal it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import casadi as ca

from ..errors import ParameterError
from ..sensor.artifact import SensorArtifact, default_artifact
from ..sensor.law import SensorLaw, SensorState
from ..sensor.model import SCALE_VARIABLES, TEMPERATURE, model_of, normalised, resting_state, saturated
from ..step_model import StepModel
from ..variables import Results, Values, input_, output, parameter, select
from .ageing import KNOWN
from .estimation import BACK, Drift, Leg, Smoothed, smooth
from .inverse import LATE_VARIABLES, TAKE_THE_FILTER, invert

HALF_WIDTHS = (3, 8, 24)  # [samples] of the windows; the largest is the delay
LAST_TURN = 0.5  # share of the variance of the last turning point that the strain shows until its loop closes
ROUNDING = 0.3  # standard deviations of the noise that a sharp turning point loses if it looks round
FORGOTTEN = 0.25  # share of an error that stays in the remembered turning points when a known strain corrects it
LEAST_DOUBT = 0.1  # share of eta_deviation that stays, whatever was learned
REACH = 0.02  # [1] standard deviation of strain about the end of its range where the model says it is beyond
MOST_DRIFT = 0.3  # [1]; an output further beyond what any strain explains is a broken wire or a meter, never drift
PATIENCE = 32.0  # a resistance out of reach is accepted as drift after about PATIENCE**2 / BACK**2 samples
SHORTEST = 1e-9  # [s] stands for the steps before the run, [1] for a movement of nothing

VARIABLES = (
    *SCALE_VARIABLES,
    parameter("noise", "ohm", "Standard deviation of the resistance's white noise; 0 = no smoothing", 0.1, 0.0, nominal=0.1),
    parameter("eta_deviation", "1", "Standard deviation of the relative error of eta; 0 trusts it", 0.01, 0.0, nominal=0.01),
    input_("resistance", "ohm", "Measured resistance, one sample per step", 100.0, nominal=100.0),
    TEMPERATURE,
    *KNOWN,
    output("strain", "1", "Estimated strain, delay seconds ago", minimum=0.0, nominal=0.1),
    saturated("1 if neither a strain from 0 to full scale nor noise nor drift explains the resistance, else 0"),
    *LATE_VARIABLES,
    output("eta_correction", "1", "Relative correction of eta, learned from known and out-of-range strain", nominal=0.01),
)


@dataclass(frozen=True, slots=True)
class Buffer:
    """The latest samples, oldest first.

    Attributes
    ----------
    output : casadi.MX, shape (2 M + 1,)
        Normalised output [1].
    h, known, strain : casadi.MX, shape (M + 1,)
        Step [s], whether the strain is known, and the known strain [1], from the middle of the window on.
    """

    output: ca.MX
    h: ca.MX
    known: ca.MX
    strain: ca.MX

    def push(self, *newest: ca.MX) -> Buffer:
        """Return the columns without their oldest sample and with the newest."""
        columns = (self.output, self.h, self.known, self.strain)
        return Buffer(*(ca.vertcat(column[1:], new) for column, new in zip(columns, newest, strict=True)))


@dataclass(frozen=True, slots=True)
class MiddleSample:
    """The sample at the middle of the window.

    Attributes
    ----------
    output : Smoothed
        Normalised output [1].
    h, known, strain : casadi.MX, scalar
        Step [s], whether the strain is known, and the known strain [1].
    """

    output: Smoothed
    h: ca.MX
    known: ca.MX
    strain: ca.MX


@dataclass(frozen=True, slots=True)
class EstimatorState:
    """State of the estimator.

    Attributes
    ----------
    sensor : SensorState
        Committed memory, at the middle of the window.
    buffer : Buffer
        Samples of the window.
    leg : Leg
        Motion since the last turning point.
    drift : Drift
        Errors of the strain and of eta.
    """

    sensor: SensorState
    buffer: Buffer
    leg: Leg
    drift: Drift


@dataclass(frozen=True, slots=True)
class Commit:
    """Result of a commit to memory.

    Attributes
    ----------
    sensor : SensorState
        Memory after it.
    refused : casadi.MX, scalar
        1 where neither strain nor noise nor drift explains the output, so that memory stood still.
    drop : casadi.MX, scalar
        Output that switched down [1].
    residual : casadi.MX, scalar
        Output that no strain explains [1].
    shift : casadi.MX, scalar
        Part of it that the memory accepted as drift [1].
    error : casadi.MX, scalar
        Error of strain that this shows [1]; read where the strain is known or ``shift`` is not zero.
    """

    sensor: SensorState
    refused: ca.MX
    drop: ca.MX
    residual: ca.MX
    shift: ca.MX
    error: ca.MX


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
        The half widths are not such, the output of the sensor may move against the strain, or it has a direct inverse.

    Notes
    -----
    ``known`` = 1 says that the strain is ``known_strain`` now. It acts when that sample reaches the middle of the window:
    the memory goes there, the output is set to the measured one, and the error that this shows corrects eta in proportion
    to the covariances. One unit of normalised output counts as one unit of normalised strain in the estimate of the drift,
    which is the mean slope of any sensor. Strain beyond the end of its range is drift as well, if it is no more than
    that estimate allows and less than ``MOST_DRIFT``; otherwise it is a fault, ``saturated`` is 1 and memory stands
    still.

    Without noise every window but the sample itself is rejected, and the strain is that of the exact inverse, delayed;
    relaxation of what rises in the first step after a turning point is timed one step late.
    """
    artifact = default_artifact() if artifact is None else artifact
    if not artifact.exactly_invertible:
        msg = (
            "the output of this sensor may move against the strain, has a gain or a residual network, which the estimator "
            f"cannot follow. {TAKE_THE_FILTER}"
        )
        raise ParameterError(msg)
    if artifact.inverse is not None:
        msg = f"this sensor has a direct inverse, which the estimator does not use. {TAKE_THE_FILTER}"
        raise ParameterError(msg)
    if not half_widths or half_widths[0] < 3 or any(a >= b for a, b in pairwise(half_widths)):
        msg = f"half widths of the windows must increase and be 3 samples or more, not {half_widths}"
        raise ParameterError(msg)
    law, M = SensorLaw(artifact), half_widths[-1]
    lost = abs(1.0 - law.nu.sum() / law.mu.sum())  # share of an error of a turning point that stays in the strain

    def init(_: Values, p: Values) -> tuple[EstimatorState, Results]:
        rest, zero = resting_state(law, p), ca.MX(0.0)
        buffer = Buffer(ca.repmat(rest.f, 2 * M + 1), *3 * [ca.MX.zeros(M + 1)])
        leg = Leg(ca.MX(1.0), zero, zero, zero, zero)
        strain = rest.s * p.full_scale_strain
        results = {"strain": strain, "present_strain": strain}
        results |= dict.fromkeys(("saturated", "strain_deviation", "delay", "eta_correction"), zero)
        return EstimatorState(rest, buffer, leg, Drift(zero, zero, zero, p.eta_deviation**2, zero)), results

    def step(x: EstimatorState, u: Values, p: Values, h: ca.MX) -> tuple[EstimatorState, Results]:
        # smooth
        sigma = p.noise / p.full_scale_resistance_change
        buffer = x.buffer.push(normalised(u.resistance, u, p), h, u.known, u.known_strain / p.full_scale_strain)
        middle, present = (smooth(buffer.output, sigma, half_widths, place) for place in (M, 2 * M))
        now = MiddleSample(middle, ca.fmax(buffer.h[0], SHORTEST), buffer.known[0] > 0.5, buffer.strain[0])
        # follow
        held = law.hold(x.sensor, now.h).output()
        leg, turned, certain = x.leg.follow(middle, held, M)
        # commit
        commit = _commit(law, x.sensor, x.drift, now, ca.if_else(now.known, middle.value - held, certain))
        sensor = commit.sensor
        # learn
        turning = ca.if_else(turned, lost**2 * leg.variance, 0.0)
        rounding = ca.if_else(turned, lost * ROUNDING * sigma * (1.0 - middle.sharp), 0.0)
        drift = _learn(x.drift.add(turning, rounding), now, commit, (LEAST_DOUBT * p.eta_deviation) ** 2)

        T, v = middle.value - sensor.output(), middle.variance
        leg = leg.recount(turned, now.known, T, v, moved=sensor.output() - held)
        s, _ = _invert(law, sensor, T, drift, now.h)
        delay = ca.fmax(ca.sum1(buffer.h[1:]), SHORTEST)
        s_present, _ = _invert(law, sensor, present.value - law.hold(sensor, delay).output(), drift, delay)
        floor = ca.sqrt(v) + SHORTEST
        slope = (ca.fabs(T) + floor) / (ca.fabs(s - sensor.s) + floor)
        deviation = ca.sqrt(v / slope**2 + LAST_TURN * leg.start_variance + drift.variance)
        return EstimatorState(sensor, buffer, leg, drift), {
            "strain": s * p.full_scale_strain,
            "saturated": commit.refused,
            "present_strain": s_present * p.full_scale_strain,
            "strain_deviation": deviation * p.full_scale_strain,
            "delay": delay,
            "eta_correction": drift.theta,
        }

    what = "Estimator of strain from the resistance of a hysteretic sensor"
    return model_of(artifact, "compensator", what, VARIABLES, init, step)


def _commit(law: SensorLaw, sensor: SensorState, drift: Drift, now: MiddleSample, change: ca.MX) -> Commit:
    """Move the memory to the strain that explains a change of output [1], or to the known strain."""
    held = law.hold(sensor, now.h)
    reached, outside = _invert(law, sensor, change, drift, now.h)
    moved = law.advance(sensor, ca.if_else(now.known, now.strain, reached), now.h)
    drop = ca.fmax(sensor.f - moved.f, 0.0)
    moved = replace(moved, f=moved.f - drift.theta * drop)
    residual = held.output() + change - moved.output()
    explained = ca.logic_and(residual**2 < BACK**2 * (drift.ee + now.output.variance), ca.fabs(residual) < MOST_DRIFT)
    beyond = ca.logic_and(outside, ca.logic_not(now.known))
    refused = ca.logic_and(beyond, ca.logic_not(explained))
    shift = ca.if_else(ca.logic_or(now.known, ca.logic_and(beyond, explained)), residual, 0.0)
    return Commit(
        sensor=select(refused, held, replace(moved, f=moved.f + shift)),
        refused=refused,
        drop=ca.if_else(refused, 0.0, drop),
        residual=residual,
        shift=shift,
        error=ca.if_else(now.known, now.strain - reached, -shift),
    )


def _learn(drift: Drift, now: MiddleSample, commit: Commit, least: ca.MX) -> Drift:
    """Update the drift with a commit; ``least`` is the variance of ``theta`` [1] that always remains."""
    fault = ca.if_else(commit.refused, (commit.residual / PATIENCE) ** 2, 0.0)
    doubt = ca.if_else(now.known, (FORGOTTEN * commit.error) ** 2, REACH**2)
    weight = ca.if_else(now.known, 1.0, ca.fmin(ca.fabs(commit.shift) / REACH, 1.0))
    drift = drift.fall(commit.drop).add(fault, 0.0)
    return drift.learn(commit.error, now.output.variance + doubt, weight, least)


def _invert(law: SensorLaw, state: SensorState, target: ca.MX, drift: Drift, h: ca.MX) -> tuple[ca.MX, ca.MX]:
    """Invert one step with the corrected ``nu``."""
    return invert(law, state, ca.if_else(target < 0.0, target / (1.0 + drift.theta), target), h)

r"""Ageing around any compensator: slow gain and offset of its sensor, followed wherever the strain is known.

Symbols: ``y`` normalised output as measured [1], ``m`` that of the sensor's model [1]; ``g`` gain and ``o`` offset [1],
``P`` their covariance [1], ``q`` what their variances grow by [1/s], ``r`` variance of ``y`` about an aged model [1]; ``h``
step [s].

An aged sensor reads :math:`y = g\,m + o`. A compensator is given the resistance of the sensor as it was, of the output
:math:`(y - o)/g`. A sensor of its own follows the strain that the compensator recovers, and goes to a known one where there
is one. There :math:`y` measures :math:`(g, o)` by the row :math:`H = (m, 1)`, and a Kalman filter of a random walk takes it,

.. math:: P \leftarrow P + \mathrm{diag}(q)\,h, \quad S = H P H^T + r, \quad K = P H^T / S, \quad
          (g, o) \leftarrow (g, o) + K\,(y - H\,(g, o)), \quad P \leftarrow P - K S K^T.

One known strain, such as the prestrain at rest, tells the sum of both; two that differ tell them apart, and what is not told
stays in the deviations. What is learned counts from the next sample on. Without drift per day and initial deviations P is
zero, and the resistance passes to the bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ..sensor.artifact import SensorArtifact
from ..sensor.law import SensorLaw, SensorState
from ..sensor.model import clip, normalised, resistance, resting_state, with_scales
from ..step_model import StepModel
from ..variables import Results, Values, by_name, input_, output, parameter, select

DAY = 86400.0  # [s]
LOWEST, HIGHEST = 0.5, 2.0  # [1] a gain beyond is a broken sensor; an offset is no more than the rise to full scale
MOST = (0.5, 1.0)  # [1] deviations of gain and offset, however long nothing is known
SMALLEST = 1e-300  # [1] variance that is none
FAULT = 5.0  # standard deviations by which a reading at a known strain may miss; one that misses by more tells nothing

KNOWN = (
    input_("known", "1", "1 if the strain is known now; else 0", 0.0, 0.0, 1.0, discrete=True, optional=True),
    input_("known_strain", "1", "Present strain; read while known is 1", 0.0, 0.0, nominal=0.1, optional=True),
)
PARAMETERS = (
    parameter("gain_per_day", "1", "Deviation of what the gain drifts by in a day; 0 = none", 0.0, 0.0, nominal=0.001),
    parameter("offset_per_day", "ohm", "Deviation of what the offset drifts by in a day; 0 = none", 0.0, 0.0, nominal=0.1),
    parameter("initial_gain_deviation", "1", "Deviation of the gain, which is 1, before the run", 0.0, 0.0, nominal=0.01),
    parameter(
        "initial_offset_deviation", "ohm", "Deviation of the offset, which is 0, before the run", 0.0, 0.0, nominal=1.0
    ),
    parameter("known_deviation", "ohm", "Deviation of a reading from its model at a known strain", 1.0, 1e-9, nominal=1.0),
)
OUTPUTS = (
    output("gain", "1", "Present change of resistance over that of the parameters", nominal=1.0),
    output("gain_deviation", "1", "Standard deviation of the error of gain", minimum=0.0, nominal=0.01),
    output("offset", "ohm", "Present resistance at rest less that of the parameters", nominal=1.0),
    output("offset_deviation", "ohm", "Standard deviation of the error of offset", minimum=0.0, nominal=1.0),
)


@dataclass(frozen=True, slots=True)
class Age:
    """Gaussian estimate of gain and offset.

    Attributes
    ----------
    mean : casadi.MX, shape (2,)
        g and o [1].
    P : casadi.MX, shape (2, 2)
        Covariance [1].
    """

    mean: ca.MX
    P: ca.MX

    def drift(self, variance: ca.MX) -> Age:
        """Let both wander by variances [1], shape (2,), and stay bounded."""
        P = self.P + ca.diag(variance)
        D = ca.diag(ca.fmin(1.0, ca.DM(MOST) / ca.sqrt(ca.fmax(ca.diag(P), SMALLEST))))
        return Age(self.mean, ca.mtimes([D, P, D]))

    def learn(self, m: ca.MX, y: ca.MX, r: ca.MX) -> Age:
        """Update with an output y [1], of variance r [1], where the model gives m [1]; not by one that misses too far."""
        H = ca.horzcat(m, 1.0)
        S = ca.mtimes([H, self.P, H.T]) + r
        K, e = ca.mtimes(self.P, H.T) / S, y - ca.mtimes(H, self.mean)
        mean = self.mean + K * e
        mean = ca.vertcat(ca.fmin(ca.fmax(mean[0], LOWEST), HIGHEST), ca.fmin(ca.fmax(mean[1], -1.0), 1.0))
        return select(e**2 < FAULT**2 * S, Age(mean, self.P - S * ca.mtimes(K, K.T)), self)


@dataclass(frozen=True, slots=True)
class AgeingState:
    """State of a compensator that follows the ageing of its sensor.

    Attributes
    ----------
    inner : casadi.MX, shape (n,)
        Of the compensator.
    sensor : SensorState
        Of the sensor that follows the strain.
    age : Age
        Of the sensor.
    """

    inner: ca.MX
    sensor: SensorState
    age: Age


def with_ageing(inner: StepModel, artifact: SensorArtifact) -> StepModel:
    """Return a compensator that follows gain and offset of its sensor.

    Parameters
    ----------
    inner : StepModel
        Any compensator of the sensor.
    artifact : SensorArtifact
        The sensor.

    Returns
    -------
    StepModel
        With inputs ``known`` and ``known_strain`` [1], and outputs ``gain`` [1] and ``offset`` [ohm] with their deviations.

    Notes
    -----
    The sensor within follows the present strain by a play whose half width is the stated deviation of strain: else noise
    would climb in its memory.
    """
    law = SensorLaw(artifact)
    rows = {c: [v for v in inner.variables if v.causality == c] for c in ("parameter", "input", "output")}
    known = [v for v in KNOWN if v.name not in inner.names]
    variables = (*rows["parameter"], *with_scales(PARAMETERS, artifact), *rows["input"], *known, *rows["output"], *OUTPUTS)

    def column(values: Values, of: str) -> ca.MX:
        return ca.vertcat(*(getattr(values, v.name) for v in rows[of]))

    def results(y: ca.MX, age: Age, p: Values) -> Results:
        change, P = p.full_scale_resistance_change, ca.diag(age.P)
        deviation = ca.if_else(P > SMALLEST, ca.sqrt(ca.fmax(P, SMALLEST)), 0.0)  # with a derivative everywhere
        own = (age.mean[0], deviation[0], change * age.mean[1], change * deviation[1])
        return vars(by_name(rows["output"], y)) | {v.name: value for v, value in zip(OUTPUTS, own, strict=True)}

    def init(u: Values, p: Values) -> tuple[AgeingState, Results]:
        x, y = inner.init.call([column(u, "input"), column(p, "parameter")], True, False)
        spread = ca.vertcat(p.initial_gain_deviation, p.initial_offset_deviation / p.full_scale_resistance_change)
        age = Age(ca.MX(ca.densify(ca.DM([1.0, 0.0]))), ca.densify(ca.diag(spread**2)))
        return AgeingState(x, resting_state(law, p), age), results(y, age, p)

    def step(x: AgeingState, u: Values, p: Values, h: ca.MX) -> tuple[AgeingState, Results]:
        change, y = p.full_scale_resistance_change, normalised(u.resistance, u, p)
        fresh = (y - x.age.mean[1]) / x.age.mean[0]
        less = resistance(fresh, u, p) - resistance(y, u, p)  # exactly zero where the sensor has not aged
        seen = Values(**(vars(u) | {"resistance": u.resistance + less}))
        inside, found = inner.step.call([x.inner, column(seen, "input"), column(p, "parameter"), h], True, False)
        strain = by_name(rows["output"], found)
        present, width = getattr(strain, "present_strain", strain.strain), getattr(strain, "strain_deviation", 0.0)
        s, width = present / p.full_scale_strain, width / p.full_scale_strain
        followed = ca.fmax(s - width, ca.fmin(s + width, x.sensor.s))
        known_s = u.known_strain / p.full_scale_strain
        told = ca.logic_and(u.known > 0.5, ca.logic_and(known_s >= 0.0, known_s <= 1.0))
        s = ca.if_else(told, known_s, followed)
        sensor = law.advance(x.sensor, clip(s), h)
        wander = ca.vertcat(p.gain_per_day, p.offset_per_day / change) ** 2 * h / DAY
        age = x.age.drift(wander)
        age = select(told, age.learn(law.output(sensor), y, (p.known_deviation / change) ** 2), age)
        return AgeingState(inside, sensor, age), results(found, age, p)

    return StepModel.written(
        name=inner.name,
        description=inner.description,
        variables=variables,
        init=init,
        step=step,
        advice=inner.advice,
        provenance=inner.provenance,
    )

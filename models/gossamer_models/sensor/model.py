"""The sensor as a ``StepModel``: strain in, resistance out.

Symbols: ``R`` resistance, ``R0`` at rest [ohm], ``dR`` its change at full scale [ohm], ``s`` normalised strain [1], ``y``
normalised output [1].
"""

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import casadi as ca

from ..step_model import StepModel
from ..variables import Results, Values, Variable, input_, output, parameter
from .artifact import SensorArtifact, default_artifact
from .law import SensorLaw, SensorState

LIKELY_NOISE = 1e-3  # [1] start value of an estimator's noise where none was measured
LIKELY_ERROR = 1e-2  # [1] the same of the error of a sensor's model
ADVICE = "rest_strain must not exceed full_scale_strain; inputs and steps must be of a sensible size."

REFERENCE = 293.15  # [K]
LEAST_GAIN = 0.1  # [1] of what temperature may do
SCALE_VARIABLES = (
    parameter("rest_resistance", "ohm", "Resistance of the sensor before its first loading", 100.0, 0.0, nominal=100.0),
    parameter(
        "full_scale_resistance_change", "ohm", "Static rise on first loading to full scale", 100.0, 1e-6, nominal=100.0
    ),
    parameter("full_scale_strain", "1", "End of the identified range; the sensor saturates there", 0.5, 1e-6, nominal=0.5),
    parameter(
        "rest_strain", "1", "Strain of the relaxed sensor before the run, after monotone loading", 0.0, 0.0, nominal=0.1
    ),
    parameter("reference_temperature", "K", "Temperature at which the other parameters hold", REFERENCE, 0.0, nominal=300.0),
    parameter("gain_per_kelvin", "1/K", "Relative change of the change of resistance with temperature", 0.0, nominal=1e-3),
    parameter("offset_per_kelvin", "ohm/K", "Change of the resistance at rest with temperature", 0.0, nominal=0.1),
)
TEMPERATURE = input_("temperature", "K", "Temperature of the sensor", REFERENCE, 0.0, nominal=300.0, optional=True)
STRAIN = input_("strain", "1", "Strain of the sensor, taken as linear over a step", 0.0, nominal=0.1)
RESISTANCE = output("resistance", "ohm", "Resistance of the sensor", nominal=100.0)
saturated = partial(output, "saturated", "1", minimum=0.0, maximum=1.0, discrete=True)


def with_scales(variables: tuple[Variable, ...], artifact: SensorArtifact, *, quiet: bool = False) -> tuple[Variable, ...]:
    """Return variables of sensor or compensator that start at the identified values, where the artifact has them.

    The noise of a ``quiet`` one starts at zero.
    """
    if artifact.scales is None:
        return variables
    starts: dict[str, float] = {**asdict(artifact.scales), "resistance": artifact.scales.rest_resistance}
    noise = LIKELY_NOISE if artifact.noise is None else artifact.noise
    starts["noise"] = 0.0 if quiet else noise * artifact.scales.full_scale_resistance_change
    if (warm := artifact.temperature) is not None:
        starts |= dict.fromkeys(("temperature", "reference_temperature"), warm.reference) | {"gain_per_kelvin": warm.gain}
        starts["offset_per_kelvin"] = warm.offset * artifact.scales.full_scale_resistance_change
    starts["known_deviation"] = (artifact.error or LIKELY_ERROR) * artifact.scales.full_scale_resistance_change
    return tuple(v if v.causality == "output" else replace(v, start=starts.get(v.name, v.start)) for v in variables)


def model_of(
    artifact: SensorArtifact,
    name: str,
    description: str,
    variables: tuple[Variable, ...],
    init: Callable[[Values, Values], tuple[Any, Results]],
    step: Callable[[Any, Values, Values, ca.MX], tuple[Any, Results]],
    *,
    quiet: bool = False,
) -> StepModel:
    """Build a sensor or a compensator whose variables start at the scales of its artifact, see ``with_scales``."""
    return StepModel.written(
        name=name,
        description=description,
        variables=with_scales(variables, artifact, quiet=quiet),
        init=init,
        step=step,
        advice=ADVICE,
        provenance=dict(artifact.provenance),
    )


def sensor_model(artifact: SensorArtifact | None = None) -> StepModel:
    r"""Build the sensor: modified Preisach hysteresis and dynamic relaxation.

    Parameters
    ----------
    artifact : SensorArtifact or None
        Identified sensor; None for the one that ships with the package.

    Returns
    -------
    StepModel
        Input ``strain`` [1]; outputs ``resistance`` [ohm] and ``saturated`` [1].

    Notes
    -----
    :math:`R = R_0 + \Delta R\,(f_s + \sum_q z_q)`, Eqs. (4.7) and (4.13) of [1]_, at the reference temperature; a
    warmer sensor has another gain and offset. ``init`` ignores the strain: the run
    starts at ``rest_strain``, so there is no false transient, and the first step ramps from there.

    References
    ----------
    .. [1] M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite
       Sensors, dissertation, Virginia Tech, 2010, Chapter 4.
    """
    artifact = default_artifact() if artifact is None else artifact
    law = SensorLaw(artifact)

    def init(u: Values, p: Values) -> tuple[SensorState, Results]:
        rest = resting_state(law, p)
        return rest, {"resistance": resistance(law.output(rest), u, p), "saturated": 0.0}

    def step(x: SensorState, u: Values, p: Values, h: ca.MX) -> tuple[SensorState, Results]:
        s = u.strain / p.full_scale_strain
        state = law.advance(x, clip(s), h)
        outside = ca.logic_or(s > 1.0, s < 0.0)
        return state, {"resistance": resistance(law.output(state), u, p), "saturated": outside}

    beyond = saturated("1 if the strain is outside 0 to full scale and was clipped, else 0")
    what = "Conductive polymer strain sensor with hysteresis, drift and relaxation"
    return model_of(artifact, "sensor", what, (*SCALE_VARIABLES, STRAIN, TEMPERATURE, RESISTANCE, beyond), init, step)


def resting_state(law: SensorLaw, p: Values) -> SensorState:
    """Return the state before the run; not a number, and so refused, where ``rest_strain`` is beyond full scale."""
    s = p.rest_strain / p.full_scale_strain
    return law.rest(ca.if_else(p.rest_strain <= p.full_scale_strain, s, float("nan")))


def resistance(y: ca.MX, u: Values, p: Values) -> ca.MX:
    """Return the resistance [ohm] of a normalised output [1] at the present temperature."""
    gain, offset = _warmed(u, p)
    return p.rest_resistance + offset + p.full_scale_resistance_change * (gain * y)


def normalised(R: ca.MX, u: Values, p: Values) -> ca.MX:
    """Return the normalised output [1] of a resistance [ohm] at the present temperature."""
    gain, offset = _warmed(u, p)
    return (R - p.rest_resistance - offset) / p.full_scale_resistance_change / gain


def _warmed(u: Values, p: Values) -> tuple[ca.MX, ca.MX]:
    """Return gain [1] and offset [ohm] at the present temperature: one and zero, to the bit, at the reference."""
    warmer = u.temperature - p.reference_temperature
    return ca.fmax(1.0 + p.gain_per_kelvin * warmer, LEAST_GAIN), p.offset_per_kelvin * warmer


def clip(s: ca.MX) -> ca.MX:
    """Limit a normalised strain [1] to 0..1."""
    return ca.fmin(ca.fmax(s, 0.0), 1.0)

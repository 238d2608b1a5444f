r"""The compensator of a sensor whose output may move against the strain: a direct inverse.

Symbols: ``R`` resistance and ``Rf`` its low-pass, ``R0`` at rest, ``dR`` change at full scale [ohm]; ``v`` normalised output
[1], ``s`` normalised strain [1]. Such a sensor has no inverse sample by sample: the same rise of resistance may be loading
or the start of unloading. What tells them apart is the history of the resistance, so operators of the sensor's own kind,
driven by the resistance, were fitted to the strain. They remember as much as a sensor does and nothing is solved for. They
have eta = 1, so noise does not ratchet and there is no dead band.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from ..errors import ParameterError
from ..sensor.artifact import SensorArtifact
from ..sensor.model import resting_state
from ..sensor.state import SensorLaw
from ..step_model import StepModel
from .low_pass import low_pass


def direct_model(artifact: SensorArtifact, exact: StepModel) -> StepModel:
    """Build the compensator that runs the direct inverse of an artifact.

    Parameters
    ----------
    artifact : SensorArtifact
        Sensor with an ``inverse``.
    exact : StepModel
        The exact inverse, of whatever artifact: this model has its variables but for ``dead_band``.

    Returns
    -------
    StepModel
        Input ``resistance`` [ohm]; outputs ``strain`` [1] and ``saturated`` [1].
    """
    inverse = artifact.inverse
    if inverse is None:
        msg = "this sensor has no direct inverse. Identify it with --direct-inverse, or take the exact inverse."
        raise ParameterError(msg)
    law, forward = SensorLaw(inverse.law), SensorLaw(replace(artifact, inverse=None))
    variables = tuple(v for v in exact.variables if v.name != "dead_band")
    parameters = [v.name for v in variables if v.causality == "parameter"]
    n_x = law.n_states
    x, h = ca.MX.sym("x", n_x + 2), ca.MX.sym("h")
    R, p = ca.MX.sym("R"), ca.MX.sym("p", len(parameters))
    given = dict(zip(parameters, ca.vertsplit(p), strict=True))
    R0, dR = given["rest_resistance"], given["full_scale_resistance_change"]
    full_scale, rest_strain = given["full_scale_strain"], given["rest_strain"]

    def normalise(v: ca.MX) -> ca.MX:
        return (v - inverse.lowest) / (inverse.highest - inverse.lowest)

    resting = resting_state(forward, rest_strain, full_scale)
    rest = law.rest(ca.fmin(ca.fmax(normalise(resting.output()), 0.0), 1.0))
    R_rest = R0 + dR * resting.output()
    strain = resting.s * full_scale
    init = ca.Function("init", [R, p], [ca.vertcat(rest.pack(), R_rest, R_rest), ca.vertcat(strain, 0.0)])

    Rf = low_pass(x[n_x], x[n_x + 1], R, given["filter_time"], h)
    v = normalise((Rf - R0) / dR)
    state = law.advance(law.unpack(x[:n_x]), ca.fmin(ca.fmax(v, 0.0), 1.0), h)
    s = ca.fmin(ca.fmax(inverse.offset + inverse.scale * state.output(), 0.0), 1.0)
    outside = ca.logic_or(v < 0.0, v > 1.0)
    step = ca.Function("step", [x, R, p, h], [ca.vertcat(state.pack(), Rf, R), ca.vertcat(s * full_scale, outside)])
    return replace(exact, variables=variables, init=init, step=step, provenance=dict(artifact.provenance))

r"""The compensator of a sensor whose output may move against the strain: a direct inverse.

Symbols: ``R`` resistance, ``R0`` at rest, ``dR`` change at full scale [ohm], ``v`` normalised output [1], ``s`` normalised
strain [1]. Such a sensor has no inverse sample by sample: the same rise of resistance may be loading or the start of
unloading. What tells them apart is the history of the resistance, so operators of the sensor's own kind, driven by the
resistance, were fitted to the strain. They remember as much as a sensor does and nothing is solved for.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from ..errors import ParameterError
from ..sensor.artifact import SensorArtifact
from ..sensor.model import resting_state
from ..sensor.state import SensorLaw
from ..step_model import StepModel


def direct_model(artifact: SensorArtifact, exact: StepModel) -> StepModel:
    """Build the compensator that runs the direct inverse of an artifact.

    Parameters
    ----------
    artifact : SensorArtifact
        Sensor with an ``inverse``.
    exact : StepModel
        The exact inverse, of whatever artifact: this model has the same interface. Its ``dead_band`` and ``filter_time``
        change nothing here, and outputs other than ``strain`` and ``saturated`` stay zero.

    Returns
    -------
    StepModel
        Input ``resistance`` [ohm]; outputs ``strain`` [1] and ``saturated`` [1].
    """
    inverse = artifact.inverse
    if inverse is None:
        msg = "this sensor has no direct inverse. Identify it with one, or take the exact inverse."
        raise ParameterError(msg)
    law, forward = SensorLaw(inverse.law), SensorLaw(replace(artifact, inverse=None))
    parameters, inputs, results = exact.slices()
    names = exact.names
    p, u = ca.MX.sym("p", parameters.stop), ca.MX.sym("u", inputs.stop - inputs.start)
    x, h = ca.MX.sym("x", law.n_states), ca.MX.sym("h")
    R0, dR, full_scale, rest_strain = (
        p[names.index(name)]
        for name in ("rest_resistance", "full_scale_resistance_change", "full_scale_strain", "rest_strain")
    )

    def outputs(strain: ca.MX, saturated: ca.MX) -> ca.MX:
        known = {"strain": strain, "saturated": saturated}
        return ca.vertcat(*(known.get(name, ca.MX(0.0)) for name in names[results]))

    def normalise(v: ca.MX) -> ca.MX:
        return (v - inverse.lowest) / (inverse.highest - inverse.lowest)

    resting = resting_state(forward, rest_strain, full_scale)
    rest = law.rest(ca.fmin(ca.fmax(normalise(resting.output()), 0.0), 1.0))
    init = ca.Function("init", [u, p], [rest.pack(), outputs(rest_strain + 0.0 * resting.s, ca.MX(0.0))])

    v = normalise((u[names.index("resistance") - inputs.start] - R0) / dR)
    state = law.advance(law.unpack(x), ca.fmin(ca.fmax(v, 0.0), 1.0), h)
    s = ca.fmin(ca.fmax(inverse.offset + inverse.scale * state.output(), 0.0), 1.0)
    outside = ca.logic_or(v < 0.0, v > 1.0)
    step = ca.Function("step", [x, u, p, h], [state.pack(), outputs(s * full_scale, outside)])
    return replace(exact, init=init, step=step, provenance=dict(artifact.provenance))

r"""The compensator of a sensor whose output may move against the strain: a direct inverse.

Symbols: ``R`` resistance [ohm]; ``v`` output over the range of the direct inverse [1], ``s`` normalised strain [1]. Such a
sensor has no inverse sample by sample: the same rise of resistance may be loading or the start of unloading. The history
of the resistance distinguishes them, so operators of the sensor's own kind, driven by the resistance, were fitted to the
strain. They remember as much as a sensor does, and no equation is solved. They have eta = 1, so noise does not accumulate
and there is no dead band.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
from gossamer_files.options import option

from ..errors import ParameterError
from ..sensor.artifact import SensorArtifact
from ..sensor.model import ADVICE, SCALE_VARIABLES, clip, normalised, resistance, resting_state, with_scales
from ..sensor.state import SensorLaw
from ..step_model import StepModel
from ..variables import Results, Values
from .exact import COMMON_VARIABLES, CompensatorState, LowPass


def direct_model(artifact: SensorArtifact) -> StepModel:
    """Build the compensator that runs the direct inverse of an artifact.

    Parameters
    ----------
    artifact : SensorArtifact
        Sensor with an ``inverse``.

    Returns
    -------
    StepModel
        Input ``resistance`` [ohm]; outputs ``strain`` [1] and ``saturated`` [1]. The variables are those of the exact
        inverse without ``dead_band``.

    Raises
    ------
    ParameterError
        The artifact has no direct inverse.
    """
    inverse = artifact.inverse
    if inverse is None:
        how = option("direct_inverse", True)
        msg = f"this sensor has no direct inverse. Identify it with {how}, or take the exact inverse."
        raise ParameterError(msg)
    law, forward = SensorLaw(inverse.law), SensorLaw(replace(artifact, inverse=None))

    def in_range(y: ca.MX) -> ca.MX:
        return (y - inverse.lowest) / (inverse.highest - inverse.lowest)

    def init(_: Values, p: Values) -> tuple[CompensatorState, Results]:
        rest = resting_state(forward, p)
        y = forward.output(rest)
        R = resistance(y, p)
        state = CompensatorState(law.rest(clip(in_range(y))), LowPass(R, R))
        return state, {"strain": rest.s * p.full_scale_strain, "saturated": 0.0}

    def step(x: CompensatorState, u: Values, p: Values, h: ca.MX) -> tuple[CompensatorState, Results]:
        low_pass = x.low_pass.advance(u.resistance, p.filter_time, h)
        v = in_range(normalised(low_pass.filtered, p))
        state = law.advance(x.sensor, clip(v), h)
        s = clip(inverse.offset + inverse.scale * state.output())
        outside = ca.logic_or(v < 0.0, v > 1.0)
        return CompensatorState(state, low_pass), {"strain": s * p.full_scale_strain, "saturated": outside}

    return StepModel.written(
        name="compensator",
        description="Inverse of the strain sensor: recovers strain from resistance",
        variables=with_scales((*SCALE_VARIABLES, *COMMON_VARIABLES), artifact),
        init=init,
        step=step,
        advice=ADVICE,
        provenance=dict(artifact.provenance),
    )

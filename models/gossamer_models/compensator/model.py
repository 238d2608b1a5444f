r"""The compensator as a ``StepModel``: resistance in, strain out.

Symbols: ``R`` resistance and ``Rf`` its low-pass [ohm], ``T`` filter time [s], ``s`` normalised strain [1]; the state is
that of the sensor followed by the last ``Rf`` and ``R``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import casadi as ca

from ..errors import ParameterError
from ..sensor.artifact import SensorArtifact, default_artifact
from ..sensor.model import ADVICE, SCALE_VARIABLES, resting_state, saturated, with_scales
from ..sensor.relaxation import decay
from ..sensor.state import SensorLaw
from ..step_model import StepModel
from ..variables import Variable
from .direct import direct_model
from .estimator import estimator_model
from .inverse import invert
from .low_pass import FILTER_TIME, low_pass


def compensator_model(
    artifact: SensorArtifact | None = None, method: Literal["inverse", "estimator"] = "inverse"
) -> StepModel:
    r"""Build the compensator of the sensor with the same artifact.

    Parameters
    ----------
    artifact : SensorArtifact or None
        Identified sensor; None for the one that ships with the package. One with a direct inverse is compensated by that,
        see ``direct_model``.
    method : {"inverse", "estimator"}
        The exact inverse, right for resistance without noise; or the estimator, which delays the strain and says how well it
        is known: see ``estimator_model``.

    Returns
    -------
    StepModel
        Input ``resistance`` [ohm]; outputs ``strain`` [1] and ``saturated`` [1].

    Notes
    -----
    Chapter 5 of [1]_: the decayed modes and the static output are subtracted, the sign of what remains tells whether
    strain rises or falls, and the surface of Eqs. (5.3), (5.4) is inverted; here the surface is never tabulated, see
    ``inverse.py``, and the operators switched within the step count with their exact step response. The recovered strain
    then advances the compensator's own memory through ``SensorLaw.advance``, the function that the sensor runs.

    While a resistance is out of reach, memory stands still and only the modes decay, so a spike leaves no trace. The
    same holds within the dead band.

    References
    ----------
    .. [1] M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite
       Sensors, dissertation, Virginia Tech, 2010, Chapter 5.
    """
    if method not in ("inverse", "estimator"):
        msg = f"there is no compensation method {method!r}. Choose inverse or estimator."
        raise ParameterError(msg)
    if method == "estimator":
        return estimator_model(artifact)
    artifact = default_artifact() if artifact is None else artifact
    if artifact.inverse is not None:
        return direct_model(artifact, compensator_model(replace(artifact, inverse=None, relaxation=())))
    if not artifact.exactly_invertible:
        msg = (
            "the output of this sensor may move against the strain or has a gain, so it has no exact inverse. Identify it "
            "again with --direct-inverse."
        )
        raise ParameterError(msg)
    law = SensorLaw(artifact)
    n_x = law.n_states
    x, h = ca.MX.sym("x", n_x + 2), ca.MX.sym("h")
    R, p = ca.MX.sym("R"), ca.MX.sym("p", len(SCALE_VARIABLES) + 2)
    R0, dR, full_scale, rest_strain, dead_band, T = ca.vertsplit(p)

    rest = resting_state(law, rest_strain, full_scale)
    R_rest = R0 + dR * rest.output()
    init = ca.Function("init", [R, p], [ca.vertcat(rest.pack(), R_rest, R_rest), ca.vertcat(rest.s * full_scale, 0.0)])

    state, Rf, R_last = law.unpack(x[:n_x]), x[n_x], x[n_x + 1]
    Rf = low_pass(Rf, R_last, R, T, h)

    target = (Rf - R0) / dR - state.f - ca.sum1(decay(law.bank, state.z, h))
    quiet = ca.fabs(target) * dR < dead_band
    found, out_of_reach = invert(law, state, target, h)
    unreachable = ca.logic_and(out_of_reach, ca.logic_not(quiet))
    s = ca.if_else(quiet, state.s, found)
    state = law.advance(state, ca.if_else(unreachable, state.s, s), h)
    # what is left within the tolerance of reach is rounding; kept as a debt, every visit to full scale would multiply it
    left_over = ca.if_else(ca.logic_or(quiet, unreachable), 0.0, (Rf - R0) / dR - state.output())
    state = replace(state, f=state.f + left_over)
    step = ca.Function("step", [x, R, p, h], [ca.vertcat(state.pack(), Rf, R), ca.vertcat(s * full_scale, unreachable)])
    return StepModel(
        name="compensator",
        description="Inverse of the strain sensor: recovers strain from resistance",
        variables=with_scales(
            (
                *SCALE_VARIABLES,
                Variable(
                    name="dead_band",
                    causality="parameter",
                    unit="ohm",
                    description="Strain stays while the resistance to explain is smaller than this; 0 switches it off",
                    start=0.0,
                    minimum=0.0,
                    nominal=1.0,
                ),
                FILTER_TIME,
                Variable(
                    name="resistance",
                    causality="input",
                    unit="ohm",
                    description="Measured resistance, taken as linear over a step",
                    start=100.0,
                    nominal=100.0,
                ),
                Variable(
                    name="strain",
                    causality="output",
                    unit="1",
                    description="Recovered strain",
                    minimum=0.0,
                    nominal=0.1,
                ),
                saturated(description="1 if no strain from 0 to full scale explains the resistance, else 0"),
            ),
            artifact,
        ),
        init=init,
        step=step,
        advice=ADVICE,
        provenance=dict(artifact.provenance),
    )

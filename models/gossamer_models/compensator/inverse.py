r"""The compensator as an inverse of the sensor, with a fixed number of operations per step: exact, or direct.

Symbols: ``R`` resistance [ohm], ``s`` normalised strain [1], ``y`` normalised output [1], ``target`` change of output that
the new strain has to make [1]. In ``invert``, for rising strain
(falling strain is its mirror image :math:`s \to 1 - s`, :math:`\mu \to \nu`): ``front[i]`` of line i [1], not decreasing in
i; ``m[i]`` weight below it [1]; ``C[i, l]`` weight of line i below strain l/N [1].

Exact inverse: the static rise :math:`F(s) = \sum_i \max(C_i(s) - m_i, 0)` bends only at the lattice l/N and at the fronts.
Its values on the lattice tell the interval; there every line that moves has a constant slope; its values at the fronts tell
the piece; there F plus the relaxation term is a quadratic, solved in closed form. Both are searched by bisection, since F
does not decrease: its values at all N + 1 points of the lattice would cost ten times as much as the sensor's own step.

Direct inverse: see ``sensor/direct.py``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from gossamer_files.options import option

from ..errors import ParameterError
from ..modes import phi_1, phi_2
from ..sensor.artifact import SensorArtifact
from ..sensor.direct import DirectLaw, DirectState, LowPass
from ..sensor.hysteresis import Table, widths
from ..sensor.law import SensorLaw, SensorState, excitation
from ..sensor.model import SCALE_VARIABLES, TEMPERATURE, model_of, normalised, resistance, resting_state, saturated
from ..step_model import StepModel
from ..variables import Results, Values, input_, output, parameter

REACH_TOLERANCE = 1e-9  # a target this little [1] out of reach is rounding at the end of the range, not saturation
DESCRIPTION = "Inverse of the strain sensor: recovers strain from resistance"
TAKE_THE_FILTER = "Take the filter, which suits every sensor: 'gossamer build filter --artifact FILE'."

DEAD_BAND = parameter(
    "dead_band", "ohm", "Strain stays while the resistance to explain is below this; 0 = off", 0.0, 0.0, nominal=1.0
)
LATE_VARIABLES = (
    output("present_strain", "1", "Estimated strain now: without delay, less accurate", minimum=0.0, nominal=0.1),
    output("strain_deviation", "1", "Standard deviation of the error of strain", minimum=0.0, nominal=0.001),
    output("delay", "s", "Delay of strain behind the resistance", minimum=0.0, nominal=1.0),
)
COMMON_VARIABLES = (
    parameter(
        "filter_time", "s", "Time constant of a first-order low-pass on the resistance; 0 = off", 0.0, 0.0, nominal=1.0
    ),
    input_("resistance", "ohm", "Measured resistance, taken as linear over a step", 100.0, nominal=100.0),
    TEMPERATURE,
    output("strain", "1", "Recovered strain", minimum=0.0, nominal=0.1),
    saturated("1 if no strain from 0 to full scale explains the resistance, else 0"),
)


@dataclass(frozen=True, slots=True)
class CompensatorState:
    """State of an exact compensator.

    Attributes
    ----------
    sensor : SensorState
        Memory of the sensor.
    low_pass : LowPass
        Filter of the resistance.
    """

    sensor: SensorState
    low_pass: LowPass


@dataclass(frozen=True, slots=True)
class DirectCompensatorState:
    """State of a compensator with a direct inverse, see ``CompensatorState``."""

    memory: DirectState
    low_pass: LowPass


def exact_model(artifact: SensorArtifact) -> StepModel:
    r"""Build the exact inverse of a sensor.

    Parameters
    ----------
    artifact : SensorArtifact
        Identified sensor.

    Returns
    -------
    StepModel
        Input ``resistance`` [ohm]; outputs ``strain`` [1] and ``saturated`` [1].

    Raises
    ------
    ParameterError
        The output of the sensor may move against the strain, or has a gain.

    Notes
    -----
    Chapter 5 of [1]_: the decayed modes, Eq. (5.7), and the static output are subtracted, the sign of the remainder
    shows whether strain rises or falls, and the surface of Eqs. (5.3) and (5.4) is inverted; here it is never tabulated,
    and the operators switched within the step count with their exact step response. The recovered strain then advances the
    compensator's own memory through ``SensorLaw.advance``, the function that the sensor runs.

    While a resistance is out of reach, memory stands still and only the modes decay, so a spike leaves no trace. The
    same holds within the dead band.

    References
    ----------
    .. [1] M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite
       Sensors, dissertation, Virginia Tech, 2010, Chapter 5.
    """
    if not artifact.exactly_invertible:
        msg = (
            "the output of this sensor may move against the strain, has a gain, a network or a memory that fades, so it has "
            f"no exact inverse. {TAKE_THE_FILTER} Or identify the sensor again with {option('direct_inverse', True)}."
        )
        raise ParameterError(msg)
    law = SensorLaw(artifact)

    def init(u: Values, p: Values) -> tuple[CompensatorState, Results]:
        rest = resting_state(law, p)
        R = resistance(rest.output(), u, p)
        return CompensatorState(rest, LowPass(R, R)), {"strain": rest.s * p.full_scale_strain, "saturated": 0.0}

    def step(x: CompensatorState, u: Values, p: Values, h: ca.MX) -> tuple[CompensatorState, Results]:
        low_pass = x.low_pass.advance(u.resistance, p.filter_time, h)
        y = normalised(low_pass.filtered, u, p)
        target = y - law.hold(x.sensor, h).output()
        quiet = ca.fabs(target) * p.full_scale_resistance_change < p.dead_band
        inverted, out_of_reach = invert(law, x.sensor, target, h)
        unreachable = ca.logic_and(out_of_reach, ca.logic_not(quiet))
        s = ca.if_else(quiet, x.sensor.s, inverted)
        state = law.advance(x.sensor, ca.if_else(unreachable, x.sensor.s, s), h)
        # the residual within the tolerance of reach is rounding; carried along, every visit to full scale would multiply it
        residual = ca.if_else(ca.logic_or(quiet, unreachable), 0.0, y - state.output())
        state = replace(state, f=state.f + residual)
        return CompensatorState(state, low_pass), {"strain": s * p.full_scale_strain, "saturated": unreachable}

    return model_of(artifact, "compensator", DESCRIPTION, (*SCALE_VARIABLES, DEAD_BAND, *COMMON_VARIABLES), init, step)


def invert(law: SensorLaw, state: SensorState, target: ca.MX, h: ca.MX) -> tuple[ca.MX, ca.MX]:
    """Return the strain whose step changes the output by ``target``.

    Parameters
    ----------
    law : SensorLaw
        Physics of the sensor.
    state : SensorState
        Before the step.
    target : casadi.MX, scalar
        Output [1] minus static output minus decayed modes; positive means that strain rises.
    h : casadi.MX, scalar
        Step [s].

    Returns
    -------
    s : casadi.MX, scalar
        Normalised strain [1], in 0..1.
    unreachable : casadi.MX, scalar
        1 where no strain in 0..1 gives the target; ``s`` is then the nearer end.
    """
    n = len(law.mu)
    up = target >= 0.0
    front = ca.if_else(up, state.front, 1.0 - state.front + widths(n))
    s0 = ca.if_else(up, state.s, 1.0 - state.s)
    target = ca.fabs(target)
    first = second = 0.0
    if law.bank.size:
        x = law.bank.exponents(h)
        kernels = phi_1(x), phi_2(x)
        rising = [ca.sum1(part) for part in excitation(law.bank, state.s, kernels, "rising")]
        falling = [-ca.sum1(part) for part in excitation(law.bank, state.s, kernels, "falling")]
        first, second = (ca.if_else(up, a, b) for a, b in zip(rising, falling, strict=True))

    def relaxation(s: ca.MX) -> ca.MX:
        delta = ca.fmax(s - s0, 0.0)
        return delta * (first + second * delta)

    mu, nu = law.mu, _mirror(law.nu)
    m = ca.if_else(up, state.up, nu.sum(axis=1) / n - state.down)
    C, density = _columns(up, _below(mu), _below(nu)), _columns(up, mu, nu)

    def static(l: ca.MX | float) -> ca.MX:
        return ca.sum1(ca.fmax(C(l) - m, 0.0))

    # the interval: the last one whose lower end is reached; the end of the range itself counts to the last interval
    l = _last(n, lambda l: static(l) + relaxation(l / n) <= target)
    unreachable = static(n) + relaxation(1.0) + REACH_TOLERANCE < target
    base, F, slope = ca.fmax(l / n, s0), static(l), density(l)

    # lines join in the order of their fronts; the last front that the target passes begins the last piece
    fronts = ca.fmax(front, base)

    def rise(s: ca.MX) -> ca.MX:
        return F + ca.dot(slope, ca.fmax(s - fronts, 0.0)) + relaxation(s)

    joined = _last(n, lambda i: rise(fronts[i]) <= target)
    s = fronts[joined]
    # counted by their number: fronts that are equal may differ by rounding
    c = ca.dot(slope, ca.DM(np.arange(n)) <= joined) + first + 2.0 * second * (s - s0)
    remaining = ca.fmax(target - rise(s), 0.0)
    s = ca.fmin(s + 2.0 * remaining / (c + ca.sqrt(c * c + 4.0 * second * remaining)), 1.0)
    return ca.if_else(up, s, 1.0 - s), unreachable


def _last(n: int, reached: Callable[[ca.MX], ca.MX]) -> ca.MX:
    """Return the last of the places 0..n-1 that is reached, by bisection; if none is, 0."""
    place = ca.MX(0.0)
    for k in reversed(range((n - 1).bit_length())):
        ahead = ca.fmin(place + 2.0**k, n - 1.0)
        place = ca.if_else(reached(ahead), ahead, place)
    return place


def _columns(up: ca.MX, rising: Table, falling: Table) -> Callable[[ca.MX | float], ca.MX]:
    """Return what looks up a column of one of two tables; one table that holds both costs no choice between columns."""
    n, m = rising.shape
    both = ca.MX(ca.DM(np.hstack([rising, falling]).T.ravel()))
    start = ca.if_else(up, 0.0, float(n * m)) + ca.DM(np.arange(n))
    return lambda column: both[start + n * column]


def _below(table: Table) -> Table:
    """Return C, shape (N, N + 1): the weight of every line below the strains l/N."""
    n = table.shape[0]
    return np.hstack([np.zeros((n, 1)), np.cumsum(table, axis=1) / n])


def _mirror(nu: Table) -> Table:
    """Turn a table over alpha into one over 1 - beta, line by line."""
    n = nu.shape[0]
    mirrored = np.zeros_like(nu)
    for i in range(n):
        mirrored[i, i:] = nu[i, i:][::-1]
    return mirrored


def direct_model(artifact: SensorArtifact) -> StepModel:
    """Build the compensator that runs the direct inverse of an artifact.

    Parameters
    ----------
    artifact : SensorArtifact
        Sensor with an ``inverse``.

    Returns
    -------
    StepModel
        Input ``resistance`` [ohm]; outputs ``strain`` [1] with its delay and standard deviation, ``present_strain`` [1] and
        ``saturated`` [1].

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
    direct, forward = DirectLaw(inverse), SensorLaw(artifact)

    def init(u: Values, p: Values) -> tuple[DirectCompensatorState, Results]:
        rest = resting_state(forward, p)
        y = forward.output(rest)
        R = resistance(y, u, p)
        strain = rest.s * p.full_scale_strain
        zero = dict.fromkeys(("saturated", "strain_deviation", "delay"), ca.MX(0.0))
        return DirectCompensatorState(direct.rest(y), LowPass(R, R)), {"strain": strain, "present_strain": strain, **zero}

    def step(x: DirectCompensatorState, u: Values, p: Values, h: ca.MX) -> tuple[DirectCompensatorState, Results]:
        low_pass = x.low_pass.advance(u.resistance, p.filter_time, h)
        y = normalised(low_pass.filtered, u, p)
        state = direct.advance(x.memory, y, h)
        features = direct.features(state)
        strain, scatter, outside = direct.earlier(features)
        return DirectCompensatorState(state, low_pass), {
            "strain": strain * p.full_scale_strain,
            "saturated": direct.beyond(y),
            "present_strain": direct.present(features)[0] * p.full_scale_strain,
            "strain_deviation": direct.deviation(scatter, outside) * p.full_scale_strain,
            "delay": state.delay,
        }

    variables = (*SCALE_VARIABLES, *COMMON_VARIABLES, *LATE_VARIABLES)
    return model_of(artifact, "compensator", DESCRIPTION, variables, init, step)

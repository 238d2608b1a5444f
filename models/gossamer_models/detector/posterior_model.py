"""The detector with posterior networks: strain histories in, probability, mean and standard deviation of damage out.

Symbols: ``x`` state, ``u`` inputs, ``p`` parameters, ``h`` step [s]. Block means and noise stream; the networks run
only when a window ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import casadi as ca

from ..step_model import StepModel
from ..variables import Results, Values, Variable, output, pack, results_of, unpack
from .features import SENSORS, Register
from .posterior import LARGEST_RISK, judge_window
from .posterior_artifact import ZONES, PosteriorArtifact
from .windows import Clock, as_trained, window_variables


@dataclass(frozen=True, slots=True)
class Outputs:
    """What one window gives, by the names of the table."""

    damage: ca.MX
    deviation: ca.MX
    probability: ca.MX
    misfit: ca.MX
    risk: ca.MX
    valid: ca.MX


@dataclass(frozen=True, slots=True)
class PosteriorState:
    """Place in the windows, the running window, and the outputs of the last one that ended."""

    clock: Clock
    register: Register
    outputs: Outputs


def posterior_model(artifact: PosteriorArtifact | None = None) -> StepModel:
    """Build the detector from trained posterior networks.

    Parameters
    ----------
    artifact : PosteriorArtifact, optional
        Trained networks; by default the nominal training that is shipped with this package.

    Returns
    -------
    StepModel
        Inputs ``strain[1..4]`` [1]; outputs ``damage[1..16]``, ``deviation[1..16]``, ``probability[1..16]``, ``misfit``,
        ``risk`` and ``valid`` [1].

    Notes
    -----
    Strains are read every ``sampling_step``, the first time one sampling step after ``start_time`` and ``delay``; between
    communication points they are taken as linear (held, where a communication step is longer than the sampling step). A
    window ends after ``window_length``; ``judge_window`` says what follows from it. With ``repeat`` the next window follows
    at once. Windows beyond the last one trained use its network, for a response that has become periodic; if it was not
    trained for that (``PosteriorArtifact.periodic``) they are not valid.

    Before the first window ends nothing is known: all outputs are 0. ``valid`` is 1 if the windows are those of the
    training, ``misfit`` is 1 or less, and ``risk`` is ``LARGEST_RISK`` or less.
    """
    trained = artifact or PosteriorArtifact.default()
    count = trained.samples // trained.block
    numbers = range(len(trained.windows))

    def outputs(register: Register, number: int, late: ca.MX, p: Values) -> Outputs:
        judged = judge_window(trained.windows[number], trained.block, *register.features(trained.samples))
        valid = as_trained(trained, p) * (judged.misfit <= 1.0) * (judged.risk <= LARGEST_RISK)
        if not trained.periodic:
            valid *= 1.0 - late
        return Outputs(judged.damage, judged.deviation, judged.probability, judged.misfit, judged.risk, valid)

    def init(_: Values, p: Values) -> tuple[PosteriorState, Results]:
        zero, none = ca.MX(0.0), ca.MX.zeros(ZONES)
        nothing = Outputs(none, none, none, zero, zero, zero)
        return PosteriorState(Clock.start(p), Register.empty(count), nothing), results_of(nothing)

    def step(x: PosteriorState, u: Values, p: Values, h: ca.MX) -> tuple[PosteriorState, Results]:
        clock, sample = x.clock.advance(u.strain, p, h)
        register = x.register.advance(sample.strain, sample.due, sample.number, trained.block)
        case = ca.if_else(sample.ends, ca.fmin(x.clock.number, numbers[-1]), -1)
        late = x.clock.number > numbers[-1]
        judged = [pack(outputs(register, number, late, p)) for number in numbers]
        latest = unpack(x.outputs, ca.conditional(case, judged, pack(x.outputs), True))
        return PosteriorState(clock, register.restarted(sample.ends), latest), results_of(latest)

    return StepModel.written(
        name="detector",
        description=f"Damage of 16 membrane zones from {SENSORS} strain histories: a network of its posterior",
        variables=_variables(trained),
        init=init,
        step=step,
        step_limit="sampling_step",
        advice="The strains are probably far beyond anything physical.",
        provenance=trained.provenance,
    )


def _variables(trained: PosteriorArtifact) -> tuple[Variable, ...]:
    zones = range(1, ZONES + 1)
    fraction = partial(output, unit="1", minimum=0.0, maximum=1.0, discrete=True)
    positive = partial(output, unit="1", minimum=0.0, discrete=True)
    valid = f"1 if the windows are those of the training, misfit is 1 and risk {LARGEST_RISK:g} or less, else 0"
    return (
        *window_variables(trained),
        *(fraction(f"damage[{z}]", description=f"Estimated loss of stiffness in zone {z}") for z in zones),
        *(positive(f"deviation[{z}]", description=f"Standard deviation of the damage of zone {z}") for z in zones),
        *(fraction(f"probability[{z}]", description=f"Probability that zone {z} is damaged") for z in zones),
        positive("misfit", description="Distance from the records of the training; 1 is the largest valid one"),
        fraction("risk", description="Chance that the damage of some zone is wrong by more than 10 % of its stiffness"),
        fraction("valid", description=valid),
    )

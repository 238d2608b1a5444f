"""Detectors as step models: strain histories in, damage of every zone out, at the end of each window.

Symbols: ``s`` sensors, ``x`` state, ``u`` inputs, ``p`` parameters, ``h`` step [s]; ``U`` packet energies of the running
window, ``I`` damage feature index [1], ``S`` similarity [1], ``O`` memberships [1]. What is remembered streams; the networks
run only when a window ends.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Generic, NamedTuple, TypeVar

import casadi as ca

from ..step_model import StepModel
from ..variables import Results, Values, Variable, fraction, input_, modulo, pack, parameter, positive, results_of, unpack
from .artifact import DetectorArtifact, TrainedWindows
from .features import BLOCK, PACKETS, Register, block_energies
from .networks import Defuzzification, defuzzify, similarity
from .posterior import DamagePosterior, judge_window
from .posterior_artifact import PosteriorArtifact, PosteriorWindow

SNAP = 1e-6  # in sampling steps: a sample due within this is due now, so that rounding does not accumulate
WHOLE = 1e-4  # of a four of samples, by which a window may be short: single precision divides no better
UNIT = 4  # a window has whole fours of samples
LEAST_SIMILARITY = 0.5  # of a valid estimate; single damage between the reference levels has 0.97 or more
Memory = TypeVar("Memory")
Outputs = TypeVar("Outputs")
Window = TypeVar("Window")


class Sample(NamedTuple):
    """What a step brings: strains, shape (s,) [1], whether they are due, their number, whether the window ends with them."""

    strain: ca.MX
    due: ca.MX
    number: ca.MX
    ends: ca.MX


@dataclass(frozen=True, slots=True)
class Clock:
    """Place within the windows.

    Attributes
    ----------
    to_next : casadi.MX, scalar
        Time to the next sample [s].
    count : casadi.MX, scalar
        Samples taken in this window.
    number : casadi.MX, scalar
        Windows completed.
    last : casadi.MX, shape (s,)
        Strains [1] at the last communication point.
    """

    to_next: ca.MX
    count: ca.MX
    number: ca.MX
    last: ca.MX

    @classmethod
    def start(cls, p: Values, sensors: int) -> Clock:
        """Return the clock before the first window."""
        zero = ca.MX(0.0)
        return cls(p.start_time + p.delay + p.sampling_step, zero, zero, ca.MX.zeros(sensors))

    def advance(self, strain: ca.MX, p: Values, h: ca.MX) -> tuple[Clock, Sample]:
        """Take the sample that is due within a step, if one is.

        Parameters
        ----------
        strain : casadi.MX, shape (s,)
            Strains [1] at the end of the step, linear over it.
        p : Values
            Parameters of the detector.
        h : casadi.MX, scalar
            Step [s], at most one sampling step.

        Returns
        -------
        clock : Clock
            After the step; in a new window if one has ended.
        sample : Sample
            Due or not.
        """
        rest = self.to_next - h
        due = rest <= SNAP * p.sampling_step
        on_time = ca.if_else(ca.fabs(rest) <= SNAP * p.sampling_step, 0.0, rest)
        sample = self.last + (strain - self.last) * ca.fmin(self.to_next / h, 1.0)
        take = ca.logic_and(due, ca.logic_or(self.number < 0.5, p.repeat > 0.5))
        count = self.count + take
        ends = ca.logic_and(take, count >= samples_of(p) - 0.5)
        clock = Clock(
            to_next=ca.if_else(due, on_time + p.sampling_step, rest),
            count=ca.if_else(ends, 0.0, count),
            number=self.number + ends,
            last=strain,
        )
        return clock, Sample(sample, take, count, ends)


def samples_of(p: Values) -> ca.MX:
    """Count the samples of a window: the whole fours that fit its length."""
    return UNIT * ca.fmax(ca.floor(p.window_length / p.sampling_step / UNIT + WHOLE), 1.0)


def as_trained(trained: TrainedWindows, p: Values) -> ca.MX:
    """Tell whether the parameters describe the windows of the training."""
    return (
        (ca.fabs(p.start_time - trained.start_time) <= SNAP * trained.sampling_step)
        * (ca.fabs(p.sampling_step - trained.sampling_step) <= SNAP * trained.sampling_step)
        * (samples_of(p) == trained.samples)
    )


def window_variables(trained: TrainedWindows) -> tuple[Variable, ...]:
    """Return the rows of the table that every detector has: its windows, the strains and the damages."""
    length = "Length of a window; whole blocks of four samples are used, at least one"
    delay = "How much later than the membrane's the strain arrives; windows begin later by it"
    return (
        parameter("start_time", "s", "Start of the first window after the start of the run", trained.start_time, 0.0),
        parameter("window_length", "s", length, trained.window_length, 0.0),
        parameter("sampling_step", "s", "Time between two samples", trained.sampling_step, 1e-9),
        parameter("repeat", "1", "1: windows follow each other through the run; 0: one window", 0.0, 0.0, 1.0),
        parameter("delay", "s", delay, 0.0, 0.0),
        *(
            input_(f"strain[{i}]", "1", f"Strain at sensor {i}, prestrain included", 0.0, nominal=0.1)
            for i in range(1, trained.sensors + 1)
        ),
        *(
            fraction(f"damage[{z}]", description=f"Estimated loss of stiffness in {name}")
            for z, name in enumerate(trained.names, start=1)
        ),
    )


@dataclass(frozen=True, slots=True)
class WindowState(Generic[Memory, Outputs]):
    """State of a detector: place in the windows, what it remembers of the running one, outputs of the last that ended."""

    clock: Clock
    memory: Memory
    outputs: Outputs


def window_model(
    trained: TrainedWindows,
    method: str,
    results: tuple[Variable, ...],
    start: tuple[Memory, Outputs],
    advance: Callable[[Memory, Sample], tuple[Memory, Window]],
    judges: Sequence[Callable[[Window, ca.MX, Values], Outputs]],
) -> StepModel:
    """Build a detector that judges windows.

    Parameters
    ----------
    trained : TrainedWindows
        Its windows.
    method : str
        Ends its description.
    results : tuple of Variable
        Outputs beside the damages.
    start : tuple
        What it remembers before the first sample, and its outputs before the first window ends.
    advance : callable
        Takes a sample; returns what is remembered after it, and what is known of the window that may end with it.
    judges : sequence of callable
        Of each window: turns what is known of it, whether it is later than the last one trained, and the parameters, into
        the outputs. The last one judges all later windows.
    """
    last = len(judges) - 1

    def init(_: Values, p: Values) -> tuple[WindowState[Memory, Outputs], Results]:
        return WindowState(Clock.start(p, trained.sensors), *start), results_of(start[1])

    def step(
        x: WindowState[Memory, Outputs], u: Values, p: Values, h: ca.MX
    ) -> tuple[WindowState[Memory, Outputs], Results]:
        clock, sample = x.clock.advance(u.strain, p, h)
        memory, window = advance(x.memory, sample)
        case = ca.if_else(sample.ends, ca.fmin(x.clock.number, last), -1)
        judged = [pack(judge(window, x.clock.number > last, p)) for judge in judges]
        latest = unpack(x.outputs, ca.conditional(case, judged, pack(x.outputs), True))
        return WindowState(clock, memory, latest), results_of(latest)

    return StepModel.written(
        name="detector",
        description=f"Damage of {trained.zones} membrane zones from {trained.sensors} strain histories: {method}",
        variables=(*window_variables(trained), *results),
        init=init,
        step=step,
        step_limit="sampling_step",
        advice="The strains are probably far beyond anything physical.",
        provenance=trained.provenance,
    )


@dataclass(frozen=True, slots=True)
class Energies:
    """Energies of the running window.

    Attributes
    ----------
    block : casadi.MX, shape (s, 3)
        Strains [1] at the last three samples.
    U : casadi.MX, shape (4 s,)
        Packet energies so far.
    """

    block: ca.MX
    U: ca.MX

    def advance(self, sample: Sample) -> tuple[Energies, ca.MX]:
        """Take a sample if it is due; return the energies after it and those of its window, shape (4 s,)."""
        block = ca.horzcat(self.block, sample.strain)
        completes = ca.logic_and(sample.due, modulo(sample.number, BLOCK) < 0.5)
        U = self.U + ca.if_else(completes, block_energies(block), 0.0)
        return Energies(ca.if_else(sample.due, block[:, 1:], self.block), ca.if_else(sample.ends, 0.0, U)), U


@dataclass(frozen=True, slots=True)
class Estimate:
    """The outputs that one window gives, by their names."""

    damage: ca.MX
    index: ca.MX
    similarity: ca.MX
    valid: ca.MX


def detector_model(artifact: DetectorArtifact | None = None, defuzzification: Defuzzification = "centroid") -> StepModel:
    """Build the detector from a trained artifact.

    Parameters
    ----------
    artifact : DetectorArtifact, optional
        Trained networks; by default the single-damage training that is shipped with this package.
    defuzzification : {"centroid", "mom", "som", "lom"}
        See ``defuzzify``.

    Returns
    -------
    StepModel
        Inputs ``strain[1..4]`` [1]; outputs ``damage[1..16]``, ``index[1..16]``, ``similarity``, ``valid`` [1].

    Notes
    -----
    Strains are read every ``sampling_step``, the first time one sampling step after ``start_time``; between communication
    points they are taken as linear (held, where a communication step is longer than the sampling step). A window ends after
    ``window_length``; its energies, Eq. (7.8) of [1]_, are divided by the baseline energies of the same window of the
    undamaged structure, Eq. (7.9), and sixteen networks, Section 6.3, estimate damage from the logarithms of the sixteen
    indices. With ``repeat`` the next window follows at once, else there is one window only. Windows beyond the last one
    trained use its baseline and networks, for a response that has become periodic.

    ``similarity`` is the largest similarity with any reference case, relative to that of the case itself; near zero,
    the training holds nothing like it. ``valid`` is 1 if the baseline belongs to the last window that ended and its
    similarity is ``LEAST_SIMILARITY`` or more.

    References
    ----------
    .. [1] M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite
       Sensors, dissertation, Virginia Tech, 2010, Chapters 6 and 7.
    """
    trained = artifact or DetectorArtifact.default()
    indices = trained.baseline.shape[-1]

    def estimate(c: int, U: ca.MX, _: ca.MX, p: Values) -> Estimate:
        I = U / ca.DM(trained.baseline[c])
        S = similarity(ca.log(I), ca.DM(trained.references[c]), ca.DM(trained.weights[c]), trained.bias[c])
        O = ca.vertcat(*(S.T @ ca.DM(rule) for rule in trained.rules[c]))
        largest = ca.mmax(S) * (1.0 + ca.exp(-trained.bias[c]))
        valid = ca.logic_and(as_trained(trained, p), largest >= LEAST_SIMILARITY)
        return Estimate(defuzzify(O, ca.DM(trained.peaks), defuzzification).T, I, largest, valid)

    zero = ca.MX(0.0)
    valid = f"1 if the baseline belongs to the last window and similarity is {LEAST_SIMILARITY} or more, else 0"
    packets = [f"sensor {i}, packet {packet}" for i in range(1, trained.sensors + 1) for packet in PACKETS]
    energies = Energies(ca.MX.zeros(trained.sensors, BLOCK - 1), ca.MX.zeros(indices))
    return window_model(
        trained,
        "Haar packet energies and neuro-fuzzy networks",
        (
            *(
                positive(f"index[{k}]", description=f"Damage feature index of {packet}: energy over baseline energy")
                for k, packet in enumerate(packets, start=1)
            ),
            fraction("similarity", description="Largest similarity with a reference case; near 0: unlike any of them"),
            fraction("valid", description=valid),
        ),
        (energies, Estimate(ca.MX.zeros(trained.zones), ca.MX.ones(indices), zero, zero)),
        Energies.advance,
        [partial(estimate, c) for c in range(len(trained.baseline))],
    )


def posterior_model(artifact: PosteriorArtifact | None = None) -> StepModel:
    """Build the detector from trained posterior networks.

    Parameters
    ----------
    artifact : PosteriorArtifact, optional
        Trained networks; by default the nominal training that is shipped with this package.

    Returns
    -------
    StepModel
        Inputs ``strain[1..s]`` [1] of s sensors; outputs ``damage[1..z]``, ``deviation[1..z]``, ``probability[1..z]`` of z
        zones, ``misfit`` and ``valid`` [1].

    Notes
    -----
    Strains are read every ``sampling_step``, the first time one sampling step after ``start_time`` and ``delay``; between
    communication points they are taken as linear (held, where a communication step is longer than the sampling step). A
    window ends after ``window_length``; ``judge_window`` says what follows from it. With ``repeat`` the next window follows
    at once. Windows beyond the last one trained use its network, for a response that has become periodic; if it was not
    trained for that (``PosteriorArtifact.periodic``) they are not valid.

    Before the first window ends nothing is known: all outputs are 0. ``valid`` is 1 if the windows are those of the
    training and ``misfit`` is 1 or less; how well each zone is known, its ``deviation`` says.
    """
    trained = artifact or PosteriorArtifact.default()
    zones = [*enumerate(trained.names, start=1)]

    def advance(x: Register, sample: Sample) -> tuple[Register, Register]:
        register = x.advance(sample.strain, sample.due, sample.number, trained.block)
        return register.restarted(sample.ends), register

    def judge(window: PosteriorWindow, register: Register, late: ca.MX, p: Values) -> DamagePosterior:
        known = as_trained(trained, p) if trained.periodic else as_trained(trained, p) * (1.0 - late)
        return judge_window(window, trained.block, *register.features(trained.samples), known)[0]

    zero, none = ca.MX(0.0), ca.MX.zeros(trained.zones)
    return window_model(
        trained,
        "a network of its posterior",
        (
            *(positive(f"deviation[{z}]", description=f"Standard deviation of the damage of {name}") for z, name in zones),
            *(fraction(f"probability[{z}]", description=f"Probability that {name} is damaged") for z, name in zones),
            positive("misfit", description="Distance from the records of the training; 1 is the largest valid one"),
            fraction("valid", description="1 if the windows are those of the training, and misfit is 1 or less, else 0"),
        ),
        (Register.empty(trained.sensors, trained.samples // trained.block), DamagePosterior(none, none, none, zero, zero)),
        advance,
        [partial(judge, window) for window in trained.windows],
    )

"""The detector: strain histories in, damage of sixteen zones out.

Symbols: ``U`` packet energies of the running window, ``I`` damage feature index [1], ``S`` similarity [1], ``O`` memberships
[1]. Sampling, packets and energies stream; the networks run only when a window ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import casadi as ca

from ..step_model import StepModel
from ..variables import Results, Values, Variable, input_, output, pack, parameter, unpack
from .artifact import INDICES, ZONES, DetectorArtifact
from .neurofuzzy import Defuzzification, defuzzify, similarity
from .packets import BLOCK, PACKETS, block_energies

SENSORS = 4
LEAST_SIMILARITY = 0.5  # of a valid estimate; single damage between the reference levels has 0.97 or more
SNAP = 1e-6  # in sampling steps: a sample due within this is due now, so that rounding does not accumulate


@dataclass(frozen=True, slots=True)
class Window:
    """Sampling and energies of the running window.

    Attributes
    ----------
    to_next : casadi.MX, scalar
        Time to the next sample [s].
    count : casadi.MX, scalar
        Samples taken in this window.
    number : casadi.MX, scalar
        Windows completed.
    last : casadi.MX, shape (4,)
        Strains [1] at the last communication point.
    block : casadi.MX, shape (4, 3)
        Strains [1] at the last three samples.
    U : casadi.MX, shape (16,)
        Packet energies so far.
    """

    to_next: ca.MX
    count: ca.MX
    number: ca.MX
    last: ca.MX
    block: ca.MX
    U: ca.MX

    def advance(self, strain: ca.MX, p: Values, h: ca.MX) -> tuple[Window, ca.MX, ca.MX]:
        """Take the sample that is due within a step, if one is.

        Parameters
        ----------
        strain : casadi.MX, shape (4,)
            Strains [1] at the end of the step, linear over it.
        p : Values
            Parameters of the detector.
        h : casadi.MX, scalar
            Step [s], at most one sampling step.

        Returns
        -------
        window : Window
            After the step; a new one if it has ended.
        U : casadi.MX, shape (16,)
            Energies of the window that the step belongs to.
        ended : casadi.MX, scalar
            Whether that window has ended.
        """
        rest = self.to_next - h
        due = rest <= SNAP * p.sampling_step
        on_time = ca.if_else(ca.fabs(rest) <= SNAP * p.sampling_step, 0.0, rest)
        sample = self.last + (strain - self.last) * ca.fmin(self.to_next / h, 1.0)
        block = ca.horzcat(self.block, sample)
        take = ca.logic_and(due, ca.logic_or(self.number < 0.5, p.repeat > 0.5))
        count = self.count + take
        completes = ca.logic_and(take, ca.fmod(count, BLOCK) < 0.5)
        U = self.U + ca.if_else(completes, block_energies(block), 0.0)
        ended = ca.logic_and(completes, count >= samples_of(p) - 0.5)
        window = Window(
            to_next=ca.if_else(due, on_time + p.sampling_step, rest),
            count=ca.if_else(ended, 0.0, count),
            number=self.number + ended,
            last=strain,
            block=ca.if_else(take, block[:, 1:], self.block),
            U=ca.if_else(ended, 0.0, U),
        )
        return window, U, ended


@dataclass(frozen=True, slots=True)
class Estimate:
    """The outputs that one window gives, by their names."""

    damage: ca.MX
    index: ca.MX
    similarity: ca.MX
    valid: ca.MX

    def results(self) -> Results:
        """Return the outputs by name."""
        return {name: getattr(self, name) for name in self.__slots__}


@dataclass(frozen=True, slots=True)
class DetectorState:
    """State of the detector: the running window and the results of the last one that ended."""

    window: Window
    estimate: Estimate


def detector_model(
    artifact: DetectorArtifact | None = None, defuzzification: Defuzzification = "centroid"
) -> StepModel:
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
        Inputs strain[1..4] [1]; outputs damage[1..16] [1], index[1..16] [1], similarity [1], valid [1].

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
    windows = range(len(trained.baseline))

    def estimate(U: ca.MX, c: int, p: Values) -> Estimate:
        I = U / ca.DM(trained.baseline[c])
        S = similarity(ca.log(I), ca.DM(trained.references[c]), ca.DM(trained.weights[c]), trained.bias[c])
        O = ca.vertcat(*(S.T @ ca.DM(rule) for rule in trained.rules[c]))
        largest = ca.mmax(S) * (1.0 + ca.exp(-trained.bias[c]))
        valid = ca.logic_and(_has_baseline(trained, p), largest >= LEAST_SIMILARITY)
        return Estimate(defuzzify(O, ca.DM(trained.peaks), defuzzification).T, I, largest, valid)

    def init(_: Values, p: Values) -> tuple[DetectorState, Results]:
        zero = ca.MX(0.0)
        none = Estimate(ca.MX.zeros(ZONES), ca.MX.ones(INDICES), zero, zero)
        strains, block = ca.MX.zeros(SENSORS), ca.MX.zeros(SENSORS, BLOCK - 1)
        window = Window(p.start_time + p.sampling_step, zero, zero, strains, block, ca.MX.zeros(INDICES))
        return DetectorState(window, none), none.results()

    def step(x: DetectorState, u: Values, p: Values, h: ca.MX) -> tuple[DetectorState, Results]:
        window, U, ended = x.window.advance(u.strain, p, h)
        case = ca.if_else(ended, ca.fmin(x.window.number, windows[-1]), -1)
        estimates = [pack(estimate(U, c, p)) for c in windows]
        latest = unpack(x.estimate, ca.conditional(case, estimates, pack(x.estimate), True))
        return DetectorState(window, latest), latest.results()

    return StepModel.written(
        name="detector",
        description="Damage of 16 membrane zones from 4 strain histories: Haar packet energies and neuro-fuzzy networks",
        variables=_variables(trained),
        init=init,
        step=step,
        step_limit="sampling_step",
        advice="The strains are probably far beyond anything physical.",
        provenance=trained.provenance,
    )


def samples_of(p: Values) -> ca.MX:
    """Count the samples of a window: the whole blocks of four that fit its length."""
    return BLOCK * ca.fmax(ca.floor(p.window_length / p.sampling_step / BLOCK + SNAP), 1.0)


def _has_baseline(trained: DetectorArtifact, p: Values) -> ca.MX:
    """Tell whether the parameters describe the windows whose baseline was trained."""
    return (
        (ca.fabs(p.start_time - trained.start_time) <= SNAP * trained.sampling_step)
        * (ca.fabs(p.sampling_step - trained.sampling_step) <= SNAP * trained.sampling_step)
        * (samples_of(p) == trained.samples)
    )


def _variables(trained: DetectorArtifact) -> tuple[Variable, ...]:
    length = "Length of a window; whole blocks of four samples are used, at least one"
    valid = f"1 if the baseline belongs to the last window and similarity is {LEAST_SIMILARITY} or more, else 0"
    sensors, zones = range(1, SENSORS + 1), range(1, ZONES + 1)
    packets = [f"sensor {i}, packet {packet}" for i in sensors for packet in PACKETS]
    fraction = partial(output, unit="1", minimum=0.0, maximum=1.0, discrete=True)
    index = partial(output, unit="1", minimum=0.0, discrete=True)
    strain = partial(input_, unit="1", start=0.0, nominal=0.1)
    return (
        parameter("start_time", "s", "Start of the first window after the start of the run", trained.start_time, 0.0),
        parameter("window_length", "s", length, trained.window_length, 0.0),
        parameter("sampling_step", "s", "Time between two samples", trained.sampling_step, 1e-9),
        parameter("repeat", "1", "1: windows follow each other through the run; 0: one window", 0.0, 0.0, 1.0),
        *(strain(f"strain[{i}]", description=f"Strain at sensor {i}, prestrain included") for i in sensors),
        *(fraction(f"damage[{z}]", description=f"Estimated loss of stiffness in zone {z}") for z in zones),
        *(
            index(f"index[{k}]", description=f"Damage feature index of {packet}: energy over baseline energy")
            for k, packet in enumerate(packets, start=1)
        ),
        fraction("similarity", description="Largest similarity with a reference case; near 0: unlike any of them"),
        fraction("valid", description=valid),
    )

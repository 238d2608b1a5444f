"""The detector: strain histories in, damage of sixteen zones out.

Symbols: ``U`` packet energies of the running window, ``I`` damage feature index [1], ``S`` similarity [1], ``O`` memberships
[1]. Sampling, packets and energies stream; the networks run only when a window ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import casadi as ca

from ..step_model import StepModel
from ..variables import Results, Values, Variable, output, pack, results_of, unpack
from .artifact import INDICES, ZONES, DetectorArtifact
from .features import SENSORS
from .neurofuzzy import Defuzzification, defuzzify, similarity
from .packets import BLOCK, PACKETS, block_energies
from .windows import Clock, Sample, as_trained, window_variables

LEAST_SIMILARITY = 0.5  # of a valid estimate; single damage between the reference levels has 0.97 or more


@dataclass(frozen=True, slots=True)
class Energies:
    """Energies of the running window.

    Attributes
    ----------
    block : casadi.MX, shape (4, 3)
        Strains [1] at the last three samples.
    U : casadi.MX, shape (16,)
        Packet energies so far.
    """

    block: ca.MX
    U: ca.MX

    def advance(self, sample: Sample) -> tuple[Energies, ca.MX]:
        """Take a sample if it is due; return the energies after it and those of its window, shape (16,)."""
        block = ca.horzcat(self.block, sample.strain)
        completes = ca.logic_and(sample.due, ca.fmod(sample.number, BLOCK) < 0.5)
        U = self.U + ca.if_else(completes, block_energies(block), 0.0)
        return Energies(ca.if_else(sample.due, block[:, 1:], self.block), ca.if_else(sample.ends, 0.0, U)), U


@dataclass(frozen=True, slots=True)
class Estimate:
    """The outputs that one window gives, by their names."""

    damage: ca.MX
    index: ca.MX
    similarity: ca.MX
    valid: ca.MX


@dataclass(frozen=True, slots=True)
class DetectorState:
    """State of the detector: place in the windows, the running window, and the results of the last one that ended."""

    clock: Clock
    energies: Energies
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
    windows = range(len(trained.baseline))

    def estimate(U: ca.MX, c: int, p: Values) -> Estimate:
        I = U / ca.DM(trained.baseline[c])
        S = similarity(ca.log(I), ca.DM(trained.references[c]), ca.DM(trained.weights[c]), trained.bias[c])
        O = ca.vertcat(*(S.T @ ca.DM(rule) for rule in trained.rules[c]))
        largest = ca.mmax(S) * (1.0 + ca.exp(-trained.bias[c]))
        valid = ca.logic_and(as_trained(trained, p), largest >= LEAST_SIMILARITY)
        return Estimate(defuzzify(O, ca.DM(trained.peaks), defuzzification).T, I, largest, valid)

    def init(_: Values, p: Values) -> tuple[DetectorState, Results]:
        zero = ca.MX(0.0)
        none = Estimate(ca.MX.zeros(ZONES), ca.MX.ones(INDICES), zero, zero)
        energies = Energies(ca.MX.zeros(SENSORS, BLOCK - 1), ca.MX.zeros(INDICES))
        return DetectorState(Clock.start(p), energies, none), results_of(none)

    def step(x: DetectorState, u: Values, p: Values, h: ca.MX) -> tuple[DetectorState, Results]:
        clock, sample = x.clock.advance(u.strain, p, h)
        energies, U = x.energies.advance(sample)
        case = ca.if_else(sample.ends, ca.fmin(x.clock.number, windows[-1]), -1)
        estimates = [pack(estimate(U, c, p)) for c in windows]
        latest = unpack(x.estimate, ca.conditional(case, estimates, pack(x.estimate), True))
        return DetectorState(clock, energies, latest), results_of(latest)

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


def _variables(trained: DetectorArtifact) -> tuple[Variable, ...]:
    valid = f"1 if the baseline belongs to the last window and similarity is {LEAST_SIMILARITY} or more, else 0"
    sensors, zones = range(1, SENSORS + 1), range(1, ZONES + 1)
    packets = [f"sensor {i}, packet {packet}" for i in sensors for packet in PACKETS]
    fraction = partial(output, unit="1", minimum=0.0, maximum=1.0, discrete=True)
    index = partial(output, unit="1", minimum=0.0, discrete=True)
    return (
        *window_variables(trained),
        *(fraction(f"damage[{z}]", description=f"Estimated loss of stiffness in zone {z}") for z in zones),
        *(
            index(f"index[{k}]", description=f"Damage feature index of {packet}: energy over baseline energy")
            for k, packet in enumerate(packets, start=1)
        ),
        fraction("similarity", description="Largest similarity with a reference case; near 0: unlike any of them"),
        fraction("valid", description=valid),
    )

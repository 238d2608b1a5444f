"""The detector: strain histories in, damage of sixteen zones out.

Symbols: ``to_next`` time to the next sample [s], ``count`` samples taken in this window, ``window`` windows completed,
``last`` strains at the last communication point, ``block`` the last three samples of the four sensors, ``U`` packet
energies of the running window, ``I`` damage feature index. Sampling, packets and energies stream; the networks run only
when a window ends.
"""

from __future__ import annotations

import casadi as ca

from ..step_model import StepModel
from ..variables import Variable
from .artifact import INDICES, ZONES, DetectorArtifact
from .neurofuzzy import Defuzzification, defuzzify, similarity
from .packets import BLOCK, block_energies

SENSORS = 4
KNOWN = 0.5  # least similarity of a valid judgement; single damage between the reference levels has 0.97 or more
_SNAP = 1e-6  # in sampling steps: a sample due within this is due now, so that rounding does not accumulate


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
    undamaged structure, Eq. (7.9), and sixteen networks judge the logarithms of the sixteen indices. With ``repeat`` the
    next window follows at once, else the record is the only one. Windows beyond the last one trained use its baseline and
    networks, for a response that has become periodic.

    ``similarity`` is the largest similarity with any reference case, relative to that of the case itself; near zero,
    nothing like it was trained. ``valid`` is 1 if the last window judged is the one that the baseline belongs to and its
    similarity is at least one half.

    References
    ----------
    .. [1] M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite
       Sensors, dissertation, Virginia Tech, 2010, Chapters 6 and 7.
    """
    trained = artifact or DetectorArtifact.default()
    record, judge = _record_function(), _judge_function(trained, defuzzification)
    unjudged = ca.DM([0.0] * ZONES + [1.0] * INDICES + [0.0, 0.0])
    n_memory = record.nnz_in(0)

    x, u = ca.MX.sym("x", n_memory + unjudged.numel()), ca.MX.sym("u", SENSORS)
    p, h = ca.MX.sym("p", 4), ca.MX.sym("h")
    memory, judged = ca.vertsplit(x, [0, n_memory, x.numel()])
    memory_next, U, window, ended = record(memory, u, p, h)
    belongs = (
        (ca.fabs(p[0] - trained.start_time) <= _SNAP * trained.sampling_step)
        * (ca.fabs(p[2] - trained.sampling_step) <= _SNAP * trained.sampling_step)
        * (_samples(p) == trained.samples)
    )
    trained_window = ca.fmin(window, trained.baseline.shape[0] - 1)
    judged_next = judge(ca.if_else(ended, trained_window, -1), U, belongs, judged)

    start = ca.vertcat(p[0] + p[2], ca.DM.zeros(n_memory - 1))
    return StepModel(
        name="detector",
        description="Damage of 16 membrane zones from 4 strain histories: Haar packet energies and neuro-fuzzy networks",
        variables=_variables(trained),
        init=ca.Function("init", [u, p], [ca.vertcat(start, unjudged), unjudged]),
        step=ca.Function("step", [x, u, p, h], [ca.vertcat(memory_next, judged_next), judged_next]),
        step_limit="sampling_step",
        advice="The strains are probably far beyond anything physical.",
        provenance=trained.provenance,
    )


def _samples(p: ca.SX | ca.MX) -> ca.SX | ca.MX:
    """Count the samples of a window: the whole blocks of four that fit its length."""
    return BLOCK * ca.fmax(ca.floor(p[1] / p[2] / BLOCK + _SNAP), 1.0)


def _record_function() -> ca.Function:
    """Sample the strains and accumulate the packet energies of the running window."""
    to_next, count, window = ca.SX.sym("to_next"), ca.SX.sym("count"), ca.SX.sym("window")
    last, block, U = ca.SX.sym("last", SENSORS), ca.SX.sym("block", SENSORS, BLOCK - 1), ca.SX.sym("U", INDICES)
    u, p, h = ca.SX.sym("u", SENSORS), ca.SX.sym("p", 4), ca.SX.sym("h")
    sampling_step, repeat = p[2], p[3]

    rest = to_next - h
    due = rest <= _SNAP * sampling_step
    recording = ca.logic_or(window < 0.5, repeat > 0.5)
    sample = last + (u - last) * ca.fmin(to_next / h, 1.0)
    on_time = ca.if_else(ca.fabs(rest) <= _SNAP * sampling_step, 0.0, rest)
    to_next_after = ca.if_else(due, on_time + sampling_step, rest)

    take = ca.logic_and(due, recording)
    count_after = count + take
    completes = ca.logic_and(take, ca.fmod(count_after, BLOCK) < 0.5)
    U_after = U + ca.if_else(completes, block_energies(block[:, 0], block[:, 1], block[:, 2], sample), 0.0)
    block_after = ca.if_else(take, ca.horzcat(block[:, 1:], sample), block)
    ended = ca.logic_and(completes, count_after >= _samples(p) - 0.5)

    memory = ca.vertcat(to_next, count, window, last, ca.vec(block), U)
    memory_after = ca.vertcat(
        to_next_after,
        ca.if_else(ended, 0.0, count_after),
        window + ended,
        u,
        ca.vec(block_after),
        ca.if_else(ended, 0.0, U_after),
    )
    return ca.Function("record", [memory, u, p, h], [memory_after, U_after, window, ended])


def _judge_function(trained: DetectorArtifact, defuzzification: Defuzzification) -> ca.Function:
    """Judge the energies of a window; the window's number selects baseline and networks, -1 keeps the last judgement."""
    U, belongs, judged = ca.MX.sym("U", INDICES), ca.MX.sym("belongs"), ca.MX.sym("judged", ZONES + INDICES + 2)
    peaks = ca.DM(trained.peaks)
    functions = []
    for c in range(trained.baseline.shape[0]):
        I = U / ca.DM(trained.baseline[c])
        S = similarity(ca.log(I), ca.DM(trained.references[c]), ca.DM(trained.weights[c]), trained.bias[c])
        O = ca.vertcat(*(S.T @ ca.DM(rule) for rule in trained.rules[c]))
        known = ca.mmax(S) * (1.0 + ca.exp(-trained.bias[c]))
        valid = ca.logic_and(belongs, known >= KNOWN)
        result = ca.vertcat(defuzzify(O, peaks, defuzzification).T, I, known, valid)
        functions.append(ca.Function(f"judge_{c}", [U, belongs, judged], [result]))
    keep = ca.Function("keep", [U, belongs, judged], [judged])
    return ca.Function.conditional("judge", functions, keep)


def _variables(trained: DetectorArtifact) -> tuple[Variable, ...]:
    parameters = (
        Variable(
            name="start_time",
            causality="parameter",
            unit="s",
            start=trained.start_time,
            minimum=0.0,
            description="Beginning of the first window, counted from the start of the run",
        ),
        Variable(
            name="window_length",
            causality="parameter",
            unit="s",
            start=trained.window_length,
            minimum=0.0,
            description="Length of a window; whole blocks of four samples are used, at least one",
        ),
        Variable(
            name="sampling_step",
            causality="parameter",
            unit="s",
            start=trained.sampling_step,
            minimum=1e-9,
            description="Time between two samples",
        ),
        Variable(
            name="repeat",
            causality="parameter",
            unit="1",
            start=0.0,
            minimum=0.0,
            maximum=1.0,
            description="1: windows follow each other through the run; 0: a single record",
        ),
    )
    strains = tuple(
        Variable(
            name=f"strain[{i + 1}]",
            causality="input",
            unit="1",
            start=0.0,
            nominal=0.1,
            description=f"Strain at sensor {i + 1}, prestrain included",
        )
        for i in range(SENSORS)
    )
    damages = tuple(
        Variable(
            name=f"damage[{z + 1}]",
            causality="output",
            unit="1",
            minimum=0.0,
            maximum=1.0,
            discrete=True,
            description=f"Estimated loss of stiffness in zone {z + 1}",
        )
        for z in range(ZONES)
    )
    packets = ("AA", "AD", "DA", "DD")
    indices = tuple(
        Variable(
            name=f"index[{k + 1}]",
            causality="output",
            unit="1",
            minimum=0.0,
            discrete=True,
            description=f"Damage feature index of sensor {k // 4 + 1}, packet {packets[k % 4]}: energy over baseline energy",
        )
        for k in range(INDICES)
    )
    flags = (
        Variable(
            name="similarity",
            causality="output",
            unit="1",
            minimum=0.0,
            maximum=1.0,
            discrete=True,
            description="Largest similarity with a reference case; near 0: nothing like it was trained",
        ),
        Variable(
            name="valid",
            causality="output",
            unit="1",
            minimum=0.0,
            maximum=1.0,
            discrete=True,
            description="1 if the last window judged fits the trained baseline and resembles a reference case",
        ),
    )
    return parameters + strains + damages + indices + flags

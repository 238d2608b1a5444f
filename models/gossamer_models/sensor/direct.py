r"""Direct inverse: strain from the memory that the output leaves in operators, read by networks.

A sensor whose output may move against the strain has no inverse sample by sample, since the same rise of resistance may be
loading or the start of unloading. The history of the resistance distinguishes them, and what follows does so better. Plays
(backlash, as of Preisach's model) and low-passes keep the history, exact for an output that is linear over a step, so that a
step may have any length. Small networks read the present strain from them, and an earlier one from their state then and some
outputs since. No equation is solved, and noise does not accumulate.

Symbols: ``u`` output over its range in training [1]; ``p`` plays [1], ``r`` their half widths [1]; ``l`` low-passes [1],
``T`` their times [s]; ``X`` features u, u - l, p - u, and of an earlier strain what u has changed by since, over their range
in training, -1 to 1 [1].

.. math:: p \leftarrow \max(u - r, \min(u + r, p)), \qquad T \dot l = u - l.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca

from ..modes import phi_1
from ..variables import select
from .artifact import DirectInverse, SmallNetwork
from .model import clip

ENOUGH = 1.0 - 1e-6  # of a step
BEYOND = 0.5  # of its range in training, by which an output may leave it
SHORTEST_FILTER_TIME = 1e-300  # [s]; stands for 0
SHORTEST = 1e-9  # [s] stands for the steps before the run
OUTSIDE = 0.2  # of the strain: what features that leave their range by half of it together may make the strain wrong by


@dataclass(frozen=True, slots=True)
class LowPass:
    """State of first-order low-passes.

    Attributes
    ----------
    filtered : casadi.MX, shape (n,)
        Filtered values at the last sample.
    last : casadi.MX, scalar
        What was filtered, at the last sample.
    """

    filtered: ca.MX
    last: ca.MX

    def advance(self, value: ca.MX, T: ca.MX, h: ca.MX) -> LowPass:
        r"""Return the state after a step.

        Parameters
        ----------
        value : casadi.MX, scalar
            What is filtered, at its end.
        T : casadi.MX, shape (n,)
            Times, 0 for none [s].
        h : casadi.MX, scalar
            Step [s].

        Notes
        -----
        :math:`T \dot x_f = x - x_f`, exact for x linear over the step.
        """
        ratio = h / ca.fmax(T, SHORTEST_FILTER_TIME)
        left, mean = ca.exp(-ratio), phi_1(ratio)
        return LowPass(left * self.filtered + (mean - left) * self.last + (1.0 - mean) * value, value)


@dataclass(frozen=True, slots=True)
class Memory:
    """What plays and low-passes keep of an output.

    Attributes
    ----------
    plays : casadi.MX, shape (n,)
        p [1].
    low : LowPass
        l and u [1].
    """

    plays: ca.MX
    low: LowPass

    @property
    def features(self) -> ca.MX:
        """u, u - l, p - u, shape (F,) [1]."""
        u = self.low.last
        return ca.vertcat(u, u - self.low.filtered, self.plays - u)


@dataclass(frozen=True, slots=True)
class DirectState:
    """State of a direct inverse.

    Attributes
    ----------
    now, then : Memory
        Of the present output, and of the oldest of the latest ones.
    recent, steps : casadi.MX, shape (n,)
        The latest outputs [1], the oldest first, and the steps [s] that lead to them.
    since : casadi.MX, scalar
        Time since the last of them [s].
    begun : casadi.MX, scalar
        1 after the first output, at which the memory is at rest.
    """

    now: Memory
    then: Memory
    recent: ca.MX
    steps: ca.MX
    since: ca.MX
    begun: ca.MX

    @property
    def delay(self) -> ca.MX:
        """How much earlier than now ``then`` is [s]."""
        return ca.sum1(self.steps[1:]) + self.since if self.steps.numel() else ca.MX(0.0)


class DirectLaw:
    """The operators and networks of a direct inverse.

    Parameters
    ----------
    inverse : DirectInverse
        Their numbers.
    """

    def __init__(self, inverse: DirectInverse) -> None:
        self.inverse = inverse
        self._widths, self._times = ca.DM(inverse.widths), ca.DM(inverse.times)
        self._features = 1 + len(inverse.widths) + len(inverse.times)  # of a memory
        self._kept = inverse.ahead[-1] + 1 if inverse.ahead else 0

    def place(self, y: ca.MX) -> ca.MX:
        """Return u [1], unlimited, of an output y [1]."""
        return (y - self.inverse.lowest) / (self.inverse.highest - self.inverse.lowest)

    def beyond(self, y: ca.MX) -> ca.MX:
        """Tell whether an output [1] is out of the range that training spans, by more than half of it."""
        u = self.place(y)
        return ca.logic_or(u < -BEYOND, u > 1.0 + BEYOND)

    def rest(self, y: ca.MX) -> DirectState:
        """Return the state before the first output, as at rest at an output [1]."""
        u = ca.fmin(ca.fmax(self.place(y), -BEYOND), 1.0 + BEYOND)
        plays, filtered, recent = (ca.MX(u * ca.DM.ones(n)) for n in (self._widths.numel(), self._times.numel(), self._kept))
        memory = Memory(plays, LowPass(filtered, u))
        return DirectState(memory, memory, recent, ca.MX.zeros(self._kept), ca.MX(0.0), ca.MX(0.0))

    def advance(self, state: DirectState, y: ca.MX, h: ca.MX) -> DirectState:
        """Return the state after a step of ``h`` [s] that ends at an output y [1], linear over it."""
        first = self.rest(y)
        u = first.now.low.last
        now, then, recent, steps, since = self._moved(state.now, u, h), state.then, state.recent, state.steps, state.since
        if self._kept:
            since = since + h
            taken = since > ENOUGH * self.inverse.step
            queue, times = ca.vertcat(recent[1:], u), ca.vertcat(steps[1:], since)
            then = select(taken, self._moved(then, queue[0], ca.fmax(times[0], SHORTEST)), then)
            recent, steps, since = (ca.if_else(taken, *pair) for pair in ((queue, recent), (times, steps), (0.0, since)))
        begun = ca.MX(1.0)
        after = DirectState(now, then, recent, steps, since, begun)
        return select(state.begun > 0.5, after, replace(first, begun=begun))

    def features(self, state: DirectState) -> ca.MX:
        """Return what the networks of the present strain see, and after it what those of the earlier one see, shape (F,)."""
        if not self._kept:
            return state.now.features
        since = state.recent[list(self.inverse.ahead)] - state.recent[0]
        return ca.vertcat(state.now.features, state.then.features, since)

    def present(self, features: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Return the present normalised strain [1] from ``features``, the scatter of its networks [1], and d [1].

        d is the distance by which features leave their range in training, in halves of it.
        """
        return _read(self.inverse.networks, features[: self._features])

    def earlier(self, features: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Return the same of the strain that is delivered: the present one where the inverse does not look ahead."""
        if not self._kept:
            return self.present(features)
        return _read(self.inverse.later, features[self._features :])

    def deviation(self, scatter: ca.MX, outside: ca.MX) -> ca.MX:
        r"""Return the standard deviation of the normalised strain [1] from what ``earlier`` returns.

        Notes
        -----
        :math:`k \sqrt{s^2 + f^2 + (0.2\,d)^2}` with the scatter s of the networks and the floor f; k is calibrated on later
        parts of training.
        """
        floor, factor = self.inverse.floor, self.inverse.factor
        return factor * ca.sqrt(scatter**2 + floor**2 + (OUTSIDE * outside) ** 2)

    def _moved(self, memory: Memory, u: ca.MX, h: ca.MX) -> Memory:
        plays = ca.fmax(u - self._widths, ca.fmin(u + self._widths, memory.plays))
        return Memory(plays, memory.low.advance(u, self._times, h))


def _read(networks: tuple[SmallNetwork, ...], features: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
    X = networks[0].place(features)  # all were trained on the same samples
    within = ca.fmin(ca.fmax(X, -1.0), 1.0)
    values = ca.vertcat(*(each.value(within) for each in networks))
    mean = ca.sum1(values) / len(networks)
    scatter, outside = ca.sumsqr(values - mean) / len(networks), ca.sumsqr(X - within)
    return clip(0.5 + mean), ca.sqrt(scatter), ca.sqrt(outside)

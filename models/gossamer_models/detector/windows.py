"""Windows of the detector in time: when a sample is due, and when a window ends.

Symbols: ``h`` step [s], ``p`` parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import casadi as ca

from ..variables import Values, Variable, input_, parameter
from .features import SENSORS

SNAP = 1e-6  # in sampling steps: a sample due within this is due now, so that rounding does not accumulate
UNIT = 4  # a window has whole fours of samples


class Trained(Protocol):
    """The windows that a detector was trained for."""

    @property
    def start_time(self) -> float: ...  # noqa: D102
    @property
    def sampling_step(self) -> float: ...  # noqa: D102
    @property
    def samples(self) -> int: ...  # noqa: D102


class Sample(NamedTuple):
    """What a step brings: strains, shape (4,) [1], whether they are due, their number, whether the window ends with them."""

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
    last : casadi.MX, shape (4,)
        Strains [1] at the last communication point.
    """

    to_next: ca.MX
    count: ca.MX
    number: ca.MX
    last: ca.MX

    @classmethod
    def start(cls, p: Values) -> Clock:
        """Return the clock before the first window."""
        zero = ca.MX(0.0)
        return cls(p.start_time + p.delay + p.sampling_step, zero, zero, ca.MX.zeros(SENSORS))

    def advance(self, strain: ca.MX, p: Values, h: ca.MX) -> tuple[Clock, Sample]:
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
    return UNIT * ca.fmax(ca.floor(p.window_length / p.sampling_step / UNIT + SNAP), 1.0)


def as_trained(trained: Trained, p: Values) -> ca.MX:
    """Tell whether the parameters describe the windows of the training."""
    return (
        (ca.fabs(p.start_time - trained.start_time) <= SNAP * trained.sampling_step)
        * (ca.fabs(p.sampling_step - trained.sampling_step) <= SNAP * trained.sampling_step)
        * (samples_of(p) == trained.samples)
    )


def window_variables(trained: Trained) -> tuple[Variable, ...]:
    """Return the rows of the table that every detector has: its windows and the strains."""
    length = "Length of a window; whole blocks of four samples are used, at least one"
    delay = "How much later than the membrane's the strain arrives; windows begin later by it"
    window_length = trained.samples * trained.sampling_step
    return (
        parameter("start_time", "s", "Start of the first window after the start of the run", trained.start_time, 0.0),
        parameter("window_length", "s", length, window_length, 0.0),
        parameter("sampling_step", "s", "Time between two samples", trained.sampling_step, 1e-9),
        parameter("repeat", "1", "1: windows follow each other through the run; 0: one window", 0.0, 0.0, 1.0),
        parameter("delay", "s", delay, 0.0, 0.0),
        *(
            input_(f"strain[{i}]", "1", f"Strain at sensor {i}, prestrain included", 0.0, nominal=0.1)
            for i in range(1, SENSORS + 1)
        ),
    )

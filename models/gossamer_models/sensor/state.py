"""What a sensor remembers, and how one sample changes it; sensor and compensator both use this and nothing else.

Symbols: ``s`` normalised strain [1], ``front`` fronts of the ``N`` lines [1], ``up`` and ``down`` cumulative weights below
them [1], ``f`` accumulated static output [1], ``z`` relaxation modes [1], ``g`` modes of the gain [1]; the state vector is
their concatenation.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import casadi as ca

from .artifact import SensorArtifact
from .hysteresis import cumulate, move_fronts, resting_fronts
from .relaxation import ModeBank, relax


@dataclass(frozen=True, slots=True)
class SensorState:
    """Normalised memory of one sensor.

    Attributes
    ----------
    front, up, down : casadi.MX, shape (N,)
        Switching fronts [1] and the cumulative weights [1] of up- and down-switching below them.
    f : casadi.MX, scalar
        Static output [1].
    s : casadi.MX, scalar
        Strain [1] at the last sample.
    z : casadi.MX, shape (n,)
        Relaxation modes [1].
    g : casadi.MX, shape (m,)
        Modes of the gain [1] (extension); none in the thesis.
    """

    front: ca.MX
    up: ca.MX
    down: ca.MX
    f: ca.MX
    s: ca.MX
    z: ca.MX
    g: ca.MX

    def pack(self) -> ca.MX:
        """Return the state as one column, shape (3 N + 2 + n + m,)."""
        return ca.vertcat(self.front, self.up, self.down, self.f, self.s, self.z, self.g)

    def output(self) -> ca.MX:
        r"""Return the output [1], Eq. (4.7) plus Eq. (4.13) of the thesis; with the extension plus :math:`s \sum_q g_q`."""
        return self.f + ca.sum1(self.z) + self.s * ca.sum1(self.g)


class SensorLaw:
    """The physics of one artifact: state layout, resting state and the step.

    Parameters
    ----------
    artifact : SensorArtifact
        Weights and relaxation terms.
    """

    def __init__(self, artifact: SensorArtifact) -> None:
        self.mu, self.nu = artifact.tables()
        self.bank = ModeBank.of(tuple(term for term in artifact.relaxation if not term.gain))
        self.gains = ModeBank.of(tuple(term for term in artifact.relaxation if term.gain))
        self.n_lines = artifact.n_lines
        self.n_states = 3 * self.n_lines + 2 + self.bank.size + self.gains.size

    def unpack(self, x: ca.MX) -> SensorState:
        """Split a state column, shape (n_states,)."""
        n = self.n_lines
        ends = [0, n, 2 * n, 3 * n, 3 * n + 1, 3 * n + 2, 3 * n + 2 + self.bank.size, self.n_states]
        return SensorState(*(x[a:b] for a, b in pairwise(ends)))

    def rest(self, s: ca.MX) -> SensorState:
        """Return the state long after the first monotone loading to strain ``s`` [1]: relaxation is over."""
        front = resting_fronts(self.n_lines, s)
        up, down = cumulate(front, self.mu, self.nu)
        z, g = ca.DM.zeros(self.bank.size), ca.DM.zeros(self.gains.size)
        return SensorState(front, up, down, ca.sum1(up), s, z, g)

    def advance(self, state: SensorState, s: ca.MX, h: ca.MX) -> SensorState:
        r"""Advance the memory by one sample.

        Parameters
        ----------
        state : SensorState
            Before the step.
        s : casadi.MX, scalar
            Normalised strain [1] at its end, in 0..1; it moves linearly in between.
        h : casadi.MX, scalar
            Step [s].

        Returns
        -------
        SensorState
            After the step.

        Notes
        -----
        Accumulating reading of Eq. (4.7) of the thesis: every up-switch adds ``mu``, every down-switch removes ``nu`` =
        ``eta*mu``. Fronts move one way within a sample, so of the two sums below at most one differs from zero.
        """
        front = move_fronts(state.front, s)
        up, down = cumulate(front, self.mu, self.nu)
        f = state.f + ca.fmax(ca.sum1(up) - ca.sum1(state.up), 0.0) + ca.fmin(ca.sum1(down) - ca.sum1(state.down), 0.0)
        z = relax(self.bank, state.z, state.s, s, h)
        g = relax(self.gains, state.g, state.s, s, h)
        return SensorState(front, up, down, f, s, z, g)

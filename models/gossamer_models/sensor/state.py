"""State of a sensor and its change over one sample, which the sensor and its compensators share.

Symbols: ``s`` normalised strain [1], ``front`` fronts of the ``N`` lines [1], ``up`` and ``down`` cumulative weights below
them [1], ``f`` accumulated static output [1], ``z`` relaxation modes [1], ``g`` modes of the gain [1].
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca

from .artifact import SensorArtifact
from .hysteresis import cumulate, down, move_fronts, resting_fronts
from .relaxation import ModeBank, decay, relax
from .residual import lines_of


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

    def output(self) -> ca.MX:
        r"""Return the output [1], Eq. (4.7) plus Eq. (4.13) of the thesis; with the extension plus :math:`s \sum_q g_q`."""
        return self.f + ca.sum1(self.z) + self.s * ca.sum1(self.g)


class SensorLaw:
    """The physics of one artifact: the state at rest and its change.

    Parameters
    ----------
    artifact : SensorArtifact
        Weights and relaxation terms.

    Attributes
    ----------
    mu, nu : ndarray, shape (N, N)
        Weights [1] of up- and down-switching.
    bank, gains : ModeBank
        Relaxation modes that are added to the output, and those that are multiplied by the strain.
    residual : Residual or None
        Network that corrects the output (extension).
    """

    def __init__(self, artifact: SensorArtifact) -> None:
        self.mu, self.nu = artifact.tables()
        self.bank = ModeBank.of(tuple(term for term in artifact.relaxation if not term.gain))
        self.gains = ModeBank.of(tuple(term for term in artifact.relaxation if term.gain))
        self.residual = artifact.residual

    def rest(self, s: ca.MX) -> SensorState:
        """Return the state long after the first monotone loading to strain ``s`` [1]: relaxation is over."""
        front = resting_fronts(len(self.mu), s)
        up, down = cumulate(front, self.mu, self.nu)
        z, g = ca.DM.zeros(self.bank.size), ca.DM.zeros(self.gains.size)
        return SensorState(front, up, down, ca.sum1(up), s, z, g)

    def hold(self, state: SensorState, h: ca.MX) -> SensorState:
        """Return the state after ``h`` [s] at constant strain: only the modes decay."""
        return replace(state, z=decay(self.bank, state.z, h), g=decay(self.gains, state.g, h))

    def output(self, state: SensorState) -> ca.MX:
        """Return the output [1] of a state, with the correction of the residual network if the sensor has one."""
        if self.residual is None:
            return state.output()
        return state.output() + self.residual.correction(self.features(state))

    def features(self, state: SensorState) -> ca.MX:
        """Return what a residual network sees [1]: strain, some fronts, and what every mode adds to the output."""
        fronts = state.front[lines_of(len(self.mu)), :]
        return ca.vertcat(state.s, fronts, state.z, down(state.s, state.g) * state.g)

    def advance(self, state: SensorState, s: ca.MX, h: ca.MX) -> SensorState:
        r"""Return the state after one sample.

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

r"""State of a sensor and its change over one sample, which the sensor and its compensators share.

Symbols: ``s`` normalised strain [1], ``front`` fronts of the ``N`` lines [1], ``up`` and ``down`` cumulative weights below
them [1], ``f`` accumulated static output [1]; ``z[q]`` relaxation modes [1] of decay rates :math:`\lambda_q` [1/s] and
amplitudes :math:`g_q, k_q` [1], ``g`` modes of the gain [1]; ``h`` step [s], ``x`` = :math:`\lambda h` [1],
:math:`\kappa` fading [1]. While strain rises,

.. math:: \dot z_q = -\lambda_q z_q + (g_q + k_q s)\,\dot s, \qquad f_d = \sum_q z_q,

which is Eq. (4.13) of the thesis, read with :math:`n_\zeta` for :math:`n_\alpha`, with :math:`A = a\zeta^d`, d = 0
(:math:`g`) or 1 (:math:`k`), and the stretched exponentials replaced by sums. Falling strain excites nothing in the thesis.
There are two extensions. In one, falling strain excites the same modes with amplitudes of its own,
:math:`(g'_q + k'_q s)\,|\dot s|`: the resistance of carbon-black sensors jumps up when unloading begins. In the other, modes
:math:`z'_q` of the same law are multiplied by the present strain, :math:`f_d = \sum_q z_q + s \sum_q z'_q`: the loops of
silver thread grow from cycle to cycle. Such sensors forget with movement as well as with time,

.. math:: \dot z_q = -(\lambda_q + \kappa\,|\dot s|)\,z_q + (g_q + k_q s)\,|\dot s|,
          \qquad |z_q| \le (|g_q| + |k_q|)/\kappa :

no number of cycles, at whatever rate, adds up to more. The step is exact for strain linear over it, with
``x`` = :math:`\lambda h + \kappa\,|\Delta s|`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ..arrays import Vector
from ..modes import phi_1, phi_2
from .artifact import SensorArtifact
from .drives import DIRECTIONS, Drive, RelaxationTerm
from .hysteresis import across, cumulate, down, move_fronts, resting_fronts

SMALLEST = 1e-300
FRONTS = (1, 2, 4, 8, 16)  # lines of 32 whose fronts are features; of N lines their multiples by N/32


@dataclass(frozen=True, slots=True)
class ModeBank:
    r"""Rates and amplitudes of all relaxation modes.

    Attributes
    ----------
    decay_rates : ndarray, shape (n,)
        Rates [1/s], increasing, all different.
    amplitudes : dict of Drive to ndarray, shape (n,)
        Response of the modes to a unit of each excitation [1].
    fading : float
        :math:`\kappa` [1].
    """

    decay_rates: Vector
    amplitudes: dict[Drive, Vector]
    fading: float = 0.0

    @classmethod
    def of(cls, terms: tuple[RelaxationTerm, ...], fading: float = 0.0) -> ModeBank:
        """Collect the exponentials of all terms; equal rates share one mode."""
        sums: dict[Drive, dict[float, float]] = {}
        for term in terms:
            of_rate = sums.setdefault(term.excitation, {})
            for rate, weight in zip(term.decay_rates, term.weights, strict=True):
                of_rate[rate] = of_rate.get(rate, 0.0) + term.amplitude * weight
        rates = sorted({rate for of_rate in sums.values() for rate, a in of_rate.items() if a})
        amplitudes = {drive: np.array([of_rate.get(r, 0.0) for r in rates]) for drive, of_rate in sums.items()}
        return cls(np.array(rates), amplitudes, fading if rates else 0.0)

    @property
    def size(self) -> int:
        """Number of modes."""
        return int(self.decay_rates.size)

    @property
    def signed(self) -> bool:
        """Whether a mode may be negative."""
        return any((amplitudes < 0.0).any() for amplitudes in self.amplitudes.values())

    def exponents(self, h: ca.MX, moved: ca.MX | None = None) -> ca.MX:
        """Return x [1], shape (n,), of a step ``h`` [s]; with fading (n, P), of strains that ``moved`` [1], shape (1, P)."""
        x = ca.DM(self.decay_rates) * h
        if not self.fading or moved is None:
            return x
        x = across(x, moved)
        return x + down(self.fading * moved, x)


def relax(bank: ModeBank, z: ca.MX, start: ca.MX, end: ca.MX, h: ca.MX) -> ca.MX:
    """Advance the modes [1], shape (n,), by ``h`` [s] in which strain moves linearly from ``start`` to ``end`` [1].

    Of P sensors side by side the modes have shape (n, P), and the strains (1, P).
    """
    x = bank.exponents(h, ca.fabs(end - start))
    z, kernels = decay(bank, z, x), (phi_1(x), phi_2(x))
    for strain, sign in DIRECTIONS.items():
        if any(drive.strain == strain for drive in bank.amplitudes):
            delta = ca.fmax(sign * (end - start), 0.0)
            first, second = excitation(bank, start, kernels, strain)
            delta = down(delta, z)
            z = z + delta * (first + delta * across(second, z))
    return z


def decay(bank: ModeBank, z: ca.MX, x: ca.MX) -> ca.MX:
    """Let the modes [1], shape (n,), decay by ``ModeBank.exponents`` x [1].

    They end in zero: subnormal numbers, which processors are slow with, would stay for hours of a simulated hold.
    """
    left = across(ca.exp(-x), z) * z
    if bank.signed:
        return ca.if_else(ca.fabs(left) > SMALLEST, left, 0.0)
    return ca.fmax(left - SMALLEST, 0.0)


def excitation(bank: ModeBank, start: ca.MX, kernels: tuple[ca.MX, ca.MX], strain: str) -> tuple[ca.MX, ca.MX]:
    r"""Prepare the response of the modes to a linear rise or fall within one step.

    Parameters
    ----------
    bank : ModeBank
        Rates and amplitudes.
    start : casadi.MX, scalar or shape (1, P)
        Normalised strain [1] at the start of the step.
    kernels : tuple of casadi.MX, shape (n,) or (n, P)
        :math:`\varphi_1(x)` and :math:`\varphi_2(x)` [1] of the step.
    strain : {"rising", "falling"}
        Direction of the strain.

    Returns
    -------
    first, second : casadi.MX, shape (n,); first (n, P) for P strains
        A move by :math:`\Delta \ge 0` adds :math:`\Delta\,(first + \Delta\,second)` to the modes [1]. Zero if nothing
        is driven this way; not negative on a rise if no amplitude is.

    Notes
    -----
    :math:`\int_0^h (g + k(s \pm \Delta\,\tau/h))\,(\Delta/h)\,e^{-x(1 - \tau/h)}\,d\tau
    = \Delta\,(g + k s)\,\varphi_1(x) \pm \Delta^2 k\,\varphi_2(x)`.
    In the printed Eq. (5.3) of the thesis, operators switched in the last step do not decay, :math:`\varphi_1 = 1`; the
    exact form costs no more, and a ramp may then be cut into any steps.
    """
    constant = linear = ca.DM.zeros(bank.size)
    for drive, amplitudes in bank.amplitudes.items():
        if drive.strain == strain and drive.power == 0:
            constant = constant + amplitudes
        elif drive.strain == strain:
            linear = linear + amplitudes
    first = (across(constant, start) + ca.mtimes(linear, start)) * across(kernels[0], start)
    if linear.is_zero():
        return first, ca.DM.zeros(bank.size)
    return first, DIRECTIONS[strain] * across(linear, kernels[1]) * kernels[1]


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
    residual : SmallNetwork or None
        Network that corrects the output (extension).
    """

    def __init__(self, artifact: SensorArtifact) -> None:
        self.mu, self.nu = artifact.tables()
        self.bank, self.gains = (
            ModeBank.of(tuple(term for term in artifact.relaxation if term.gain == gain), artifact.fading)
            for gain in (False, True)
        )
        self.residual = artifact.residual

    def rest(self, s: ca.MX) -> SensorState:
        """Return the state long after the first monotone loading to strain ``s`` [1]: relaxation is over."""
        front = resting_fronts(len(self.mu), s)
        up, down = cumulate(front, self.mu, self.nu)
        z, g = ca.DM.zeros(self.bank.size), ca.DM.zeros(self.gains.size)
        return SensorState(front, up, down, ca.sum1(up), s, z, g)

    def hold(self, state: SensorState, h: ca.MX) -> SensorState:
        """Return the state after ``h`` [s] at constant strain: only the modes decay."""
        z, g = (decay(bank, each, bank.exponents(h)) for bank, each in ((self.bank, state.z), (self.gains, state.g)))
        return replace(state, z=z, g=g)

    def output(self, state: SensorState) -> ca.MX:
        """Return the output [1] of a state, with the correction of the residual network if the sensor has one."""
        if self.residual is None:
            return state.output()
        return state.output() + self.residual.correction(self.features(state))

    def features(self, state: SensorState) -> ca.MX:
        """Return what a residual network sees [1]: strain, some fronts, and what every mode adds to the output."""
        fronts = state.front[sorted({max(1, line * len(self.mu) // 32) for line in FRONTS}), :]
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

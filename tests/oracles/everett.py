r"""Compensation as Chapter 5 of the thesis describes it: Everett surfaces and their inverse interpolation.

Symbols: ``h1`` last extreme of the strain, ``h2`` strain now [1], both normalised; the surfaces are the output [1] gained
by rising and lost by falling from ``h1`` to ``h2``, Eqs. (5.3) and (5.4); ``turns`` extremes that are still remembered.
Slow, in NumPy, with memory that grows: the reference for the exact inverse and for the surfaces that a fit draws.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gossamer_models import ParameterError
from gossamer_models.sensor import SensorArtifact
from gossamer_models.sensor.drives import THESIS
from gossamer_models.sensor.law import ModeBank
from numpy.typing import NDArray

Vector = NDArray[np.float64]


def everett_surfaces(artifact: SensorArtifact, points: int = 65) -> tuple[Vector, Vector, Vector]:
    """Tabulate both surfaces without relaxation.

    Parameters
    ----------
    artifact : SensorArtifact
        Identified sensor.
    points : int
        Points along an axis.

    Returns
    -------
    strain : ndarray, shape (points,)
        Normalised strain [1] along either axis.
    rising, falling : ndarray, shape (points, points)
        Change of the output [1] from an extreme (row) to a strain (column); not a number on the other side of it.
    """
    inverse = EverettInverse(replace(artifact, relaxation=(), inverse=None))
    strain = np.linspace(0.0, 1.0, points)
    changes = [np.array([inverse.surface(rising, h1, strain) for h1 in strain]) for rising in (True, False)]
    upper = strain[None, :] >= strain[:, None]
    return strain, np.where(upper, changes[0], np.nan), np.where(upper.T, changes[1], np.nan)


class EverettInverse:
    """Sample by sample inverse of one sensor.

    Parameters
    ----------
    artifact : SensorArtifact
        Identified sensor without an extension.
    points : int
        Points of the interpolation between two extremes; its error falls with their square.
    """

    def __init__(self, artifact: SensorArtifact, points: int = 257) -> None:
        if any(term.drive != "rising" or term.signed or term.gain for term in artifact.relaxation):
            msg = "Everett surfaces know the relaxation of the thesis only. Identify the sensor without an extension."
            raise ParameterError(msg)
        mu, nu = artifact.tables()
        n = artifact.n_lines
        self._width = np.arange(n) / n
        self._lattice = np.arange(n + 1) / n
        self._sums = {
            rising: np.hstack([np.zeros((n, 1)), np.cumsum(table, axis=1) / n])
            for rising, table in ((True, mu), (False, nu))
        }
        self._bank = ModeBank.of(artifact.relaxation)
        self._z = np.zeros(self._bank.size)
        self._constant, self._linear = (self._bank.amplitudes.get(drive, np.zeros(self._bank.size)) for drive in THESIS)
        self._points = points
        self._turns: list[float] = [0.0]
        self._rising = True
        self._f = 0.0
        self.strain = 0.0

    def surface(self, rising: bool, h1: float, h2: Vector) -> Vector:
        """Return the change of the static output [1] from the extreme ``h1`` to all of ``h2`` [1]."""
        total = np.zeros_like(h2)
        for width, sums in zip(self._width, self._sums[rising], strict=True):
            low, high = (h1, h2) if rising else (h2, np.full_like(h2, h1))
            gain = np.interp(high, self._lattice, sums) - np.interp(low + width, self._lattice, sums)
            total += np.where(high > low + width, gain, 0.0)
        return total if rising else -total

    def step(self, output: float, h: float) -> float:
        """Return the normalised strain [1] that explains an output [1] measured ``h`` [s] after the last one.

        Notes
        -----
        The decayed modes are subtracted, Eq. (5.7); the sign of the rest tells whether strain rises. Operators switched
        within the step count with their mean over a linear rise, where Eq. (5.3) takes them undecayed.
        """
        x = self._bank.decay_rates * h
        self._z *= np.exp(-x)
        target = output - self._f - self._z.sum()
        rising = target > 0.0
        phi_1 = -np.expm1(-x) / x
        phi_2 = (1.0 - phi_1) / x
        first = (self._constant + self._linear * self.strain) * phi_1
        second = self._linear * phi_2
        strain, change = self._ahead(rising)
        delta = strain - self.strain
        dynamic = delta * (first.sum() + delta * second.sum()) if rising else 0.0 * delta
        order = slice(None) if rising else slice(None, None, -1)
        found = float(np.interp(target, (change + dynamic)[order], strain[order]))
        gain = max(found - self.strain, 0.0)
        self._z += gain * (first + gain * second)
        self._move(found, float(np.interp(found, strain[order], change[order])))
        return found

    def _ahead(self, rising: bool) -> tuple[Vector, Vector]:
        """Return strains from here to the end of the range and the change of the static output on the way there [1]."""
        turns = [*self._turns, self.strain] if rising != self._rising else [*self._turns]
        here, total = self.strain, 0.0
        strains, changes = [np.array([here])], [np.array([0.0])]
        end = 1.0 if rising else 0.0
        while here != end:
            limit = turns[-2] if len(turns) > 1 else end
            part = np.linspace(here, limit, self._points)
            part = np.union1d(part, self._lattice[(self._lattice - here) * (self._lattice - limit) < 0.0])
            part = part if rising else part[::-1]
            change = total + self.surface(rising, turns[-1], part) - self.surface(rising, turns[-1], part[:1])
            strains.append(part[1:])
            changes.append(change[1:])
            here, total = limit, float(change[-1])
            turns = turns[:-2] or [0.0]
        return np.concatenate(strains), np.concatenate(changes)

    def _move(self, strain: float, change: float) -> None:
        """Remember the extreme that a reversal leaves, and forget those that are passed."""
        self._f += change
        if strain == self.strain:
            return
        rising = strain > self.strain
        if rising != self._rising:
            self._turns.append(self.strain)
            self._rising = rising
        while len(self._turns) > 1 and (strain - self._turns[-2]) * (1.0 if rising else -1.0) >= 0.0:
            del self._turns[-2:]
        if not self._turns:
            self._turns = [0.0]
            self._rising = True
        self.strain = strain

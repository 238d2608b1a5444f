"""What a watch says at the end of a window of readings."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Vector

COARSE = 0.1  # of the change of the readings: where finer elements add more, damage acts otherwise than on the mesh


@dataclass(frozen=True, kw_only=True)
class DamageOnset:
    """Damage that began while watched.

    Attributes
    ----------
    zones : tuple of str
        Names of the zones.
    onset, onset_deviation : float
        When it began, and its standard deviation [s].
    damage, deviation : ndarray, shape (zones,)
        Damage of every zone since then, and its standard deviation [1].
    chi2_per_sample : float
        Near 1 if this damage explains the readings.
    chi2_bound : float
        What it may be, by that of the first windows.
    mesh : float
        What finer elements add to the readings of a window, over their change: root mean squares; 0 if it is not known.
    """

    zones: tuple[str, ...]
    onset: float
    onset_deviation: float
    damage: Vector
    deviation: Vector
    chi2_per_sample: float
    chi2_bound: float
    mesh: float

    @property
    def explains(self) -> bool:
        """Whether this damage explains the readings."""
        return self.chi2_per_sample <= self.chi2_bound

    @property
    def valid(self) -> bool:
        """Whether this damage explains the readings, on a mesh that is fine enough; else zones and onset are of no use."""
        return self.explains and self.mesh <= COARSE


@dataclass(frozen=True, kw_only=True)
class Window:
    """What one window of readings says.

    Attributes
    ----------
    time : float
        End of the window [s].
    evidence : ndarray, shape (zones,)
        Largest score of new damage in each zone, over what raises an alarm [1].
    sees : ndarray, shape (zones,)
        Damage of each zone that would raise an alarm in nine of ten cases if it began in the last windows [1]; infinite in
        the first window, where all of its effect could be something else, and where the mesh is too coarse to tell.
    alarm : bool
        Whether new damage is certain.
    misfit : float
        Chi2 per sample of the readings about the twin's prediction.
    mesh : float
        What finer elements add to the prediction, over its change: root mean squares; 0 if it is not known.
    left : ndarray, shape (sensors,)
        Root mean square of what this prediction leaves of each sensor, over its noise [1]; not a number without readings.
    finding : DamageOnset or None
        Onset and damages, at the end of the window after an alarm, and of the next ones until they explain the readings.
    blamed : tuple of int
        Sensor, from 1, that the alarm came from: no damage explains what it reads, and all others read what none explains.
    without : tuple of int
        Sensors, from 1, that are left out: without readings, those that repeat one while others move, and blamed ones.
    """

    time: float
    evidence: Vector
    sees: Vector
    alarm: bool
    misfit: float
    mesh: float
    left: Vector
    finding: DamageOnset | None = None
    blamed: tuple[int, ...] = ()
    without: tuple[int, ...] = ()

    @property
    def statistic(self) -> float:
        """Largest score of new damage in one zone, over what raises an alarm [1]."""
        return float(self.evidence.max())

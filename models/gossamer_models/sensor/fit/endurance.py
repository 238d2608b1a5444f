"""Many cycles within the strain of some records, over which the output of a sensor with memory has to settle."""

from collections.abc import Sequence

import numpy as np

from ...arrays import Vector
from ..artifact import SensorArtifact
from .regression import Regression, switched
from .weights import normalised_output

CYCLES, SAMPLES = 100, 24  # per cycle
MOST_RANGE = 1.5  # of the output, in ranges of the records


def cycles(times: Sequence[Vector], strains: Sequence[Vector]) -> tuple[Vector, Vector]:
    """Return times [s] and strains of ``CYCLES`` sine cycles within the strain of some histories, at their mean rate.

    The mean counts a rate by the strain that moves at it, so rests do not count.
    """
    moves = np.concatenate([np.abs(np.diff(s)) for s in strains])
    steps = np.concatenate([np.diff(t) for t in times])
    rate = float(moves @ (moves / steps)) / float(moves.sum())
    lowest, size = min(float(s.min()) for s in strains), float(np.ptp(np.concatenate(strains)))
    turn = np.arange(CYCLES * SAMPLES + 1) / SAMPLES
    return 2.0 * size / rate * turn, lowest + size * 0.5 * (1.0 - np.cos(2.0 * np.pi * turn))


def settled_range(sensor: SensorArtifact, regression: Regression) -> float:
    """Return the range of the normalised output [1] over cycles within all fitted strain, from rest."""
    fitted = [s for s in regression.stretches if s.train.any()]
    time, strain = cycles([s.record.time[s.train] for s in fitted], [s.strain[s.train] for s in fitted])
    return float(np.ptp(normalised_output(sensor, time, strain, *switched(strain, sensor.n_lines))))

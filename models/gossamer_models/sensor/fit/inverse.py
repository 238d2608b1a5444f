"""The direct inverse from resistance to strain: a fit to records with both exchanged, operators of either sign."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Rows
from ...fitting.records import Record
from ..artifact import MIN_SPRING_WEIGHT
from .regression import Stretch
from .settings import PreisachSettings

SHORTEST, LONGEST = 0.15, 0.25  # of a sample and of the record: times of the kernels
LEAST_RELAXATIONS = 7


@dataclass(frozen=True, slots=True, kw_only=True)
class Turned:
    """Records whose strain is the sensor's output and whose output is the strain.

    Attributes
    ----------
    records : tuple of Record
        The fitted records, output over its range in place of strain.
    train : tuple of ndarray of bool
        Samples to fit.
    lowest, highest : float
        Normalised output [1] at the ends of that range.
    """

    records: tuple[Record, ...]
    train: tuple[Rows, ...]
    lowest: float
    highest: float


def turn(stretches: tuple[Stretch, ...], y0: float, rise: float) -> Turned:
    """Exchange strain and resistance, which is ``y0 + rise * normalised output``."""
    fitted = [s for s in stretches if s.train.any()]
    outputs = [(s.y - y0) / rise for s in fitted]
    lowest = min(float(v[s.train].min()) for v, s in zip(outputs, fitted, strict=True))
    highest = max(float(v[s.train].max()) for v, s in zip(outputs, fitted, strict=True))
    records = tuple(
        replace(s.record, strain=np.clip((v - lowest) / (highest - lowest), 0.0, 1.0), resistance=s.strain)
        for v, s in zip(outputs, fitted, strict=True)
    )
    return Turned(records=records, train=tuple(s.train for s in fitted), lowest=lowest, highest=highest)


def inverse_settings(turned: Turned, forward: PreisachSettings) -> PreisachSettings:
    """Return how to fit turned records: with as many kernels as forward, and a gain where the sensor has one."""
    shortest = min(float(np.median(np.diff(r.time))) for r in turned.records)
    longest = max(float(np.ptp(r.time[rows])) for r, rows in zip(turned.records, turned.train, strict=True))
    tau = np.geomspace(SHORTEST * shortest, LONGEST * longest, max(forward.relaxations, LEAST_RELAXATIONS))
    how = forward.inverse
    return PreisachSettings(
        density="hats",
        knots=how.knots,
        relaxations=tau.size,
        tau=tuple(tau.tolist()),
        exponents=(1.0,) * tau.size,
        extension=how.extension or ("reversing" if any(drive.gain for drive in forward.drives) else "falling"),
        signed=True,
        eta=(1.0, 1.0),
        ridge=how.ridge,
        earlier=forward.earlier if how.earlier is None else how.earlier,
        least_slope=MIN_SPRING_WEIGHT,
        least_weight=0.0,
        starts=1,
    )

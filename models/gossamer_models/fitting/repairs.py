"""Samples of one file: repair or refuse them by the rules of ``reading.py``."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..arrays import Rows, Vector
from ..errors import DataError
from .found import LONGEST_GAP

MOST_MISSING = 0.05
GAP_STRAIN = 0.05
DAY, MIDNIGHT = 86400.0, 3600.0  # [s]; how far apart two times of day on both sides of midnight may be
LARGEST_JUMP = 30.0  # of the output between two samples: a meter that changed its unit
LARGEST_RATIO = 1.0  # [1]; more strain, without a stated unit, may be in per cent; normalised strain reaches 1
LEAST_STRAIN = -0.01  # of the range: a drifted zero of the meter


@dataclass(slots=True)
class Samples:
    """Samples of a file by column, and their repairs, one sentence each."""

    path: Path
    columns: list[Vector]
    lines: NDArray[np.int_]
    strain_unit_stated: bool
    repairs: list[str] = field(default_factory=list)

    def keep(self, rows: Rows | NDArray[np.int_]) -> None:
        """Keep some samples."""
        self.columns = [c[rows] for c in self.columns]
        self.lines = self.lines[rows]


def drop_missing(samples: Samples, first: str, advice: str) -> None:
    """Leave out samples without a finite number; ``first`` has the cells of the first of them, ``advice`` what to do."""
    good = np.all([np.isfinite(c) for c in samples.columns], axis=0)
    missing = int((~good).sum())
    if not missing:
        return
    line = int(samples.lines[~good][0])
    if missing > MOST_MISSING * good.size:
        msg = (
            f"{samples.path}, line {line}: {missing} of {good.size} samples hold no finite number, more than "
            f"{100 * MOST_MISSING:g} %. It reads {first}. {advice}."
        )
        raise DataError(msg)
    which = "sample without a finite number was" if missing == 1 else "samples without a finite number were"
    samples.repairs.append(f"{missing} {which} left out, the first in line {line}: {first}")
    samples.keep(good)


def order_times(samples: Samples, *, sort: bool) -> None:
    """Average repeated times; sort times that go backwards, or refuse them."""
    time = samples.columns[0]
    back = np.flatnonzero(np.diff(time) < 0.0)
    drop = time[back[0]] - time[back[0] + 1] if back.size else 0.0
    midnight = DAY - MIDNIGHT < drop <= DAY  # sorting would tear the record
    if back.size and (midnight or not sort):
        line = int(samples.lines[back[0] + 1])
        first, second = time[back[0]], time[back[0] + 1]
        remedy = "It passes midnight: write dates before the times" if midnight else "Sort the record (--sort)"
        msg = f"{samples.path}, line {line}: time goes backwards, {first:g} s to {second:g} s. {remedy}."
        raise DataError(msg)
    if back.size:
        samples.repairs.append(
            f"samples were sorted by time, the first out of order in line {samples.lines[back[0] + 1]}"
        )
        samples.keep(np.argsort(time, kind="stable"))
        time = samples.columns[0]
    again = np.flatnonzero(np.diff(time) == 0.0)
    if again.size:
        samples.repairs.append(
            f"{again.size} repeated times were averaged, the first in line {samples.lines[again[0] + 1]}"
        )
        _, first, group = np.unique(time, return_index=True, return_inverse=True)
        count = np.bincount(group)
        samples.columns = [np.bincount(group, weights=c) / count for c in samples.columns]
        samples.columns[0] = time[first]
        samples.lines = samples.lines[first]


def check(samples: Samples) -> None:
    """Refuse a record that cannot be that of a sensor, or whose strain may be in per cent."""
    time, strain, resistance = samples.columns
    size = float(np.ptp(strain)) if strain.size else 0.0
    if time.size < 3 or not size > 0.0 or not np.ptp(resistance) > 0.0:
        what = "too short" if time.size < 3 else "of constant strain" if not size > 0.0 else "of constant output"
        lines = f"lines {samples.lines[0]} to {samples.lines[-1]}"
        msg = f"{samples.path}, {lines}: the record is {what}. Name a record with loading."
        raise DataError(msg)
    negative = np.flatnonzero(strain < LEAST_STRAIN * size)
    if negative.size:
        k = int(negative[0])
        msg = f"{samples.path}, line {samples.lines[k]}: strain {strain[k]:g} is negative. Subtract the strain at rest."
        raise DataError(msg)
    if not samples.strain_unit_stated:
        large = np.flatnonzero(strain > LARGEST_RATIO)
        if large.size:
            k = int(large[0])
            msg = (
                f"{samples.path}, line {samples.lines[k]}: strain {strain[k]:g} has no unit, and may be {strain[k]:.0%} or "
                f"{strain[k]:g} %. State it (--strain-unit 1 or --strain-unit %)."
            )
            raise DataError(msg)
    level = np.maximum(np.abs(resistance), 1e-2 * np.abs(resistance).max())
    jumps = np.flatnonzero(np.abs(np.diff(np.log(level))) >= np.log(LARGEST_JUMP) - 1e-9)
    if jumps.size:
        k = int(jumps[0]) + 1
        msg = (
            f"{samples.path}, line {samples.lines[k]}: the output jumps from {resistance[k - 1]:g} to {resistance[k]:g}, "
            "as if its unit changed there. Convert the record to one unit."
        )
        raise DataError(msg)
    steps = np.diff(time)
    gaps = np.flatnonzero((steps > LONGEST_GAP * np.median(steps)) & (np.abs(np.diff(strain)) > GAP_STRAIN * size))
    if gaps.size:
        k = int(gaps[0]) + 1
        msg = (
            f"{samples.path}, line {samples.lines[k]}: a gap of {steps[k - 1]:g} s in which strain changes by "
            f"{abs(strain[k] - strain[k - 1]):g}; what switched there is unknown. Cut the record there into two files."
        )
        raise DataError(msg)

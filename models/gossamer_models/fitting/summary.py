"""What was recognised in a file: shown before a fit, so that no unit, gap or column is assumed without a word."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gossamer_files.measured import Column
from numpy.typing import NDArray

from ..arrays import Vector

LONGEST_GAP = 20.0  # median steps; a longer step is a gap
LARGE_STRAIN = 0.5  # [1] a strain without a unit that reaches this may be in per cent


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """One recognised column and its range.

    Attributes
    ----------
    column : Column
        Name and unit.
    lowest, highest : float
        Range [SI].
    """

    column: Column
    lowest: float
    highest: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """A long step between two samples.

    Attributes
    ----------
    seconds, strain : float
        Its length [s] and the change of strain over it [1].
    line : int
        Line of the sample after it.
    """

    seconds: float
    strain: float
    line: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordSummary:
    """What was recognised in one file.

    Attributes
    ----------
    written : str
        Encoding, delimiter, decimal mark and where the header stands, where they are not the usual ones.
    quantities : tuple of Quantity
        Time, strain and resistance; no time for a record without a clock.
    samples, rows : int
        Number of samples that were kept, and of rows below the header.
    step, shortest, longest : float
        Median, smallest and largest step between samples [s].
    gaps : tuple of Gap
        Steps longer than ``LONGEST_GAP`` median steps.
    """

    written: str
    quantities: tuple[Quantity, ...]
    samples: int
    rows: int
    step: float
    shortest: float
    longest: float
    gaps: tuple[Gap, ...]

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a user should confirm, one sentence each."""
        sentences = []
        for each in self.quantities:
            c = each.column
            if c.others:
                sentences.append(
                    f"{c.name!r} is taken as {c.what}; {' and '.join(map(repr, c.others))} may be it too (--{c.what})."
                )
            if c.unit is None and c.what == "strain" and each.highest >= LARGE_STRAIN:
                sentences.append(
                    f"strain has no unit: read as a ratio, it reaches {each.highest:.0%}. If it is in per cent, give "
                    "--strain-unit %."
                )
        if self.gaps:
            longest = max(self.gaps, key=lambda gap: gap.seconds)
            sentences.append(
                f"{len(self.gaps)} gap{'s' if len(self.gaps) > 1 else ''} longer than {LONGEST_GAP:g} steps, the longest of "
                f"{longest.seconds:g} s before line {longest.line}, where strain changes by {longest.strain:.3g}. Strain is "
                "taken as linear in between; if it moved, cut the record there."
            )
        return tuple(sentences)


def gaps_of(time: Vector, strain: Vector, lines: NDArray[np.int_]) -> tuple[Gap, ...]:
    """Return the long steps of a record."""
    steps = np.diff(time)
    return tuple(
        Gap(seconds=float(steps[k]), strain=float(abs(strain[k + 1] - strain[k])), line=int(lines[k + 1]))
        for k in np.flatnonzero(steps > LONGEST_GAP * np.median(steps))
    )

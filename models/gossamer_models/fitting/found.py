"""What was recognised in a file: shown before a fit, so that no unit, gap or column is assumed without a word."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Vector
from .columns import Column

LONGEST_GAP = 20.0  # median steps; a longer step is a gap
WHOLE_STEP = 1.0  # times without a unit that are whole numbers and at least this far apart may be s, ms or a count
LONG_STEP = 5.0  # and so may any that are this far apart
LARGE_STRAIN = 0.5  # [1] a strain without a unit that reaches this may be in per cent
DELIMITERS = {";": "semicolons", "\t": "tabs", " ": "spaces"}


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
class Found:
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


def written(encoding: str, header_line: int, delimiter: str, *, comma: bool) -> str:
    """Say how a file is written, as far as it is not usual."""
    unusual = [] if encoding.startswith("utf-8") else [encoding.upper().removesuffix("-LE").removesuffix("-BE")]
    if delimiter != ",":
        unusual.append(f"{DELIMITERS[delimiter]} between cells")
    if comma:
        unusual.append("decimal commas")
    if header_line > 1:
        unusual.append(f"header in line {header_line}")
    return ", ".join(unusual)


def gaps_of(time: Vector, strain: Vector, lines: NDArray[np.int_]) -> tuple[Gap, ...]:
    """Return the long steps of a record."""
    steps = np.diff(time)
    return tuple(
        Gap(seconds=float(steps[k]), strain=float(abs(strain[k + 1] - strain[k])), line=int(lines[k + 1]))
        for k in np.flatnonzero(steps > LONGEST_GAP * np.median(steps))
    )


def unclear_clock(column: Column, time: Vector) -> str | None:
    """Return why times without a unit cannot be read as seconds; None if they can."""
    if column.unit is not None or time.size < 2:
        return None
    step = float(np.median(np.diff(time)))
    whole = bool((time == np.rint(time)).all())
    if step <= LONG_STEP and not (whole and step >= WHOLE_STEP):
        return None
    kind = "whole numbers" if whole else "numbers"
    return (
        f"column {column.name!r} has no unit, and its {kind} {step:g} apart may be seconds, milliseconds or a count. State "
        "it (--time-unit s or --time-unit ms), or give the sampling step."
    )

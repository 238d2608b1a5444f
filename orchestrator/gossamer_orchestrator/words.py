"""Numbers with their words: counts, lists, durations, and values with what they are uncertain by."""

from __future__ import annotations

import math
from collections.abc import Sequence

LONGEST = 200  # characters of a value in a message
MOST_DIGITS = 9  # behind the point
SMALL = 1e-3  # values below it that are known to its square have a power of ten in common with their deviation


def counted(number: int, thing: str) -> str:
    """Return ``1 window`` or ``2 windows``."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def first_few(texts: Sequence[str], most: int = 4) -> str:
    """Return the first texts, and how many more there are."""
    return ", ".join(texts[:most]) + (f" and {len(texts) - most} more" if len(texts) > most else "")


def brief(value: object) -> str:
    """Return how Python writes a value, of a long text its two ends only."""
    text = repr(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]}...{text[-LONGEST // 4 :]}"


def recorded(variables: int, scalars: int) -> str:
    """Return how much is recorded: variables, arrays whole, and the scalars that these are where there are arrays."""
    return counted(variables, "variable") + (f" ({scalars} scalars)" if scalars > variables else "")


def duration(seconds: float) -> str:
    """Return a duration in s, a shorter one than a second in ms, in at most three digits, as ``7.2 ms``."""
    value, unit = (seconds, "s") if seconds >= 1.0 else (1e3 * seconds, "ms")
    return f"{float(f'{value:.3g}'):.12g} {unit}"


def between(low: float, high: float) -> str:
    """Return bounds [%] of a damage as ``3 to 11``, or ``below 14`` where the lower one is 0."""
    return f"{low:.0f} to {high:.0f}" if low > 0.0 else f"below {high:.0f}"


def percent(share: float) -> str:
    """Return a share as percent in two digits, as ``12 %``."""
    if 0.0 < share < 1e-4:
        return "less than 0.01 %"
    return f"{float(f'{100.0 * share:.2g}'):.12g} %"


def uncertain(value: float, deviation: float, unit: str = "") -> str:
    """Return a value and its standard deviation in one unit, both with the digits that the deviation leaves.

    Parameters
    ----------
    value, deviation : float
        In the same unit.
    unit : str
        Stands behind both; none behind a ratio.

    Returns
    -------
    str
        For instance ``0.767098 ± 0.000003 s``; with a deviation of 0 the value alone, in six digits. Small
        ones have a power of ten in common: ``(-16.7 ± 0.4)e-6``.
    """
    after = f" {unit}" if unit else ""
    if not math.isfinite(deviation):
        return f"{value:.6g} ± unknown{after}"
    if abs(value) < SMALL and 0.0 < deviation < SMALL**2:
        power = -3 * math.floor(math.log10(max(abs(value), deviation)) / 3.0)
        return f"({uncertain(value * 10.0**power, deviation * 10.0**power)})e-{power}{after}"
    if deviation < 10.0**-MOST_DIGITS:
        return f"{value:.6g}{f' ± {deviation:.1g}' if deviation else ''}{after}"
    digits = -math.floor(math.log10(deviation / 2.0))  # one digit of a deviation, two where the first is 1
    digits = min(max(digits, 0), MOST_DIGITS)
    return f"{round(value, digits) + 0.0:.{digits}f} ± {deviation:.{digits}f}{after}"  # + 0.0: no minus before zeros

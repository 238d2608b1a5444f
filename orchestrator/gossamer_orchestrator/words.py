"""Numbers with their words: counts and durations."""

from __future__ import annotations


def counted(number: int, thing: str) -> str:
    """Return ``1 window`` or ``2 windows``."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def duration(seconds: float) -> str:
    """Return a duration in s, a shorter one than a second in ms, in at most three digits, as ``7.2 ms``."""
    value, unit = (seconds, "s") if seconds >= 1.0 else (1e3 * seconds, "ms")
    return f"{float(f'{value:.3g}'):.12g} {unit}"

"""Words of a page: as HTML, and with what belongs together on one line."""

from __future__ import annotations

import re
from html import escape

NO_BREAK = "\N{NO-BREAK SPACE}"
UNITS = ("%", "s", "ms", "h", "min", "Hz", "kHz", "Pa", "kPa", "GPa", "ohm", "m", "mm", "kg", "N", "rad", "MB", "GB")
_BEFORE_UNIT = re.compile(rf"(?<=\d) (?=(?:{'|'.join(UNITS)})(?!\w))")
_AROUND_SIGN = re.compile(r"(?<=\d) ± (?=\d)|(?<=±) (?=\d)|(?<=\bt) = (?=\d)")


def unbroken(words: str) -> str:
    """Return words in which no line ends between a number and its unit, its deviation or its ``t =``."""
    joined = _BEFORE_UNIT.sub(NO_BREAK, words)
    return _AROUND_SIGN.sub(lambda found: found[0].replace(" ", NO_BREAK), joined)


def written(words: object) -> str:
    """Return words as HTML."""
    return escape(unbroken(str(words)))

"""Names: patterns such as ``damage[*]``, endpoints such as ``sensor1.strain``, and suggestions for a misspelled one.

FMI's structured names contain brackets, so the only wildcards are ``*`` and ``?``.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from fnmatch import fnmatchcase


def matches(pattern: str, name: str) -> bool:
    """Tell whether a name fits a pattern in which ``*`` stands for any text and ``?`` for one character."""
    return fnmatchcase(name, pattern.replace("[", "[[]"))


def is_pattern(text: str) -> bool:
    """Tell whether a text contains a wildcard."""
    return "*" in text or "?" in text


def split_endpoint(endpoint: str) -> tuple[str, str]:
    """Split ``component.variable`` at its first dot; the variable is empty if there is none."""
    component, _, variable = endpoint.partition(".")
    return component, variable


def split_indices(name: str) -> tuple[str, tuple[int, ...]]:
    """Split ``w[2,3]`` into ``("w", (2, 3))``; a scalar has no indices."""
    found = re.fullmatch(r"(.+)\[(\d+(?:,\d+)*)\]", name)
    if found is None:
        return name, ()
    return found[1], tuple(int(i) for i in found[2].split(","))


def _numbered(name: str, candidates: Iterable[str]) -> list[str]:
    """List what differs from a name in its number alone: elements of an array, or ``sensor1`` beside ``sensor9``."""
    base, indices = split_indices(name)
    if indices:
        return [each for each in candidates if split_indices(each)[1] and split_indices(each)[0] == base]
    stem = name.rstrip("0123456789")
    if stem in ("", name):
        return []
    return [each for each in candidates if each.rstrip("0123456789") == stem and each != stem]


def suggest(name: str, known: Iterable[str]) -> str:
    """Suggest the known name that was probably meant, or list some.

    Returns
    -------
    str
        A sentence, for instance ``Did you mean 'strain'?``.
    """
    candidates = list(known)
    elements = [candidate for candidate in candidates if candidate.startswith(f"{name}[")]
    if elements:
        return f"It is an array: {elements[0]} .. {elements[-1]}."
    numbered = _numbered(name, candidates)
    if len(numbered) > 1:
        return f"There are {len(numbered)}: {numbered[0]} .. {numbered[-1]}."
    close = difflib.get_close_matches(name, candidates, n=1)
    if close:
        return f"Did you mean {close[0]!r}?"
    if not candidates:
        return "There are none."
    return f"Known: {', '.join(candidates[:8])}{', ...' if len(candidates) > 8 else '.'}"

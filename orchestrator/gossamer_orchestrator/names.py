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


def _numbered(name: str) -> tuple[str, tuple[int, ...]]:
    """Split ``w[2,3]`` and ``sensor9`` into what their kind shares and their numbers; others have none."""
    base, indices = split_indices(name)
    if indices:
        return f"{base}[]", indices
    stem = name.rstrip("0123456789")
    return (stem, (int(name[len(stem) :]),)) if stem not in ("", name) else (name, ())


def _range(name: str, candidates: Iterable[str]) -> str:
    """Say which candidates differ from a name in their numbers alone, if its own are beyond all of theirs; else nothing."""
    kind, wanted = _numbered(name)
    found = sorted((_numbered(each)[1], each) for each in candidates if wanted and _numbered(each)[0] == kind)
    alike = zip(wanted, *(numbers for numbers, _ in found), strict=False)
    if len(found) < 2 or (len(wanted) == len(found[0][0]) and all(min(there) <= k <= max(there) for k, *there in alike)):
        return ""
    return f"There are {len(found)}: {found[0][1]} .. {found[-1][1]}."


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
    if beyond := _range(name, candidates):
        return beyond
    close = difflib.get_close_matches(name, candidates, n=1)
    if close:
        return f"Did you mean {close[0]!r}?"
    if not candidates:
        return "There are none."
    return f"Known: {', '.join(candidates[:8])}{', ...' if len(candidates) > 8 else '.'}"

"""What was asked for and not reached: found from the figures, explained by hand."""

from __future__ import annotations

import re
from collections.abc import Iterable

from gossamer_models.identification import Figure

from .tables import number

LIMITS = (  # pattern of what was asked, and why it was not reached; the first that matches
    (
        r"sub-model",
        "The sub-models of model-2 are linear in strain and the specimen is not: the floors below Tables 3.1 and 3.2 "
        "hold for any number of terms.",
    ),
    (
        r"Dataset-2",
        "Dataset-2 strains the specimen twice as far, and twice as fast, as the stretch that is fitted: of its "
        "Preisach plane three quarters, and every nonlinearity beyond 7.5 %, are extrapolation. Fitted to both data "
        "sets at once, model-1 comes to what its floor above says.",
    ),
    (
        r"Dataset-1",
        "From 200 s to 400 s the specimen rests: relaxation slower than the fitted 200 s is extrapolation. The floor "
        "of the noise stands below Tables 3.1 and 3.2.",
    ),
    (
        r"faster than",
        "The iterations alone are a small part of the fit; most of its time prepares expressions and matrices, which "
        "the peer is given ready.",
    ),
    (
        r"strain_triangular",
        "The measured loop grows in amplitude from cycle to cycle; a model whose loop only shifts cannot show that.",
    ),
    (
        r"eta wrong",
        "With η 2 % wrong and no strain ever known, resistance alone does not tell the truth from another strain "
        "within range. Telling the strain now and then removes it.",
    ),
)
UNKNOWN = "What limits these is not established."


def section(figures: Iterable[Figure]) -> list[str]:
    """Return the list of misses, grouped by what limits them."""
    groups: dict[str, list[Figure]] = {}
    for figure in figures:
        if figure.met is False:
            groups.setdefault(limit_of(figure), []).append(figure)
    lines = ["", "## Asked but not reached, and what limits it", ""]
    if not groups:
        return [*lines, "Nothing."]
    for text, missed in sorted(groups.items(), key=lambda group: group[0] == UNKNOWN):
        said = "; ".join(f"{f.what}: {number(f.reached)} for {f.asked:g} {f.unit}" for f in missed)
        lines.append(f"- **{text}** {said}.")
    return lines


def limit_of(figure: Figure) -> str:
    """Return what limits a figure."""
    for pattern, text in LIMITS:
        if re.search(pattern, figure.what):
            return text
    return UNKNOWN

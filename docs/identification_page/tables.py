"""Markdown tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from gossamer_models.identification import Figure


def table(head: Sequence[str], body: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table."""
    return [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *body)]


def number(value: float | None) -> str:
    """Return a number with three digits, or a dash for none."""
    if value is None:
        return "-"
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def verdict(*met: bool | None) -> str:
    """Return whether numbers were reached, each; nothing for those that nobody asked for."""
    return " / ".join({True: "yes", False: "**no**", None: "-"}[each] for each in met)


def reached(figure: Figure) -> str:
    """Return a number beside what was asked for."""
    if figure.asked is None:
        return number(figure.reached)
    asked = f"asked {figure.asked:g}"
    return f"{number(figure.reached)} ({asked})" if figure.met else f"**{number(figure.reached)}** ({asked})"


def listed(figures: Iterable[Figure]) -> list[str]:
    """Return figures as a table, one a row."""
    return table(("what", "unit", "reached"), [(f.what, f.unit, reached(f)) for f in figures])

"""Numbers beside their targets, and Markdown tables of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """One number that a study computes.

    Attributes
    ----------
    what : str
        Record, model and quantity.
    unit : str
        Its unit.
    value : float
        The result.
    target : float or None
        What it is compared with; None for a number that is only reported.
    more_is_better : bool
        True for a speed-up.
    """

    what: str
    unit: str
    value: float
    target: float | None = None
    more_is_better: bool = False

    @property
    def met(self) -> bool | None:
        """Whether the value reaches the target; None without a target."""
        if self.target is None:
            return None
        return self.value >= self.target if self.more_is_better else self.value <= self.target


def table(head: Sequence[str], body: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table."""
    return [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *body)]


def listed(metrics: Iterable[Metric]) -> list[str]:
    """Return metrics as a table, one a row."""
    return table(("what", "unit", "reached"), [(m.what, m.unit, beside_target(m)) for m in metrics])


def number(value: float | None) -> str:
    """Return a number with three digits, or a dash for none."""
    if value is None:
        return "-"
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def verdict(*met: bool | None) -> str:
    """Return yes, no or a dash for each of several targets."""
    return " / ".join({True: "yes", False: "**no**", None: "-"}[each] for each in met)


def beside_target(metric: Metric) -> str:
    """Return the value of a metric and, if it has one, its target."""
    if metric.target is None:
        return number(metric.value)
    target = f"target {metric.target:g}"
    return f"{number(metric.value)} ({target})" if metric.met else f"**{number(metric.value)}** ({target})"

"""Mistakes in what a person described: where they are, so that the reader of a file can name the line."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from .errors import ParameterError


class Mistake(NamedTuple):
    """One thing that is wrong with a description.

    Attributes
    ----------
    place : tuple of str or int
        Keys that lead to it, from the table that was being made.
    text : str
        A sentence or two.
    name : str
        The name that is not known, if that is the mistake.
    known : tuple of str
        The names that are.
    """

    place: tuple[str | int, ...]
    text: str
    name: str = ""
    known: tuple[str, ...] = ()


class DescriptionError(ParameterError):
    """A description whose values do not go together.

    Attributes
    ----------
    mistakes : tuple of Mistake
        All that were found.
    """

    def __init__(self, *mistakes: Mistake) -> None:
        super().__init__("\n".join(m.text + f" Known: {', '.join(m.known)}." * bool(m.known) for m in mistakes))
        self.mistakes = mistakes


def outside(owner: object, **limits: tuple[float, float]) -> Iterator[Mistake]:
    """Refuse numbers that are not within their limits."""
    for name, (low, high) in limits.items():
        value = getattr(owner, name)
        if not low <= value <= high:
            yield Mistake((name,), f"{name!r} is {value:g}. Write a number from {low:g} to {high:g}.")


def not_finite(owner: object, *names: str) -> Iterator[Mistake]:
    """Refuse arrays with numbers that are not finite."""
    for name in names:
        if not all(math.isfinite(value) for value in getattr(owner, name)):
            yield Mistake((name,), f"{name!r} must be finite numbers.")


def no_direction(owner: object, name: str) -> Iterator[Mistake]:
    """Refuse a direction without a length."""
    if not 0.0 < math.hypot(*getattr(owner, name)) < math.inf:
        yield Mistake((name,), f"{name!r} must be three finite numbers that are not all zero.")


def disordered(name: str, pair: tuple[float, float], low: float, high: float) -> Iterator[Mistake]:
    """Refuse a pair that is not in order or reaches beyond its limits."""
    if not low <= pair[0] <= pair[1] <= high:
        within = f" from {low:g} to {high:g}" * math.isfinite(high)
        yield Mistake((name,), f"{name!r} is [{pair[0]:g}, {pair[1]:g}]. Write two numbers{within}, the lower one first.")


def raise_any(mistakes: list[Mistake]) -> None:
    """Raise ``DescriptionError`` with all mistakes, if there are any."""
    if mistakes:
        raise DescriptionError(*mistakes)

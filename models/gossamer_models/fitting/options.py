"""Fields of a settings class that a user may choose, and how a text is read for them."""

from __future__ import annotations

from dataclasses import field
from typing import Any


def fit_option(default: Any, *models: str) -> Any:  # noqa: ANN401
    """Declare a field that a user may choose, by default, and the models that have it; all of the settings class if none."""
    return field(default=default, metadata={"models": models})


def numbers(text: str) -> tuple[float, ...]:
    """Read a list of numbers, ``3,100``; raise ``ValueError`` with what to write for anything else."""
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        msg = "as numbers. Write them with commas: 3,100."
        raise ValueError(msg) from None


def number_or_auto(text: str) -> float | str:
    """Read a number or the word ``auto``; raise ``ValueError`` with what to write for anything else."""
    try:
        return text if text == "auto" else float(text)
    except ValueError:
        msg = "as a number. Write one number such as 0.01, or auto."
        raise ValueError(msg) from None


def count_or_auto(text: str) -> int | str:
    """Read a number of 0 or more or the word ``auto``; raise ``ValueError`` with what to write for anything else."""
    if text != "auto" and not text.isdecimal():
        msg = "as a count. Write a whole number such as 40, or auto."
        raise ValueError(msg)
    return text if text == "auto" else int(text)

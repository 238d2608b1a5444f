"""Fields of a settings class that a user may choose; the command ``gossamer identify`` gets its options from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import Any

Reader = Callable[[str], Any]


def option(
    default: Any,  # noqa: ANN401
    text: str,
    *,
    models: tuple[str, ...] = (),
    read: Reader | None = None,
    metavar: str | None = None,
    least: int | None = None,
) -> Any:  # noqa: ANN401
    """Declare a field that is an option of the command.

    Parameters
    ----------
    default : object
        Value of the field if the option is not given.
    text : str
        Help of the option.
    models : tuple of str
        Models that have the option; all of the settings class if empty.
    read : callable or None
        Turns the text of the option into its value; None for a number, a text or a switch, by the type of the field.
    metavar : str or None
        Placeholder of the value in the help.
    least : int or None
        Smallest value.
    """
    metadata = {"help": text, "models": models, "read": read, "metavar": metavar, "least": least}
    return field(default=default, metadata=metadata)


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

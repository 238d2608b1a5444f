"""``gossamer new``: a scenario to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import ScenarioError
from .command import Result, note, show


def new(
    name: Annotated[str, typer.Argument(help="Name of the scenario, or file to write; NAME.toml by default.")],
) -> Result:
    """Write a scenario of your own, with a comment on every table and key.

    It runs as it is: a membrane that loses stiffness, noisy sensors that lose samples, estimators and the detector. Prints
    its path. A file that is there is not overwritten.

    For example:

        gossamer new mine && gossamer build && gossamer run mine.toml
    """
    show(path := new_given(name))
    note(f"Build the FMUs with 'gossamer build', then run it with 'gossamer run {path}'.")
    return Result({"file": path})


def new_given(name: str) -> Path:
    """Write a scenario under the name or the path of the command; return its path."""
    from ..scenario.source import write_new

    path = Path(name) if name.endswith(".toml") else Path(f"{name}.toml")
    if path.stem.startswith("-") or not path.stem.replace("-", "_").isidentifier():
        msg = f"{path.stem!r} is no name of a scenario. Begin with a letter, and take letters, digits, _ and -."
        raise ScenarioError(msg)
    return write_new(path)

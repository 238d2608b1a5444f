"""Find files of scenarios, campaigns and membranes: shipped, beside the package in a checkout, or anywhere else."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from ..errors import ScenarioError, writing
from ..names import suggest

Kind = Literal["scenario", "campaign", "membrane"]
NEW = Path(__file__).with_name("new.toml")
_PACKAGE = Path(__file__).resolve().parent.parent


def shipped_scenarios(kind: Kind = "scenario") -> dict[str, Path]:
    """Return the shipped files of a kind by name."""
    for folder in (_PACKAGE / f"{kind}s", _PACKAGE.parent / f"{kind}s"):
        if folder.is_dir():
            return {path.stem: path for path in sorted(folder.glob("*.toml"))}
    return {}


def find_scenario(text: str, kind: Kind = "scenario") -> Path:
    """Return the file of a path or of the name of a shipped one.

    Raises
    ------
    ScenarioError
        There is neither.
    """
    shipped = shipped_scenarios(kind)
    path = Path(text)
    if path.is_file() or (path.suffix == ".toml" and path.stem not in shipped):
        return path  # a missing file is reported where it is read
    if path.stem in shipped and path.suffix in ("", ".toml") and path.parent == Path():
        return shipped[path.stem]
    msg = f"there is no {kind} file {text!r}, and no shipped {kind} of that name. {suggest(text, shipped)}"
    raise ScenarioError(msg)


def write_new(path: Path) -> Path:
    """Write a scenario with a comment on every table and key, and return its path.

    Raises
    ------
    ScenarioError
        There is such a file already, or it cannot be written.
    """
    text = NEW.read_text(encoding="utf-8").replace("{name}", path.stem).replace("{file}", str(path))
    try:
        with writing(path, ScenarioError), path.open("x", encoding="utf-8") as file:
            file.write(text)
    except ScenarioError as error:
        if isinstance(error.__cause__, FileExistsError):
            msg = f"{path} is there already. Take another name, or remove it."
            raise ScenarioError(msg) from None
        raise
    return path

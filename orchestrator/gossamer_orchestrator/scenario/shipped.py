"""Find files of scenarios, campaigns and membranes: shipped with the package, beside it in a checkout, or elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from ..errors import ScenarioError
from ..names import suggest

Kind = Literal["scenario", "campaign", "membrane"]
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

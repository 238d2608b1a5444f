"""Find scenario files: shipped with an installed package, beside it in a checkout, or anywhere else."""

from __future__ import annotations

from pathlib import Path

from ..errors import ScenarioError
from ..names import suggest

_PACKAGE = Path(__file__).resolve().parent.parent


def shipped_scenarios() -> dict[str, Path]:
    """Return the shipped scenario files by name."""
    for folder in (_PACKAGE / "scenarios", _PACKAGE.parent / "scenarios"):
        if folder.is_dir():
            return {path.stem: path for path in sorted(folder.glob("*.toml"))}
    return {}


def find_scenario(text: str) -> Path:
    """Return the scenario file of a path or of the name of a shipped scenario.

    Raises
    ------
    ScenarioError
        There is neither.
    """
    shipped = shipped_scenarios()
    path = Path(text)
    if path.is_file() or (path.suffix == ".toml" and path.stem not in shipped):
        return path  # a missing file is reported by load_scenario
    if path.stem in shipped and path.parent == Path():
        return shipped[path.stem]
    msg = f"there is no scenario file {text!r}, and no shipped scenario of that name. {suggest(text, shipped)}"
    raise ScenarioError(msg)

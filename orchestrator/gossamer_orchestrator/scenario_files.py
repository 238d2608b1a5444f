"""Where scenarios come from: shipped with an installed package or beside it in a checkout, a TOML file, an ``.ssp``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from .errors import ScenarioError
from .names import suggest

if TYPE_CHECKING:
    from .scenario import Scenario

_HERE = Path(__file__).resolve().parent


def shipped_scenarios() -> dict[str, Path]:
    """Return the shipped scenario files by name."""
    for folder in (_HERE / "scenarios", _HERE.parent / "scenarios"):
        if folder.is_dir():
            return {path.stem: path for path in sorted(folder.glob("*.toml"))}
    return {}


def find_scenario(text: str) -> Path:
    """Return the file that a user means by a path or by the name of a shipped scenario.

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


@contextmanager
def open_scenario(path: Path, *, step: float | None = None, stop: float | None = None) -> Iterator[Scenario]:
    """Read a scenario file or unpack an ``.ssp``, whose FMUs are there inside the ``with`` block only.

    Raises
    ------
    ScenarioError
        See ``load_scenario`` and ``open_ssp``.
    """
    if path.suffix == ".ssp":
        from .ssp_reader import open_ssp

        with open_ssp(path, step=step, stop=stop) as scenario:
            yield scenario
    else:
        from .scenario import load_scenario

        yield load_scenario(path, step=step, stop=stop)

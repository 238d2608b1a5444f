"""The folder of an FMU: ``interface.toml``, README and golden files."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

NAMES = ("membrane", "sensor", "compensator", "detector")


@dataclass(frozen=True, slots=True, kw_only=True)
class Interface:
    """What an FMU says about itself besides its model.

    Attributes
    ----------
    folder : Path
        Folder with the README and the golden files.
    title : str
        One line for the documentation.
    stop_time, step_size : float
        Default experiment [s].
    """

    folder: Path
    title: str
    stop_time: float
    step_size: float


def fmu_folder(name: str) -> Path:
    """Return the folder of an FMU, in a source checkout or in an installed package."""
    here = Path(__file__).parent
    installed, checkout = here / name, here.parent / name
    return installed if installed.is_dir() else checkout


def read_interface(name: str) -> Interface:
    """Read ``interface.toml`` of one of this project's FMUs."""
    folder = fmu_folder(name)
    with (folder / "interface.toml").open("rb") as file:
        return Interface(folder=folder, **tomllib.load(file))

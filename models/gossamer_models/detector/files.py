"""Files of trained detectors: those that ship with the package, and anybody's."""

from __future__ import annotations

from pathlib import Path

from ..artifacts import artifact_schema
from .artifact import DetectorArtifact
from .posterior_artifact import SCHEMA, PosteriorArtifact


def shipped_detectors() -> dict[str, Path]:
    """Return the files of the detectors that ship with the package by their names: nominal, single_damage, wide."""
    return {path.stem: path for path in sorted(Path(__file__).parent.glob("*.json"))}


def read_detector(file: Path) -> PosteriorArtifact | DetectorArtifact:
    """Read a trained detector of either kind.

    Parameters
    ----------
    file : Path
        Its card, or the name of one that ships with the package if there is no such file.

    Raises
    ------
    ArtifactError
        The file is missing, damaged, or no detector.
    """
    path = file if file.exists() else shipped_detectors().get(str(file), file)
    return PosteriorArtifact.read(path) if artifact_schema(path) == SCHEMA else DetectorArtifact.read(path)

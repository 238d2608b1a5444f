"""Files of trained detectors: those that ship with the package, and anybody's."""

from __future__ import annotations

from pathlib import Path

from ..artifacts import artifact_schema
from ..errors import ArtifactError
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
    shipped = shipped_detectors()
    path = file if file.is_file() else shipped.get(str(file), file)
    if not path.is_file():
        msg = f"there is no detector {file}. Name the JSON file of one, or one that ships: {', '.join(shipped)}."
        raise ArtifactError(msg)
    return PosteriorArtifact.read(path) if artifact_schema(path) == SCHEMA else DetectorArtifact.read(path)

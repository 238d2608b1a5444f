"""Refusals that the artifacts of both detectors share."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from gossamer_files import reason

from ..errors import ArtifactError


def require(condition: bool | np.bool_, problem: str) -> None:
    """Raise ``ArtifactError`` unless the content of an artifact is as it must be."""
    if not condition:
        msg = f"detector artifact: {problem}. Train the detector again."
        raise ArtifactError(msg)


@contextmanager
def usable(path: Path) -> Iterator[None]:
    """Turn what goes wrong while a detector is made of the content of a file into ``ArtifactError``."""
    try:
        yield
    except ArtifactError:
        raise
    except (KeyError, TypeError, ValueError, IndexError) as error:
        msg = f"{path} does not hold a usable detector: {reason(error)}. Train the detector again."
        raise ArtifactError(msg) from error

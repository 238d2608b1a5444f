"""A trained detector: reference indices, network weights and the baseline of each window."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..arrays import Vector
from ..artifacts import read_arrays, read_artifact, write_artifact
from ..errors import ArtifactError
from .packets import BLOCK

SCHEMA, VERSION = "gossamer.detector", 1
DEFAULT = Path(__file__).with_name("single_damage.json")
INDICES, ZONES = 16, 16


@dataclass(frozen=True, kw_only=True)
class DetectorArtifact:
    """Sixteen trained networks for each of c successive windows.

    Attributes
    ----------
    start_time, sampling_step : float
        Beginning of the first window and sampling step [s].
    samples : int
        Samples in a window, a multiple of 4.
    peaks : ndarray, shape (k,)
        Damage [1] at which each fuzzy set has membership one.
    baseline : ndarray, shape (c, 16)
        Packet energies of the undamaged structure, positive.
    references : ndarray, shape (c, n, 16)
        Logarithms of the damage feature indices of the reference cases [1].
    weights : ndarray, shape (c, n, 16)
        Distance weights W1_ij of reference i and index j, Eq. (6.1).
    bias : ndarray, shape (c,)
        Bias, Eq. (6.3).
    rules : ndarray, shape (c, k, n, 16)
        Weights from the similarities to the memberships in each network.
    provenance : dict
        How it was trained.
    """

    start_time: float
    sampling_step: float
    samples: int
    peaks: Vector
    baseline: Vector
    references: Vector
    weights: Vector
    bias: Vector
    rules: Vector
    provenance: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.references.ndim != 3:
            msg = f"detector artifact: references has shape {self.references.shape}, not (c, n, 16). Train it again."
            raise ArtifactError(msg)
        c, n, _ = self.references.shape
        shapes = {
            "baseline": (c, INDICES),
            "references": (c, n, INDICES),
            "weights": (c, n, INDICES),
            "bias": (c,),
            "rules": (c, self.peaks.size, n, ZONES),
        }
        for name, shape in shapes.items():
            array = getattr(self, name)
            if array.shape != shape:
                msg = f"detector artifact: {name} has shape {array.shape}, not {shape}. Train the detector again."
                raise ArtifactError(msg)
            if not np.isfinite(array).all():
                msg = f"detector artifact: {name} holds values that are not finite. Train the detector again."
                raise ArtifactError(msg)
        if not (self.start_time >= 0.0 and 0.0 < self.sampling_step < np.inf and (np.diff(self.peaks) > 0.0).all()):
            msg = "detector artifact: needs a start time and sampling step and increasing peaks. Train the detector again."
            raise ArtifactError(msg)
        if (self.weights < 0.0).any():
            msg = "detector artifact: distance weights must not be negative. Train the detector again."
            raise ArtifactError(msg)
        if (self.baseline <= 0.0).any() or self.samples < BLOCK or self.samples % BLOCK:
            msg = f"detector artifact: needs positive baseline energies and a multiple of 4 samples, not {self.samples}"
            raise ArtifactError(msg)

    @property
    def window_length(self) -> float:
        """Length of a window [s]."""
        return self.samples * self.sampling_step

    def write(self, path: Path) -> None:
        """Write the card and, beside it, the arrays."""
        names = ("peaks", "baseline", "references", "weights", "bias", "rules")
        content = {"start_time": self.start_time, "sampling_step": self.sampling_step, "samples": self.samples}
        arrays = {name: getattr(self, name) for name in names}
        write_artifact(path, SCHEMA, VERSION, self.provenance, content, arrays)

    @classmethod
    def read(cls, path: Path) -> DetectorArtifact:
        """Read what ``write`` wrote; raise ``ArtifactError`` if it is not that."""
        card = read_artifact(path, SCHEMA, VERSION)
        arrays = read_arrays(path, card)
        try:
            return cls(
                start_time=float(card["start_time"]),
                sampling_step=float(card["sampling_step"]),
                samples=int(card["samples"]),
                provenance=dict(card["provenance"]),
                **arrays,
            )
        except (KeyError, TypeError, ValueError) as error:
            if isinstance(error, ArtifactError):
                raise
            msg = f"{path} lacks something a detector needs: {error!r}. Train the detector again."
            raise ArtifactError(msg) from error

    @classmethod
    def default(cls) -> DetectorArtifact:
        """Read the artifact that is shipped with this package."""
        return cls.read(DEFAULT)

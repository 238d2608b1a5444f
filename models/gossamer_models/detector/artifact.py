"""A trained detector: reference indices, network weights and the baseline of each window."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..arrays import Vector
from ..artifacts import read_arrays, read_artifact, write_artifact
from .checks import require, usable
from .packets import BLOCK

SCHEMA, VERSION = "gossamer.detector", 1
DEFAULT = Path(__file__).with_name("single_damage.json")
INDICES, ZONES = 16, 16


@dataclass(frozen=True, kw_only=True)
class DetectorArtifact:
    """Sixteen trained networks for each of c successive windows, with n reference cases and k fuzzy sets.

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
        require(self.references.ndim == 3, f"references has shape {self.references.shape}, not (c, n, 16)")
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
            require(array.shape == shape, f"{name} has shape {array.shape}, not {shape}")
            require(np.isfinite(array).all(), f"{name} holds values that are not finite")
        require(self.start_time >= 0.0, f"start_time is {self.start_time:g} s, it must not be negative")
        require(0.0 < self.sampling_step < np.inf, f"sampling_step is {self.sampling_step:g} s, it must be positive")
        require((np.diff(self.peaks) > 0.0).all(), "the peaks must increase")
        require((self.weights >= 0.0).all(), "distance weights must not be negative")
        require((self.baseline > 0.0).all(), "baseline energies must be positive")
        whole = self.samples >= BLOCK and self.samples % BLOCK == 0
        require(whole, f"a window needs a multiple of {BLOCK} samples, not {self.samples}")

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
        """Read what ``write`` wrote; raise ``ArtifactError`` for a file that is missing, damaged or unusable."""
        card = read_artifact(path, SCHEMA, VERSION)
        arrays = read_arrays(path, card)
        with usable(path):
            return cls(
                start_time=float(card["start_time"]),
                sampling_step=float(card["sampling_step"]),
                samples=int(card["samples"]),
                provenance=dict(card["provenance"]),
                **arrays,
            )

    @classmethod
    def default(cls) -> DetectorArtifact:
        """Read the artifact that is shipped with this package."""
        return cls.read(DEFAULT)

"""A trained posterior network: features, weights and limits for each of successive windows, and what it is trained for."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from ..artifacts import artifact_schema, write_artifact
from ..errors import ArtifactError
from .artifact import DetectorArtifact, TrainedWindows, reading, require
from .features import Components

SCHEMA, VERSION = "gossamer.posterior_detector", 4
NOMINAL = Path(__file__).with_name("nominal.json")
# deviation of the noise of a sample that its campaign states, in units of ``Components.unit``
STATED = 0.02 / np.sqrt(12.0)
HEADS = 3  # of the network per zone: logit of P(damaged), mean, logarithm of the standard deviation

_HALF = ("axes", "directions", "encoder")  # half precision in the file
_DECODER = tuple(f"decoder_{kind}{layer}" for layer in (1, 2) for kind in "Wb")
_COMPONENTS = tuple(field.name for field in fields(Components))
_SINGLE = (*_COMPONENTS, "signs", "images", "rest", "latent", "scales", "directions", "errors", "limits")


@dataclass(frozen=True, kw_only=True)
class PosteriorWindow(Components):
    """The network of one window, with K components, H hidden values, L latent ones; strain is in its ``unit``.

    The decoder explains the E components of largest variance.

    Attributes
    ----------
    signs : ndarray, shape (m, s)
        Sign of each of ``modes`` in each of m images of a record: 1 alone, of a structure without mirror images.
    images : ndarray of int, shape (m, z)
        Zones, from 0, whose damage stands in the place of each zone in each image.
    rest : ndarray, shape (1,)
        Root mean square of what clean records have outside the components, per degree of freedom.
    encoder : tuple of ndarray
        Arrays of ``ResidualNetwork``, from K + 1 features to 3 heads of all zones.
    latent : ndarray, shape (H, L)
        From the last hidden values to what the decoder gets beside the damage.
    decoder : tuple of ndarray
        Weights and biases of two layers, from all zones + L values to E components in units of ``scales``.
    scales : ndarray, shape (E,)
        Units of the decoder.
    directions, errors : ndarray, shapes (E, E) and (E,)
        Principal axes of the errors of the decoder on clean records, and their root mean squares along them.
    limits : ndarray, shape (4,)
        Largest valid misfit outside the components, of the explanation and inside the components, and noise of a block
        mean.
    """

    signs: Matrix
    images: NDArray[np.int64]
    rest: Vector
    encoder: tuple[Matrix, ...]
    latent: Matrix
    decoder: tuple[Matrix, ...]
    scales: Vector
    directions: Matrix
    errors: Vector
    limits: Vector

    def __post_init__(self) -> None:
        size, K = self.axes.shape
        H, L = self.latent.shape
        sensors, images, E = len(self.modes), len(self.signs), self.scales.size
        shapes = {
            "unit": (1,),
            "modes": (sensors, sensors),
            "mean": (sensors, size),
            "signs": (images, sensors),
            "images": (images, self.zones),
            "sectors": (K,),
            "variances": (K,),
            "rest": (1,),
            "scales": (E,),
            "directions": (E, E),
            "errors": (E,),
            "limits": (4,),
        }
        found = {name: getattr(self, name).shape for name in shapes}
        require(found == shapes, f"its arrays have shapes {found}, not {shapes}")
        outputs = HEADS * self.zones
        layers = [(K + 1, H), (H,), *[(H, H), (H,)] * (len(self.encoder) // 2 - 2), (H, outputs), (outputs,)]
        require([a.shape for a in self.encoder] == layers, f"its network has layers {[a.shape for a in self.encoder]}")
        inner = self.decoder[0].shape[-1]
        layers = [(self.zones + L, inner), (inner,), (inner, E), (E,)]
        require([a.shape for a in self.decoder] == layers, f"its decoder has layers {[a.shape for a in self.decoder]}")
        for array in self.arrays().values():
            require(np.isfinite(array).all(), "it holds values that are not finite")
        require(
            np.isin(self.sectors, range(sensors)).all() and (np.diff(self.sectors) >= 0).all(),
            f"sectors are not 0 to {sensors - 1}",
        )
        require((np.sort(self.images) == np.arange(self.zones)).all(), "an image does not hold all zones, once each")
        for name in ("unit", "variances", "rest", "scales", "limits"):
            require((getattr(self, name) > 0.0).all(), f"{name} must be positive")

    @property
    def zones(self) -> int:
        """Number of zones."""
        return int(self.decoder[0].shape[0] - self.latent.shape[-1])

    def arrays(self) -> dict[str, Vector]:
        """Return all arrays by the names of the file."""
        named = {f"encoder_{k}": array for k, array in enumerate(self.encoder)}
        return {name: getattr(self, name) for name in _SINGLE} | named | dict(zip(_DECODER, self.decoder, strict=True))

    @classmethod
    def of(cls, arrays: dict[str, Vector]) -> PosteriorWindow:
        """Make a window from what ``arrays`` gave."""
        layers = sum(name.startswith("encoder_") for name in arrays)
        encoder, decoder = tuple(arrays[f"encoder_{k}"] for k in range(layers)), tuple(arrays[name] for name in _DECODER)
        single: dict[str, Any] = {name: arrays[name] for name in _SINGLE}
        single["images"] = single["images"].astype(np.int64)
        return cls(encoder=encoder, decoder=decoder, **single)


@dataclass(frozen=True, kw_only=True)
class PosteriorArtifact(TrainedWindows):
    """Trained networks of successive windows.

    Attributes
    ----------
    block : int
        Samples that are averaged.
    windows : tuple of PosteriorWindow
        The first, the second, ... window.
    periodic : bool
        Whether the last one judges all later windows: it was trained at any phase of the load. If not, later windows are
        not valid.
    losses : list of list of float
        Of each window: mean negative log likelihood of a training case, over equal parts of the steps.
    trained_over : dict
        Ranges of the training by quantity: zones, depth [1], noise [1], and what else varied.
    held_out : dict
        Errors on held-out cases: by kind of record, mean absolute errors [% damage], coverage [1] and shares of records.
    """

    block: int
    windows: tuple[PosteriorWindow, ...]
    periodic: bool
    losses: list[list[float]] = field(default_factory=list)
    trained_over: dict[str, list[float]] = field(default_factory=dict)
    held_out: dict[str, dict[str, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        require(2 <= self.block <= self.samples // 2, f"a block of {self.block} samples is none of {self.samples}")
        require(len(self.windows) > 0, "it has no windows")
        size = self.samples // self.block
        for window in self.windows:
            blocks = window.mean.shape[-1]
            require(blocks == size, f"its windows have {blocks} blocks, not {size}")
        named = len(self.names)
        require(named == self.zones, f"it names {named} zones, and its networks answer for {self.zones}")

    @property
    def sensors(self) -> int:
        """Number of sensors."""
        return len(self.windows[0].modes)

    @property
    def zones(self) -> int:
        """Number of zones."""
        return self.windows[0].zones

    @property
    def noise(self) -> float:
        """Deviation of a sample of strain [1] that a third of the records of the training have about."""
        return float(self.windows[0].unit[0] * STATED)

    def write(self, path: Path) -> None:
        """Write the card and, beside it, the arrays in single precision, axes and network in half."""
        content: dict[str, Any] = {
            **self.card(),
            "block": self.block,
            "windows": len(self.windows),
            "periodic": self.periodic,
            "losses": [[float(f"{loss:.6g}") for loss in window] for window in self.losses],
            "trained_over": self.trained_over,
            "held_out": self.held_out,
        }
        arrays: dict[str, Any] = {
            f"{number}_{name}": array.astype(np.float16 if name.startswith(_HALF) else np.float32)
            for number, window in enumerate(self.windows, start=1)
            for name, array in window.arrays().items()
        }
        write_artifact(path, SCHEMA, VERSION, self.provenance, content, arrays)

    @classmethod
    def read(cls, path: Path) -> PosteriorArtifact:
        """Read what ``write`` wrote; raise ``ArtifactError`` for a file that is missing, damaged or unusable."""
        with reading(path, SCHEMA, VERSION) as (card, arrays):
            of_window = [
                {name.partition("_")[2]: array for name, array in arrays.items() if name.startswith(f"{number}_")}
                for number in range(1, int(card["windows"]) + 1)
            ]
            return cls(
                **cls.of_card(card),
                block=int(card["block"]),
                windows=tuple(PosteriorWindow.of(found) for found in of_window),
                periodic=bool(card["periodic"]),
                losses=list(card.get("losses", [])),
                trained_over=dict(card["trained_over"]),
                held_out=dict(card["held_out"]),
            )

    @classmethod
    def default(cls) -> PosteriorArtifact:
        """Read the artifact that is shipped with this package: the nominal training."""
        return cls.read(NOMINAL)


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

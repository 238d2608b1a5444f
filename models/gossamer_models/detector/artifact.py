"""Trained detectors: the windows that they judge, and the networks of the thesis with the baseline of each window."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from gossamer_files import reason
from gossamer_files.options import option

from ..arrays import Vector
from ..artifacts import read_arrays, read_artifact, write_artifact
from ..errors import ArtifactError
from ..membrane import Setup, Structure, read_structure
from ..membrane.portable import TABLES
from ..twin.nuisances import LoadTable
from .features import BLOCK, PACKETS

SCHEMA, VERSION = "gossamer.detector", 1
DEFAULT = Path(__file__).with_name("single_damage.json")
ARRAYS = ("peaks", "baseline", "references", "weights", "bias", "rules")


def require(condition: bool | np.bool_, problem: str) -> None:
    """Raise ``ArtifactError`` unless the content of an artifact is as it must be."""
    if not condition:
        msg = f"detector artifact: {problem}. Train the detector again."
        raise ArtifactError(msg)


@contextmanager
def reading(path: Path, schema: str, version: int) -> Iterator[tuple[dict[str, Any], dict[str, Vector]]]:
    """Read card and arrays; turn what goes wrong while a detector is made of them into ``ArtifactError``."""
    card = read_artifact(path, schema, version)
    arrays = read_arrays(path, card)
    try:
        yield card, arrays
    except ArtifactError:
        raise
    except (KeyError, TypeError, ValueError, IndexError) as error:
        msg = f"{path} does not hold a usable detector: {reason(error)}. Train the detector again."
        raise ArtifactError(msg) from error


@dataclass(frozen=True, kw_only=True)
class TrainedWindows(ABC):
    """Successive windows that a detector is trained for.

    Attributes
    ----------
    start_time, sampling_step : float
        Beginning of the first window and sampling step [s].
    samples : int
        Samples in a window, a multiple of 4.
    zone_names : tuple of str
        What the zones are called; empty for zone 1, zone 2, ...
    structure : str
        Membrane on a mesh that it is trained for, as ``structure_text`` writes it; empty for the square.
    parameters : dict of str to float
        Parameters and constant inputs of that membrane which differ from its own.
    load : LoadTable or None
        Inputs over time that are not the built-in pressure.
    provenance : dict
        How it was trained.
    """

    start_time: float
    sampling_step: float
    samples: int
    zone_names: tuple[str, ...] = ()
    structure: str = ""
    parameters: dict[str, float] = field(default_factory=dict)
    load: LoadTable | None = None
    provenance: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require(self.start_time >= 0.0, f"start_time is {self.start_time:g} s, it must not be negative")
        require(0.0 < self.sampling_step < np.inf, f"sampling_step is {self.sampling_step:g} s, it must be positive")
        whole = self.samples >= BLOCK and self.samples % BLOCK == 0
        require(whole, f"a window needs a multiple of {BLOCK} samples, not {self.samples}")

    def require_structure(self, structure: Structure, name: str) -> None:
        """Refuse a structure that it is not trained for.

        Parameters
        ----------
        structure : Structure
            On any mesh of its shape.
        name : str
            Of the detector, for the message.

        Raises
        ------
        ArtifactError
            It has other zones or sensors, or is made, held or loaded in another way than the structure of the training.
        """
        zones, sensors = structure.zone_names, structure.n_sensors
        if (self.zones, self.sensors) != (len(zones), sensors):
            msg = (
                f"{name} is trained for {self.zones} zones and {self.sensors} sensors, and this structure has {len(zones)} "
                f"and {sensors}. Train one for it: gossamer train --setup."
            )
            raise ArtifactError(msg)
        own, other = ([each.replace("_", " ") for each in names] for names in (self.names, zones))
        if own != other:
            k = next(k for k in range(self.zones) if own[k] != other[k])
            msg = (
                f"{name} is trained for a structure whose zone {k + 1} is {own[k]!r}, and here it is {other[k]!r}. Train "
                "one for this structure: gossamer train --setup."
            )
            raise ArtifactError(msg)
        if not self.structure:
            return
        trained = read_structure(self.structure)
        if (what := _difference(trained.setup, structure.setup)) is not None:
            msg = (
                f"{name} is trained for {_called(trained)!r}, and this structure, {_called(structure)!r}, has other {what}. "
                f"Leave out {option('setup')}, or train one for it: gossamer train --setup."
            )
            raise ArtifactError(msg)

    @property
    def names(self) -> list[str]:
        """What the zones are called."""
        return list(self.zone_names) or [f"zone {k + 1}" for k in range(self.zones)]

    @property
    @abstractmethod
    def sensors(self) -> int:
        """Number of sensors."""

    @property
    @abstractmethod
    def zones(self) -> int:
        """Number of zones."""

    @property
    def window_length(self) -> float:
        """Length of a window [s]."""
        return self.samples * self.sampling_step

    def card(self) -> dict[str, Any]:
        """Return what the card of the file says of the windows."""
        times = {"start_time": self.start_time, "sampling_step": self.sampling_step, "samples": self.samples}
        structure = json.loads(self.structure) if self.structure else None
        membrane = {"structure": structure, "parameters": self.parameters, "load": self.load and asdict(self.load)}
        return times | {"zone_names": list(self.zone_names)} | membrane

    @staticmethod
    def of_card(card: dict[str, Any]) -> dict[str, Any]:
        """Return the fields of this class from a card."""
        times = {name: float(card[name]) for name in ("start_time", "sampling_step")}
        there = card.get("structure")
        return times | {
            "samples": int(card["samples"]),
            "zone_names": tuple(card.get("zone_names", ())),
            "structure": "" if there is None else json.dumps(there),
            "parameters": {name: float(value) for name, value in card.get("parameters", {}).items()},
            "load": LoadTable.stored(card.get("load")),
            "provenance": dict(card["provenance"]),
        }


def _difference(one: Setup, other: Setup) -> str | None:
    """Return the first table of two setups that differs, if one does."""
    return next((name for name in TABLES if getattr(one, name) != getattr(other, name)), None)


def _called(structure: Structure) -> str:
    return structure.setup.title or structure.mesh.name


@dataclass(frozen=True, kw_only=True)
class DetectorArtifact(TrainedWindows):
    """Trained networks, one for each of z zones, of c successive windows, with n reference cases and k fuzzy sets.

    Attributes
    ----------
    peaks : ndarray, shape (k,)
        Damage [1] at which each fuzzy set has membership one.
    baseline : ndarray, shape (c, 4 s)
        Packet energies of the undamaged structure, positive: four of each of s sensors.
    references : ndarray, shape (c, n, 4 s)
        Logarithms of the damage feature indices of the reference cases [1].
    weights : ndarray, shape (c, n, 4 s)
        Distance weights W1_ij of reference i and index j, Eq. (6.1).
    bias : ndarray, shape (c,)
        Bias, Eq. (6.3).
    rules : ndarray, shape (c, k, n, z)
        Weights from the similarities to the memberships in each network.
    """

    peaks: Vector
    baseline: Vector
    references: Vector
    weights: Vector
    bias: Vector
    rules: Vector

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.references.ndim == 3, f"references has shape {self.references.shape}, not (c, n, indices)")
        c, n, indices = self.references.shape
        require(indices % len(PACKETS) == 0, f"there are {indices} indices, not {len(PACKETS)} of each sensor")
        require(self.rules.ndim == 4, f"rules has shape {self.rules.shape}, not (c, k, n, zones)")
        shapes = {
            "baseline": (c, indices),
            "references": (c, n, indices),
            "weights": (c, n, indices),
            "bias": (c,),
            "rules": (c, self.peaks.size, n, self.zones),
        }
        for name, shape in shapes.items():
            array = getattr(self, name)
            require(array.shape == shape, f"{name} has shape {array.shape}, not {shape}")
            require(np.isfinite(array).all(), f"{name} holds values that are not finite")
        require((np.diff(self.peaks) > 0.0).all(), "the peaks must increase")
        require((self.weights >= 0.0).all(), "distance weights must not be negative")
        require((self.baseline > 0.0).all(), "baseline energies must be positive")

    @property
    def sensors(self) -> int:
        """Number of sensors."""
        return int(self.references.shape[-1]) // len(PACKETS)

    @property
    def zones(self) -> int:
        """Number of zones."""
        return int(self.rules.shape[-1])

    def write(self, path: Path) -> None:
        """Write the card and, beside it, the arrays."""
        arrays = {name: getattr(self, name) for name in ARRAYS}
        write_artifact(path, SCHEMA, VERSION, self.provenance, self.card(), arrays)

    @classmethod
    def read(cls, path: Path) -> DetectorArtifact:
        """Read what ``write`` wrote; raise ``ArtifactError`` for a file that is missing, damaged or unusable."""
        with reading(path, SCHEMA, VERSION) as (card, arrays):
            return cls(**cls.of_card(card) | arrays)

    @classmethod
    def default(cls) -> DetectorArtifact:
        """Read the artifact that is shipped with this package."""
        return cls.read(DEFAULT)

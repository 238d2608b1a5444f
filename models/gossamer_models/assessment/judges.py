"""Judges: what turns strain histories into damage, behind one call.

Symbols: ``n`` records, ``T`` samples. Verdicts of slow judges are kept beside the simulations, so that an interrupted
assessment goes on where it stopped.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from dataclasses import dataclass, field, fields, replace
from functools import cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from gossamer_files import replacing

from ..arrays import Matrix, Rows
from ..detector import PosteriorArtifact, detector_model, judge_records, read_detector, shipped_detectors
from ..detector.thesis_tables import ZONES
from ..errors import ConvergenceError, DataError
from ..step_model import StepModel
from ..stepper import Stepper, simulate

if TYPE_CHECKING:
    from ..campaign import Mesh
    from ..membrane import Structure
    from ..twin import LoadTable, Twin

OF_TWIN = ("twin", "membrane", "sensor", "batch")  # rooms that its answers depend on
Signal = Literal["strain", "resistance"]
SLOW = 8  # records that are judged, then kept, at a time


@dataclass(frozen=True, kw_only=True)
class Verdicts:
    """What a judge says of n records.

    Attributes
    ----------
    damage : ndarray, shape (n, zones)
        Lost fraction of Young's modulus of each zone [1]; 0 for a record that could not be judged.
    deviation : ndarray, shape (n, zones), or None
        Standard deviation [1].
    probability : ndarray, shape (n, zones), or None
        That the zone is damaged [1].
    determined : ndarray of bool, shape (n, zones), or None
        Whether a zone is answered with a value; None where the deviation alone tells.
    valid : ndarray of bool, shape (n,)
        Whether the judge answers for it.
    """

    damage: Matrix
    deviation: Matrix | None = None
    probability: Matrix | None = None
    determined: Rows | None = None
    valid: Rows

    @classmethod
    def finite(
        cls, *, damage: Matrix, valid: Matrix, deviation: Matrix | None = None, probability: Matrix | None = None
    ) -> Verdicts:
        """Take an answer that is not finite for none."""
        sound: Rows = np.asarray(np.isfinite(damage).all(axis=1))
        given = sound & (np.asarray(valid) > 0.5)
        damage = np.where(sound[:, None], damage, 0.0)
        return cls(damage=damage, deviation=deviation, probability=probability, valid=given)

    @property
    def arrays(self) -> dict[str, Any]:
        """What is stated, by name."""
        return {part.name: array for part in fields(self) if (array := getattr(self, part.name)) is not None}

    def __getitem__(self, rows: Rows | slice) -> Verdicts:
        """Return the verdicts of some records."""
        return Verdicts(**{name: array[rows] for name, array in self.arrays.items()})


@dataclass(frozen=True, kw_only=True)
class Judge(ABC):
    """Any way to tell damage from histories.

    Attributes
    ----------
    name : str
        What tables call it.
    reads : {"strain", "resistance"}
        What it is given.
    most : int or None
        Records of a condition that it has time for; None for all.
    sizes : int or None
        Sizes of damage in each zone that it has time for, to tell its probability of detection; None for all, 0 for none,
        and then it is not asked for the thesis' tables either.
    """

    name: str
    reads: Signal = "strain"
    most: int | None = None
    sizes: int | None = None

    @property
    @abstractmethod
    def identity(self) -> str:
        """Changes whenever its answers may change, so that those that were kept are not taken for its own."""

    @abstractmethod
    def __call__(self, histories: Matrix, step: float) -> Verdicts:
        """Judge n records, shape (n, sensors, T), strain [1] or resistance [ohm], of a sampling step [s]."""


@dataclass(frozen=True, kw_only=True)
class AlwaysZero(Judge):
    """The judge that never finds damage in any zone: what every other one must beat."""

    name: str = "always 0"
    zones: int = ZONES

    @property
    def identity(self) -> str:
        """Its name."""
        return self.name

    def __call__(self, histories: Matrix, step: float) -> Verdicts:  # noqa: ARG002
        """Say 0."""
        return Verdicts(damage=np.zeros((len(histories), self.zones)), valid=np.ones(len(histories), dtype=bool))


@dataclass(frozen=True)
class DetectorJudge(Judge):
    """A detector as its FMU runs it: sample by sample; its last window counts.

    Attributes
    ----------
    model : StepModel
        From ``detector_model``.
    """

    model: StepModel
    name: str = field(default="energies", kw_only=True)

    @property
    def identity(self) -> str:
        """Digest of the model."""
        return self.model.digest

    def __call__(self, histories: Matrix, step: float) -> Verdicts:
        """Run the records one after the other."""
        arrays = [name for name in ("damage", "deviation", "probability") if f"{name}[1]" in self.model.names]
        names = [*chain.from_iterable(map(self.model.elements, arrays)), "valid"]
        found = np.empty((len(histories), len(names)))
        steps = np.full(histories.shape[-1], step)
        for row, history in zip(found, histories, strict=True):
            stepper = Stepper(self.model, repeat=1.0)
            stepper.initialize()
            simulate(stepper, steps, {f"strain[{i}]": strain for i, strain in enumerate(history, start=1)}, ())
            row[:] = [stepper.get(name) for name in names]
        parts = dict(zip(arrays, np.split(found[:, :-1], len(arrays), axis=1), strict=True))
        return Verdicts.finite(**parts, valid=found[:, -1])


@dataclass(frozen=True)
class PosteriorJudge(Judge):
    """A posterior network, many records at once; of each, the last window with a valid answer counts, as in a run."""

    artifact: PosteriorArtifact
    name: str = field(default="network", kw_only=True)

    @property
    def identity(self) -> str:
        """Digest of the weights."""
        arrays = [array for window in self.artifact.windows for array in window.arrays().values()]
        return hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).hexdigest()

    def __call__(self, histories: Matrix, step: float) -> Verdicts:
        """Judge all whole windows that the artifact is trained for, and choose."""
        trained = self.artifact
        first = round(trained.start_time / step)
        windows = (histories.shape[-1] - first) // trained.samples
        if not trained.periodic:
            windows = min(windows, len(trained.windows))
        if abs(step - trained.sampling_step) > 1e-6 * step or windows < 1:
            msg = (
                f"{self.name} needs records of {trained.samples} samples and a step of {trained.sampling_step:g} s after "
                f"{trained.start_time:g} s, not {histories.shape[-1]} samples and {step:g} s. Simulate longer records."
            )
            raise DataError(msg)
        said = []
        for k in range(windows):
            begin = first + k * trained.samples
            part = histories[:, :, begin : begin + trained.samples].astype(float)
            said.append(self.window(min(k, len(trained.windows) - 1), part))
        valid = np.array([verdicts.valid for verdicts in said])
        last = np.where(valid.any(axis=0), windows - 1 - valid[::-1].argmax(axis=0), windows - 1)
        chosen = last, np.arange(len(histories))
        return Verdicts(**{name: np.array([part.arrays[name] for part in said])[chosen] for name in said[0].arrays})

    def window(self, number: int, records: Matrix) -> Verdicts:
        """Judge records of one window, from 0, shape (n, 4, samples) [1]."""
        found = judge_records(self.artifact, number, records)
        return Verdicts.finite(**{name: found[name] for name in ("damage", "deviation", "probability", "valid")})


@dataclass(frozen=True)
class TwinJudge(Judge):
    """The digital twin, record by record: seconds for each."""

    twin: Twin
    load: LoadTable | None = None
    name: str = field(default="twin", kw_only=True)

    @property
    def identity(self) -> str:
        """Settings of the twin, and digest of the program that it is part of."""
        of = self.twin
        return f"{self.reads} {of.nuisances} {of.known} {of.sparse} {of.parameters} {self.load} {_digest_of_twin()}"

    def __call__(self, histories: Matrix, step: float) -> Verdicts:
        """Fit every record; one that cannot be fitted is not valid."""
        from ..twin import Loads, ResponseRecord

        acting = Loads() if self.load is None else self.load.loads(histories.shape[-1], step)
        found = np.zeros((3, len(histories), self.twin.zones))
        found[1] = 1.0
        determined = np.zeros(found.shape[1:], dtype=bool)
        valid = np.zeros(len(histories), dtype=bool)
        for k, history in enumerate(histories):
            try:
                record = ResponseRecord(
                    step=step, values=history, kind=self.reads, inputs=acting.histories, start=acting.start
                )
                answer = self.twin.fit(record)
            except (ConvergenceError, DataError):
                continue
            found[:, k] = answer.damage, answer.deviation, answer.probability
            valid[k], determined[k] = answer.valid, answer.determined
        said = Verdicts.finite(damage=found[0], deviation=found[1], probability=found[2], valid=valid)
        return replace(said, determined=determined)


@cache
def _digest_of_twin() -> str:
    """Return the digest of the program that a twin is part of, as it was when first asked for."""
    sources = sorted(Path(__file__).parents[1].rglob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources if path.parent.name in OF_TWIN)).hexdigest()


def read_judge(path: Path, structure: Structure | None = None) -> Judge:
    """Return the judge of a trained detector's file.

    Parameters
    ----------
    path : Path
        Its card.
    structure : Structure, optional
        What it should be trained for.

    Raises
    ------
    ArtifactError
        The file is missing, damaged, no detector, or one of another structure.
    """
    trained = read_detector(path)
    if structure is not None:
        trained.require_structure(structure, str(path))
    if isinstance(trained, PosteriorArtifact):
        return PosteriorJudge(trained, name=f"posterior {path.stem}")
    return DetectorJudge(detector_model(trained), name=f"energies {path.stem}")


def shipped_judges() -> list[Judge]:
    """Return the judges of the detectors that ship with the package."""
    return [read_judge(path) for path in shipped_detectors().values()]


def twin_judges(most: int, sizes: int, mesh: Mesh | None = None) -> tuple[TwinJudge, ...]:
    """Return the twins: one on strain, and of the square one on resistance.

    Parameters
    ----------
    most : int
        Records of a condition that each has time for.
    sizes : int
        Sizes of damage in each zone that each has time for.
    mesh : Mesh, optional
        Another membrane than the square, with its parameters and loads; then the first one alone.
    """
    from ..sensor import default_artifact
    from ..twin import Twin

    if mesh is not None:
        return (TwinJudge(Twin(mesh.structure, parameters=mesh.parameters), mesh.load, most=most, sizes=sizes),)
    resistance = Twin(sensor=default_artifact())
    return (
        TwinJudge(Twin(), most=most, sizes=sizes),
        TwinJudge(resistance, name="twin on resistance", reads="resistance", most=most, sizes=sizes),
    )


def ask(judge: Judge, histories: Matrix, step: float, folder: Path) -> Verdicts:
    """Return the verdicts on n records: at once, or from a slow judge some at a time, those kept from before first.

    Parameters
    ----------
    judge : Judge
        Slow if it has time for some records only.
    histories : ndarray, shape (n, sensors, T)
        What it reads.
    step : float
        Sampling step [s].
    folder : Path
        Where verdicts are kept: a file's name is a digest of the judge's identity, the records and the step.
    """
    if judge.most is None:
        return judge(histories, step)
    parts = []
    for begin in range(0, len(histories), SLOW):
        some = np.ascontiguousarray(histories[begin : begin + SLOW])
        key = hashlib.sha256(f"{judge.identity} {step!r} {some.shape} {some.dtype}".encode() + some.tobytes())
        path = folder / f"{key.hexdigest()[:32]}.npz"
        if not path.exists():
            found = judge(some, step)
            with replacing(path) as unfinished:
                np.savez(unfinished, **found.arrays)
        with np.load(path, allow_pickle=False) as arrays:
            parts.append(dict(arrays))
    return Verdicts(**{name: np.concatenate([part[name] for part in parts]) for name in parts[0]})

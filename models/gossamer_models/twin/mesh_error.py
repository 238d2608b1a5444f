r"""How far the strain of a mesh is from that of a finer one, and what that means for damages fitted on it.

Symbols: ``m`` pairs of simulations, ``s`` sensors, ``n`` samples or load states, ``z`` zones; ``delta`` strain of the finer
mesh less that of the twin's [1], or resistance that sensors read of them [ohm]; ``J`` its derivatives by the damages.

Pairs with random damages under the loads of the record tell the covariance of the error: an offset of each sensor, the
largest principal components of all pairs, and what is left of pairs that had no part in them, as a stationary process of
each sensor. A still finer mesh shows that the finer one is not the truth either. The covariance is enlarged until damages
that are fitted to errors which it was not learned from are as far off as it says.
"""

from __future__ import annotations

import hashlib
import io
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..arrays import Matrix, Vector
from ..compiler import kept_library
from ..membrane import Structure
from .forward import MembraneForward
from .least_squares import DAMAGE_STEP
from .record import SAME_LOAD, ResponseRecord, StaticRecord
from .weights import RecordWeights, process_of

VERSION = 2  # of what is kept
PAIRS, STILL_FINER = 32, 8  # simulations with random damage, and how many of them on a still finer mesh
MOST_NODES = 6000  # of a still finer mesh: else hours
LARGEST = 5  # principal components of all sensors together
SHRUNK = 0.2  # of the variance: to each sensor alone
SMALL = 0.2  # of the noise: components below it change nothing
SCALES = (1.0, 1.4, 2.0, 2.8, 4.0, 5.6)
UNSEEN = 1.4  # where no still finer mesh can be had: an error as large again, independent
CALIBRATED = 1.1  # rms of errors over stated deviations, at most
GOAL = 0.015  # of the strain's change
CONVERGES = 0.7  # of the error, at most, is left by finer elements
BURIED = 2.0  # times as large as by noise alone may deviations be
Report = Callable[[str, int, int], None]


@dataclass(frozen=True, kw_only=True)
class MeshError:
    """Pairs of simulations on the twin's mesh and on finer ones, under the loads of one record.

    Attributes
    ----------
    strain : ndarray, shape (s, n)
        Of the undamaged membrane [1], or resistance [ohm] all through.
    slopes : ndarray, shape (z, s, n)
        Its derivatives by the damages.
    finer : ndarray, shape (m, s, n)
        What the finer mesh adds; first of the undamaged membrane.
    still_finer : ndarray, shape (k, s, n)
        What a still finer one adds to the twin's mesh, of the first k; none where it is too large.
    noise : ndarray, shape (s,)
        Standard deviation of the record.
    static : bool
        Whether these are states, not samples.
    healthy : bool
        Whether the error of the undamaged membrane is taken away.
    """

    strain: Matrix
    slopes: Matrix
    finer: Matrix
    still_finer: Matrix
    noise: Vector
    static: bool
    healthy: bool = False

    def beside_healthy(self) -> MeshError:
        """Return what is left of the error where a healthy record under nearly the same load is taken from others."""
        factor = 1.0 + SAME_LOAD * np.random.default_rng(0).standard_normal(len(self.finer))
        less = factor[:, None, None] * self.finer[:1]
        still_finer = self.still_finer - factor[: len(self.still_finer), None, None] * self.still_finer[:1]
        return replace(self, finer=(self.finer - less)[1:], still_finer=still_finer[1:], healthy=True)

    @cached_property
    def of_finer(self) -> MeshError | None:
        """The error of the finer mesh; None if no still finer one is known."""
        left = self.still_finer - self.finer[: len(self.still_finer)]
        return replace(self, finer=left, still_finer=left[:0]) if len(left) else None

    @property
    def share(self) -> float:
        """Error of the undamaged strain over its change [1], root mean squares."""
        best = self.still_finer if len(self.still_finer) else self.finer
        return _rms(_moving(best[0])) / max(_rms(_moving(self.strain)), 1e-300)

    @property
    def left(self) -> float:
        """What finer elements leave of it [1]; not a number where no still finer ones are known."""
        if not len(self.still_finer):
            return math.nan
        return _rms(_moving(self.still_finer[0] - self.finer[0])) / max(_rms(_moving(self.still_finer[0])), 1e-300)

    @cached_property
    def scale(self) -> float:
        """Factor on the deviations of the error [1]."""
        even, odd = self.finer[::2], self.finer[1::2]
        tests = [(self._learned(even), odd), (self._learned(odd), even)]
        if len(self.still_finer):
            tests.append((self._learned(self.finer), self.still_finer))
        factor = 1.0 if len(self.still_finer) else UNSEEN
        for scale in SCALES:
            if max(self._over_stated(scale * known, unknown) for known, unknown in tests) <= CALIBRATED:
                return scale * factor
        return SCALES[-1] * factor

    @cached_property
    def components(self) -> Matrix:
        """Components of the error [1], shape (k, s, n), whose outer products add up to its covariance."""
        return self.scale * self._learned(self.finer)

    @cached_property
    def blur(self) -> float:
        """How many times the largest deviation of a zone's damage is what it would be by noise alone [1]."""
        with_error, alone = (
            self._weights(c)[2].diagonal().max() for c in (self.components, np.zeros((1, *self.strain.shape)))
        )
        return math.sqrt(with_error / alone)

    @property
    def buries(self) -> bool:
        """Whether the error hides much more of the damages than the noise does, so that no answer is valid."""
        return self.blur > BURIED

    def _learned(self, delta: Matrix) -> Matrix:
        """Return components of some differences, shape (m, s, n)."""
        _, s, n = delta.shape
        moving = _moving(delta)
        means = (delta - moving).mean(axis=2)
        offsets = np.sqrt(np.mean(means**2, axis=0))[:, None, None] * np.eye(s)[:, :, None] * np.ones(n)
        size, along = _principal(moving)
        largest = (size[:LARGEST, None] * along[:LARGEST]).reshape(-1, s, n)
        rest = []
        for k in (0, 1):  # of pairs that had no part in the components
            others = _principal(moving[1 - k :: 2])[1][:LARGEST]
            flat = moving[k::2].reshape(-1, s * n)
            rest.append((flat - (flat @ others.T) @ others).reshape(-1, s, n))
        found = [offsets, largest]
        parts = [(1.0, np.concatenate(rest)), (SHRUNK, moving)]  # another mesh may err in other ways
        for j in range(s):
            if self.static:
                variance = np.sum([share * np.mean(part[:, j] ** 2, axis=0) for share, part in parts], axis=0)
                modes = np.eye(n)
            else:
                spectra = [(share, np.abs(np.fft.rfft(part[:, j], 2 * n, axis=1)) ** 2) for share, part in parts]
                variance, modes = process_of(sum((share * each.mean(axis=0) for share, each in spectra), np.zeros(n + 1)))
            seen = variance > (SMALL * self.noise[j]) ** 2
            mine = np.zeros((int(seen.sum()), s, n))
            mine[:, j] = (np.sqrt(variance[seen]) * modes[:, seen]).T
            found.append(mine)
        return np.concatenate(found)

    def _weights(self, components: Matrix) -> tuple[RecordWeights, Matrix, Matrix]:
        """Return weights, the weighed derivatives and the covariance of damages with unknown offsets."""
        weights = RecordWeights(np.ones(self.strain.shape, dtype=bool), self.noise, components)
        J = weights.weigh(_moving(self.slopes)).T
        return weights, J, np.asarray(np.linalg.pinv(J.T @ J, hermitian=True), dtype=np.float64)

    def _over_stated(self, components: Matrix, delta: Matrix) -> float:
        """Return how far off damages are that are fitted to errors and noise, over the stated deviations, rms."""
        weights, J, C = self._weights(components)
        noise = self.noise[:, None] * np.random.default_rng(0).standard_normal(delta.shape)
        damage = weights.weigh(_moving(delta + noise)) @ J @ C
        return _rms(damage / np.sqrt(np.diag(C)))


class MeshErrors:
    """The error of a membrane's mesh under the loads of records; simulations are kept in the user's cache.

    Parameters
    ----------
    structure : Structure
        Membrane with zones and sensors.
    parameters : mapping of str to float
        Parameters, and inputs at the start, that differ from their start values.
    report : callable
        Called with what is done, and how many of how many.
    """

    def __init__(
        self, structure: Structure, parameters: Mapping[str, float] | None = None, report: Report = lambda *_: None
    ) -> None:
        self.structure, self.parameters, self._report = structure, dict(parameters or {}), report
        self._known: dict[tuple[str, str, bytes, bool], MeshError] = {}

    def of(
        self, record: ResponseRecord, read: Callable[[Matrix], Matrix] = np.asarray, *, healthy: bool = False
    ) -> MeshError:
        """Return the error under the loads of a record, in its unit.

        Parameters
        ----------
        record : ResponseRecord
            Loads, step and length.
        read : callable
            What its sensors read of strain, shape (m, s, n).
        healthy : bool
            Whether a healthy record under the same loads is taken from it.

        Raises
        ------
        ConvergenceError
            A simulation fails.
        """
        noise = record.noise_deviation()
        key = self._key(record)
        known = key, record.kind, noise.tobytes(), healthy
        if known not in self._known:
            file = kept_library([key], ".npz", lambda: self._simulated(record), "the error of a mesh")
            with np.load(file, allow_pickle=False) as arrays:
                near, own, finer, still_finer = (
                    read(arrays[name].astype(float)) if arrays[name].size else arrays[name] for name in arrays.files
                )
            found = {
                "strain": near[0],
                "slopes": (near[1:] - near[0]) / DAMAGE_STEP,
                "finer": finer - own,
                "still_finer": still_finer - own[: len(still_finer)],
            }
            noise = noise * math.sqrt(record.states / record.samples)  # a state is read several times
            noise = np.where(noise > 0.0, noise, np.nanmax(noise))  # of sensors that are left out
            error = MeshError(**found, noise=noise, static=isinstance(record, StaticRecord))
            self._known[known] = error.beside_healthy() if healthy else error
        return self._known[known]

    @cached_property
    def finer(self) -> MembraneForward:
        """The membrane with finer elements."""
        return MembraneForward(self._finer, self.parameters)

    @cached_property
    def _finer(self) -> Structure:
        return self.structure.finer()

    def doubts(self, found: MeshError) -> list[str]:
        """Return sentences on the error, and which order or mesh would do; none if it is small."""
        hides = f", which makes the damages {found.blur:.2g} times as uncertain as the noise alone, so no answer is valid"
        if found.healthy:
            text = f"finer elements change what damage does to the strain{hides}. Use a finer mesh or another order"
            return [text] * found.buries
        if found.share <= GOAL:
            return []
        better = self._better(found)
        again = "finer elements of this mesh change it again: mesh with quadrilaterals of 9 nodes and order = 3 or more"
        text = f"finer elements change the strain by {100.0 * found.share:.2g} % of its change{hides * found.buries}"
        return [f"{text}. {(better or again).capitalize()}"]

    def _better(self, found: MeshError) -> str:
        """Say which order or refinement would reach the goal; nothing if none would."""
        left = found.left if math.isfinite(found.left) else 0.5
        if left > CONVERGES:
            return ""
        times = max(1, math.ceil(math.log(GOAL / found.share) / math.log(left)))
        setup = self.structure.setup
        key, value = ("order", setup.order + 2 * times) if setup.order > 1 else ("refine", setup.refine + times)
        return f"write {key} = {value} in the setup to reach {100.0 * GOAL:g} %"

    def _key(self, record: ResponseRecord) -> str:
        digest = hashlib.sha256()
        setup, mesh = self.structure.setup, self.structure.mesh
        loads = [*sorted(record.inputs.items()), *sorted(record.start.items()), *sorted(self.parameters.items())]
        about = (setup, record.step, record.states, record.samples, type(record).__name__, PAIRS, STILL_FINER, VERSION)
        parts = [repr(about), *(name for name, _ in loads)]
        arrays = [mesh.nodes, *(block.elements for block in mesh.blocks), *(np.asarray(value) for _, value in loads)]
        arrays += [self._finer.mesh.nodes, *self._finer.unit_forces.values()]
        digest.update(repr(parts).encode())
        for array in arrays:
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()

    def _simulated(self, record: ResponseRecord) -> bytes:
        """Simulate all pairs, and write them as an NPZ file of single precision."""
        z = self.structure.n_zones
        damage = np.vstack([np.zeros((1, z)), _random_damages(PAIRS - 1, z)])
        still = self._finer.finer()
        small = len(still.mesh.nodes) <= MOST_NODES
        near = np.vstack([np.zeros((1, z)), DAMAGE_STEP * np.eye(z)])
        plan = [(self.structure, np.vstack([near, damage]), "as it is"), (self._finer, damage, "finer")]
        plan += [(still, damage[:STILL_FINER], "still finer")] * small
        found = [self._strain(structure, rows, record, name) for structure, rows, name in plan]
        near, own = found[0][: 1 + z], found[0][1 + z :]
        kept = [near, own, found[1], found[2] if small else own[:0]]
        content = io.BytesIO()
        np.savez(content, *(each.astype(np.float32) for each in kept))
        return content.getvalue()

    def _strain(self, structure: Structure, damage: Matrix, record: ResponseRecord, name: str) -> Matrix:
        forward = MembraneForward(structure, self.parameters)
        inputs = {key: np.asarray(value) for key, value in record.inputs.items()}
        found = []
        for first in range(0, len(damage), 8):
            rows = damage[first : first + 8]
            start = {key: np.full(len(rows), value) for key, value in record.start.items()}
            if isinstance(record, StaticRecord):
                found.append(forward.states(rows, start, inputs))
            else:
                found.append(forward.strain(rows, start, inputs, record.samples, record.step))
            self._report(f"simulations on the mesh, {name}", first + len(rows), len(damage))
        return np.concatenate(found)


def _random_damages(count: int, zones: int) -> Matrix:
    """Return damages of up to four zones by 5 to 50 %, shape (count, zones), always the same."""
    random = np.random.default_rng(zones)
    found = np.zeros((count, zones))
    for row in found:
        which = random.choice(zones, min(zones, int(random.integers(1, 5))), replace=False)
        row[which] = random.uniform(0.05, 0.5, len(which))
    return found


def _principal(delta: Matrix) -> tuple[Vector, Matrix]:
    """Return deviations and directions of the principal components about zero, largest first."""
    flat = delta.reshape(len(delta), -1) / math.sqrt(len(delta))
    _, size, along = np.linalg.svd(flat, full_matrices=False)
    return size, along


def _moving(y: Matrix) -> Matrix:
    """Return values less their means over samples or load states; of one state, the values."""
    return np.asarray(y - y.mean(axis=-1, keepdims=True)) if y.shape[-1] > 1 else y


def _rms(y: Matrix) -> float:
    return float(np.sqrt(np.mean(y**2)))

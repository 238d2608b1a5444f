r"""What a finer mesh adds to the strain of the twin's mesh, or to what sensors read of it, as a random process.

Symbols: ``delta`` difference of strain [1] between two meshes; ``beta`` its coefficients on cubic B-splines in time, one row
per component of the process: sensor by sensor, spline by spline.

The difference lies above 150 Hz, where the response to the load has next to nothing: below, on the splines of
``SPACING``, it is a third of the thesis' noise, of the whole it is more than half. It depends on damage and load
in no way that a regression with some hundred pairs finds, so it is described by its covariance alone.

A sensor with hysteresis rectifies what is faster than the splines. The difference of resistance is therefore learned by
itself, from pairs of histories that the sensors read. Pairs and covariance are kept in the user's cache.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
from gossamer_files import reason
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from ..arrays import Matrix
from ..artifacts import read_arrays, read_artifact
from ..compiler import kept_library
from ..errors import ArtifactError, DataError, require
from ..membrane import MembraneParams, square_structure
from .forward import Forward, MembraneForward
from .record import ResponseRecord
from .simulation import SensorBank

SCHEMA, VERSION = "gossamer.discrepancy", 1
DEFAULT_PATH = Path(__file__).with_name("order_4.json")
STEP = 3e-4  # [s] of histories
PAIRS, CHUNKS = 32, 13  # of histories in a chunk, and chunks that the error behind sensors is learned from
PAIRS_VERSION = 1  # of what is kept of them
SHRUNK = 0.4  # of the covariance behind sensors: pairs that were held out are likeliest at 0.2 to 0.4, and z is 1.07
SPACING = 1.0 / 300.0  # [s] of the knots: what is faster than half of 1/SPACING is not compared
DEGREE = 3
# How far membrane and load may be from those that the discrepancy was learned with, as a share.
LEARNED = {
    "pressure_amplitude": 0.15,
    "pressure_frequency": 0.08,
    "pressure_phase": 0.2,
    "mass_damping": 1.5,
    "youngs_modulus": 0.1,
    "density": 0.1,
    "thickness": 0.1,
    "edge_displacement": 0.15,
}


@dataclass(frozen=True, kw_only=True)
class Discrepancy:
    """Covariance of the difference between a mesh and a finer one, on splines in time.

    Attributes
    ----------
    elements_per_side, order : int
        Mesh of the twin that it belongs to.
    length : float
        Time that it covers [s], from the moment that the load sets in.
    components : ndarray, shape (k, sensors, splines)
        Coefficients of strain [1] or resistance [ohm] whose outer products add up to the covariance.
    provenance : dict
        How it was made.
    kind : str
        ``strain`` or ``resistance``.
    """

    elements_per_side: int
    order: int
    length: float
    components: Matrix
    provenance: dict[str, str]
    kind: Literal["strain", "resistance"] = "strain"

    def basis(self, steps: int, h: float) -> Matrix:
        """Evaluate the components at h, 2 h, ..., shape (k, sensors, steps); zero after ``length``."""
        splines = spline_matrix(steps, h, self.length)
        return np.asarray(np.einsum("kij,tj->kit", self.components, splines))

    def behind(self, bank: SensorBank, report: Callable[[float, int], None] = lambda *_: None) -> Discrepancy:
        """Return the same of what sensors read [ohm]; what is not in the user's cache takes minutes to make.

        Parameters
        ----------
        bank : SensorBank
            The sensors.
        report : callable, optional
            Called with the length of the pairs [s] and how many were made.
        """
        steps = round(self.length / STEP)
        mesh = f"{self.elements_per_side} {self.order} {steps} {STEP} {CHUNKS} {PAIRS} {SPACING} {PAIRS_VERSION}"
        sensors = [repr(bank.artifact), *(f"{name} {value.tolist()}" for name, value in bank.parameters.items())]

        def simulated() -> bytes:
            found = []
            for chunk in range(CHUNKS):
                report(self.length, PAIRS * chunk)
                pair = simulated_pairs(chunk, self.elements_per_side, self.order, steps)
                found.append([pair["strain"], pair["strain"] + pair["difference"]])
            return _packed(np.concatenate(found, axis=1))

        def learned() -> bytes:
            coarse, fine = _unpacked(kept_library(["pairs", mesh], ".npy", simulated, "histories of a mesh and a finer one"))
            return _packed(learn(bank.read(fine, STEP)[0] - bank.read(coarse, STEP)[0], STEP, share=1.0, shrunk=SHRUNK))

        file = kept_library(["behind", mesh, str(SHRUNK), *sensors], ".npy", learned, "the error of a mesh behind sensors")
        made = {"data": f"{CHUNKS * PAIRS} pairs behind sensors"}
        return replace(self, components=_unpacked(file), provenance=made, kind="resistance")

    @classmethod
    def read(cls, path: Path = DEFAULT_PATH) -> Discrepancy:
        """Read what ``docs/make_discrepancy.py`` wrote.

        Raises
        ------
        ArtifactError
            The file is missing, truncated, or of another kind.
        """
        card = read_artifact(path, SCHEMA, VERSION)
        arrays = read_arrays(path, card)
        try:
            return cls(
                elements_per_side=int(card["elements_per_side"]),
                order=int(card["order"]),
                length=float(card["length"]),
                components=arrays["levels"] * arrays["scale"][:, None, None],
                provenance=dict(card["provenance"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            msg = f"{path} lacks a part of a discrepancy: {reason(error)}. Make it again."
            raise ArtifactError(msg) from error


def spline_matrix(steps: int, h: float, length: float) -> Matrix:
    """Evaluate the splines at h, 2 h, ..., shape (steps, splines); those after ``length`` are left out."""
    count = round(length / SPACING)
    knots = np.arange(-DEGREE, count + DEGREE + 1) * SPACING
    time = h * np.arange(1, steps + 1)
    inside = time <= count * SPACING * (1.0 + 1e-12)
    found = np.zeros((steps, count + DEGREE))
    at = np.minimum(time[inside], count * SPACING)
    found[inside] = BSpline.design_matrix(at, knots, DEGREE, extrapolate=True).toarray()
    return found


def simulated_pairs(chunk: int, elements_per_side: int, order: int, steps: int) -> dict[str, NDArray[np.float32]]:
    """Simulate ``PAIRS`` pairs of histories of 0.3 ms a step on the mesh of a square and on one of twice the order.

    Returns ``damage``, ``load`` (in units of its range), and of strain [1] ``strain`` on the mesh and ``difference`` of the
    finer one. Damage of 0 to 5 zones, uniform from 0 to 60 %. In odd chunks the amplitude of the load varies by 10 %, its
    frequency by 5 %, its phase by 0.1 rad, damping by a factor of 2 and Young's modulus by 2 %.
    """
    random = np.random.default_rng([10, chunk])
    damage = np.zeros((PAIRS, 16))
    for row in damage:
        count = random.integers(0, 6)
        zones = random.choice(16, count, replace=False)
        row[zones] = random.uniform(0.0, 0.6, count)
    load = random.uniform(-1.0, 1.0, (PAIRS, 5)) * (chunk % 2)
    start = {
        "pressure_amplitude": 1e4 * (1.0 + 0.1 * load[:, 0]),
        "pressure_frequency": 7.9 * (1.0 + 0.05 * load[:, 1]),
        "mass_damping": 20.0 * 2.0 ** load[:, 2],
        "pressure_phase": 0.1 * load[:, 3],
        "youngs_modulus": 1e7 * (1.0 + 0.02 * load[:, 4]),
    }
    coarse, fine = (
        MembraneForward(square_structure(elements_per_side, each)).strain(damage, start, {}, steps, STEP)
        for each in (order, 2 * order)
    )
    found = {"damage": damage, "load": load, "strain": coarse, "difference": fine - coarse}
    return {name: values.astype(np.float32) for name, values in found.items()}


def learn(delta: Matrix, h: float, share: float = 0.99, shrunk: float = 0.0) -> Matrix:
    """Return the components of differences between histories.

    Parameters
    ----------
    delta : ndarray, shape (pairs, sensors, n)
        Differences of strain [1] or resistance [ohm] at h, 2 h, ...
    h : float
        Step [s].
    share : float
        Share of the variance that the components hold; the rest is spread over them.
    shrunk : float
        Share of the covariance that is taken from between the splines: what some hundred pairs say of it is partly chance.

    Returns
    -------
    ndarray, shape (k, sensors, splines)
        The largest principal components of the least-squares splines, about zero.

    Raises
    ------
    DataError
        There are fewer than 50 pairs.
    """
    pairs, sensors, n = delta.shape
    require(pairs >= 50, f"{pairs} pairs of histories are too few for a covariance. Simulate 50 or more.", DataError)
    splines = spline_matrix(n, h, n * h)
    Q, R = np.linalg.qr(splines)
    c = (delta @ Q).reshape(pairs, -1)
    S = c.T @ c / pairs
    variance, V = np.linalg.eigh((1.0 - shrunk) * S + shrunk * np.diag(np.diag(S)))
    variance, V = np.maximum(variance[::-1], 0.0), V.T[::-1]
    power = np.cumsum(variance) / variance.sum()
    k = int(np.searchsorted(power[:-1], share)) + 1  # the sum may round to less than all
    largest = (np.sqrt(variance[:k] / power[k - 1])[:, None] * V[:k]).reshape(k, sensors, -1)
    return np.asarray(np.linalg.solve(R, largest.reshape(-1, len(R)).T).T.reshape(largest.shape))


def _packed(values: Matrix) -> bytes:
    content = io.BytesIO()
    np.save(content, values.astype(np.float32))
    return content.getvalue()


def _unpacked(file: Path) -> Matrix:
    return np.asarray(np.load(file, allow_pickle=False), dtype=np.float64)


@cache
def default_discrepancy() -> Discrepancy:
    """Read the discrepancy of the default mesh, which ships with the package."""
    return Discrepancy.read()


def is_learned(forward: Forward, learned: Discrepancy) -> bool:
    """Tell whether a discrepancy of the thesis' square was learned for a mesh and a membrane like these."""
    if not isinstance(forward, MembraneForward):
        return False
    structure, given = forward.structure, forward.parameters
    default = asdict(MembraneParams())
    square = square_structure(learned.elements_per_side, learned.order)
    here, there = structure.mesh.nodes, square.mesh.nodes
    if structure.setup.law != square.setup.law or here.shape != there.shape or not np.allclose(here, there):
        return False
    if (structure.setup.zones, structure.setup.sensors) != (square.setup.zones, square.setup.sensors):
        return False
    ratios = {name: given[name] / value if value else 1.0 + abs(given[name]) for name, value in default.items()}
    return all(
        1.0 / (1.0 + LEARNED.get(name, 1e-9)) <= ratio <= 1.0 + LEARNED.get(name, 1e-9) for name, ratio in ratios.items()
    )


def is_load_learned(forward: Forward, record: ResponseRecord) -> bool:
    """Tell whether what acts on the square beside its built-in load is no larger than the changes that were learned with."""
    given = forward.parameters
    loads = {name: np.asarray(load) for name, load in {**forward.inputs, **record.start, **record.inputs}.items()}
    pressure, acceleration = (float(np.abs(loads[name]).max()) for name in ("pressure", "base_acceleration"))
    beside = pressure + given["density"] * given["thickness"] * acceleration
    return beside <= LEARNED["pressure_amplitude"] * given["pressure_amplitude"]

r"""What a finer mesh adds to the strain of the twin's mesh, as a random process.

Symbols: ``delta`` difference of strain [1] between two meshes; ``beta`` its coefficients on cubic B-splines in time, one row
per component of the process: sensor by sensor, spline by spline.

The difference lies above 150 Hz, where the response to the load has next to nothing: below, on the splines of
``SPACING``, it is a third of the thesis' noise, of the whole it is more than half. It depends on damage and load
in no way that a regression with some hundred pairs finds, so it is described by its covariance alone.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np
from gossamer_files import reason
from scipy.interpolate import BSpline

from ..arrays import Matrix
from ..artifacts import read_arrays, read_artifact, write_artifact
from ..errors import ArtifactError, DataError
from ..membrane import MembraneParams, square_structure
from .forward import Forward, MembraneForward

SCHEMA, VERSION = "gossamer.discrepancy", 1
DEFAULT_PATH = Path(__file__).with_name("order_4.json")
SPACING = 1.0 / 300.0  # [s] of the knots: what is faster than half of 1/SPACING is not compared
DEGREE = 3
LEVELS = 32767  # of the numbers in a file
# How far membrane and load may be from those that the discrepancy was learned with, as a share.
LEARNED = {
    "pressure_amplitude": 0.15,
    "pressure_frequency": 0.08,
    "pressure_phase": 0.2,
    "mass_damping": 1.5,
    "youngs_modulus": 0.05,
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
        Coefficients of strain [1] whose outer products add up to the covariance.
    provenance : dict
        How it was made.
    """

    elements_per_side: int
    order: int
    length: float
    components: Matrix
    provenance: dict[str, str]

    def basis(self, steps: int, h: float) -> Matrix:
        """Evaluate the components at h, 2 h, ..., shape (k, sensors, steps); zero after ``length``."""
        splines = spline_matrix(steps, h, self.length)
        return np.asarray(np.einsum("kij,tj->kit", self.components, splines))

    def write(self, path: Path) -> None:
        """Write the JSON card and, beside it, the components in 16 bits each."""
        scale = np.abs(self.components).max(axis=(1, 2)) / LEVELS
        levels = np.round(self.components / scale[:, None, None]).astype(np.int16)
        content = {"elements_per_side": self.elements_per_side, "order": self.order, "length": self.length}
        write_artifact(path, SCHEMA, VERSION, self.provenance, content, {"scale": scale, "levels": levels})

    @classmethod
    def read(cls, path: Path = DEFAULT_PATH) -> Discrepancy:
        """Read what ``write`` wrote.

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
    found[inside] = BSpline.design_matrix(
        np.minimum(time[inside], count * SPACING), knots, DEGREE, extrapolate=True
    ).toarray()
    return found


def learn(delta: Matrix, h: float, share: float = 0.99) -> Matrix:
    """Return the components of differences between histories.

    Parameters
    ----------
    delta : ndarray, shape (pairs, sensors, n)
        Differences of strain [1] at h, 2 h, ...
    h : float
        Step [s].
    share : float
        Share of the variance that the components hold; the rest is spread over them.

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
    if pairs < 50:
        msg = f"{pairs} pairs of histories are too few for a covariance. Simulate 50 or more."
        raise DataError(msg)
    splines = spline_matrix(n, h, n * h)
    Q, R = np.linalg.qr(splines)
    _, s, V = np.linalg.svd((delta @ Q).reshape(pairs, -1) / np.sqrt(pairs), full_matrices=False)
    power = np.cumsum(s**2) / np.sum(s**2)
    k = int(np.searchsorted(power[:-1], share)) + 1  # the sum may round to less than all
    largest = (s[:k, None] * V[:k] / np.sqrt(power[k - 1])).reshape(k, sensors, -1)
    return np.asarray(np.linalg.solve(R, largest.reshape(-1, len(R)).T).T.reshape(largest.shape))


@cache
def default_discrepancy() -> Discrepancy:
    """Read the discrepancy of the default mesh, which ships with the package."""
    return Discrepancy.read()


def is_learned(forward: Forward) -> bool:
    """Tell whether the discrepancy that ships was learned for a mesh and a membrane like these."""
    if not isinstance(forward, MembraneForward):
        return False
    structure, given = forward.structure, forward.parameters
    learned, default = default_discrepancy(), asdict(MembraneParams())
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

"""Turn fitted parameters into a sensor: tables over the plane, positive sums of exponentials, an output of range 1."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError
from ..sensor.artifact import MIN_SPRING_WEIGHT, RelaxationTerm, SensorArtifact
from ..sensor.exponentials import exponential_sum
from .model import PreisachModel
from .parameters import amplitude_name
from .regressors import GAIN
from .settings import FitSettings

Vector = NDArray[np.float64]


def normalised_sensor(settings: FitSettings, model: PreisachModel, x: Vector) -> tuple[SensorArtifact, float, float]:
    """Normalise the fitted weights; return the sensor, the offset and the scale in units of the output's range."""
    N = settings.n_lines
    cells = N * (N + 1) // 2
    fitted = model.weights(x)
    tables = np.zeros((2, N, N))
    for table, part in zip(tables, (fitted[:cells], fitted[cells : 2 * cells]), strict=True):
        table[np.triu_indices(N)] = np.maximum(part, 0.0)
    rise = float(tables[0].sum()) / N
    tables /= rise
    for table in tables:
        table[0] = np.maximum(table[0], MIN_SPRING_WEIGHT)
    ends = np.cumsum([b.size for b in model.blocks])
    p = dict(zip((b.name for b in model.blocks), np.split(x, ends[:-1]), strict=True))
    terms = []
    for j in range(settings.relaxations):
        tau, c = float(np.exp(p["log_tau"][j])), float(p["c"][j])
        used = {d: float(p[amplitude_name(d)][j]) / rise for d in settings.drives}
        if not any(abs(a) > 1e-6 for a in used.values()):
            continue
        b = tau**-c
        decay_rates, weights = _exponentials(b, c)
        terms += [
            RelaxationTerm(
                amplitude=amplitude,
                power=int("linear" in drive),
                rate=b,
                exponent=c,
                decay_rates=tuple(decay_rates.tolist()),
                weights=tuple(weights.tolist()),
                drive=drive.split()[0],
                signed=amplitude < 0.0,
                gain=drive == GAIN,
            )
            for drive, amplitude in used.items()
            if abs(amplitude) > 1e-6
        ]
    mu, nu = (tuple(map(tuple, table.tolist())) for table in tables)
    return SensorArtifact(mu=mu, nu=nu, relaxation=tuple(terms)), float(p["y0"][0]), rise


def _exponentials(b: float, c: float) -> tuple[Vector, Vector]:
    """Return the exponentials of a kernel; close to c = 1 they meet a wider tolerance only."""
    try:
        return exponential_sum(b, c)
    except ConvergenceError:
        return exponential_sum(b, c, tolerance=1e-4)

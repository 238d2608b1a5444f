"""Turn fitted parameters into a sensor: tables over the plane, positive sums of exponentials, an output of range 1.

A fit expands its kernels on a grid of rates that serves the times it is fitted to. The sensor has exponentials of its own,
good for the whole record and beyond, so what it gives is computed from it and not from the fit.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError
from ..sensor.artifact import MIN_SPRING_WEIGHT, RelaxationTerm, SensorArtifact
from ..sensor.exponentials import exponential_sum
from .model import PreisachModel
from .parameters import amplitude_name
from .regressors import GAIN, relaxed
from .settings import FitSettings
from .stretches import Stretch

Vector = NDArray[np.float64]


SHORTEST, LONGEST = 1e-2, 1e4  # [s]; kernels hold between these times at least
TOLERANCES = (1e-6, 1e-5, 1e-4)  # of a kernel [1]; few are content with the last


def normalised_sensor(
    settings: FitSettings, model: PreisachModel, x: Vector, shortest: float, longest: float
) -> tuple[SensorArtifact, float, float]:
    """Normalise the fitted weights.

    Parameters
    ----------
    settings : FitSettings
        How they were fitted.
    model : PreisachModel
        The model of the fit.
    x : ndarray, shape (n,)
        Its parameters.
    shortest, longest : float
        Times [s] between which the records need the kernels.

    Returns
    -------
    sensor : SensorArtifact
        Normalised sensor without provenance.
    offset, scale : float
        Output in units of the fitted output's range [1] = offset + scale * normalised output.
    """
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
        decay_rates, weights = _exponentials(b, c, min(SHORTEST, shortest), max(LONGEST, longest))
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


def normalised_output(sensor: SensorArtifact, stretch: Stretch) -> Vector:
    """Return the normalised output [1] of a sensor over the strain of a stretch, shape (m,), starting at rest."""
    N = sensor.n_lines
    cells = N * (N + 1) // 2
    mu, nu = (table[np.triu_indices(N)] for table in sensor.tables())
    output = stretch.A[:, :cells] @ mu + stretch.A[:, cells : 2 * cells] @ nu
    for drive in sorted({_drive(term) for term in sensor.relaxation}):
        terms = [term for term in sensor.relaxation if _drive(term) == drive]
        rates = np.concatenate([term.decay_rates for term in terms])
        weights = np.concatenate([term.amplitude * np.array(term.weights) for term in terms])
        output = output + relaxed(stretch.record.time, stretch.strain, rates, (drive,)) @ weights
    return np.asarray(output, dtype=float)


def _drive(term: RelaxationTerm) -> str:
    return GAIN if term.gain else f"{term.drive} linear" if term.power else term.drive


def _exponentials(b: float, c: float, shortest: float, longest: float) -> tuple[Vector, Vector]:
    """Return the exponentials of a kernel that meet the narrowest tolerance within reach."""
    for tolerance in TOLERANCES[:-1]:
        with suppress(ConvergenceError):
            return exponential_sum(b, c, shortest=shortest, longest=longest, tolerance=tolerance)
    return exponential_sum(b, c, shortest=shortest, longest=longest, tolerance=TOLERANCES[-1])

"""Turn fitted parameters into a sensor: tables over the plane, positive sums of exponentials, an output of range 1.

A fit expands its kernels on a grid of rates for the fitted times. The sensor has exponentials of its own, which are
accurate for the whole record and beyond. So the predictions are computed from the sensor and not from the fit.
"""

from __future__ import annotations

from contextlib import suppress

import casadi as ca
import numpy as np

from ...arrays import Vector
from ...errors import ConvergenceError
from ...modes import exponential_sum
from ..artifact import MIN_SPRING_WEIGHT, RelaxationTerm, SensorArtifact
from ..law import ModeBank
from .regression import Regression, Stretch, relaxed
from .settings import PreisachSettings
from .weights import WeightFunction, by_block

SHORTEST, LONGEST = 1e-2, 1e4  # [s]; kernels hold between these times at least
TOLERANCES = (1e-6, 1e-5, 1e-4)  # of a kernel [1]; tried in order, the loosest is rarely needed
SMALL = 1e-6  # amplitude [1] of a term that is left out


def normalised_sensor(
    settings: PreisachSettings, function: WeightFunction, x: Vector, regression: Regression
) -> tuple[SensorArtifact, float, float]:
    """Normalise the fitted weights.

    Parameters
    ----------
    settings : PreisachSettings
        How they were fitted.
    function : WeightFunction
        Weights of the fit.
    x : ndarray, shape (n,)
        Its parameters.
    regression : Regression
        The records.

    Returns
    -------
    sensor : SensorArtifact
        Normalised sensor without provenance.
    y0, rise : float
        Resistance in units of its fitted range [1] = y0 + rise * normalised output.
    """
    N = settings.n_lines
    fitted = function(x)
    tables = np.zeros((2, N, N))
    for table, part in zip(tables, (fitted.mu, fitted.nu), strict=True):
        table[np.triu_indices(N)] = np.maximum(part, 0.0)
    rise = float(tables[0].sum()) / N
    tables /= rise
    for table in tables:
        table[0] = np.maximum(table[0], MIN_SPRING_WEIGHT)
    p = {name: part.full()[:, 0] for name, part in by_block(function.blocks, ca.DM(x)).items()}
    shortest = min(SHORTEST, float(regression.kernels.times[1]))
    longest = max(LONGEST, *(2.0 * float(s.record.time[-1]) for s in regression.stretches))
    terms = []
    for j in range(settings.relaxations):
        tau, c = float(np.exp(p["log_tau"][j])), float(p["c"][j])
        used = {drive: float(p[drive.symbol][j]) / rise for drive in settings.drives}
        used = {drive: amplitude for drive, amplitude in used.items() if abs(amplitude) > SMALL}
        if not used:
            continue
        b = tau**-c
        decay_rates, weights = _exponentials(b, c, shortest, longest)
        terms += [
            RelaxationTerm(
                amplitude=amplitude,
                power=drive.power,
                rate=b,
                exponent=c,
                decay_rates=tuple(decay_rates.tolist()),
                weights=tuple(weights.tolist()),
                drive=drive.strain,
                signed=amplitude < 0.0,
                gain=drive.gain,
            )
            for drive, amplitude in used.items()
        ]
    mu, nu = (tuple(map(tuple, table.tolist())) for table in tables)
    return SensorArtifact(mu=mu, nu=nu, relaxation=tuple(terms)), float(p["y0"][0]), rise


def normalised_output(sensor: SensorArtifact, stretch: Stretch) -> Vector:
    """Return the normalised output [1] of a sensor over the strain of a stretch, shape (m,), starting at rest."""
    mu, nu = (table[np.triu_indices(sensor.n_lines)] for table in sensor.tables())
    output = stretch.U @ mu - stretch.D @ nu
    bank = ModeBank.of(sensor.relaxation)
    Z = relaxed(stretch.record.time, stretch.strain, bank.decay_rates, tuple(bank.amplitudes))
    return np.asarray(output + Z @ np.concatenate([np.empty(0), *bank.amplitudes.values()]))


def _exponentials(b: float, c: float, shortest: float, longest: float) -> tuple[Vector, Vector]:
    """Return the exponentials of a kernel that meet the narrowest tolerance within reach."""
    for tolerance in TOLERANCES[:-1]:
        with suppress(ConvergenceError):
            return exponential_sum(b, c, shortest=shortest, longest=longest, tolerance=tolerance)
    return exponential_sum(b, c, shortest=shortest, longest=longest, tolerance=TOLERANCES[-1])

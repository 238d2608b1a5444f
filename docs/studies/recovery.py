"""Strain recovered from resistance, the experiment of Section 5.5, on the SYNTHETIC specimen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from gossamer_models import Stepper, simulate
from gossamer_models.compensator import compensator_model
from gossamer_models.fitting import Record
from gossamer_models.sensor.fit import PreisachFit, PreisachSettings, fit_preisach
from numpy.typing import NDArray

from .metrics import Metric
from .specimen import specimen_record

Vector = NDArray[np.float64]

SHIFT = 10.0  # [1], added to the output: resistances must be positive
NOISE = 1.5  # [ohm]
TARGET = 1.0  # [% of squares]


@dataclass(frozen=True, kw_only=True)
class Recovery:
    """The experiment of Section 5.5.

    Attributes
    ----------
    record : Record
        Four cycles, of which the first two are fitted.
    fit : PreisachFit
        The sensor.
    time, strain : ndarray, shape (m,)
        Times [s] and true strain [1] of the samples that the compensators see.
    predicted : ndarray of bool, shape (m,)
        Those of the two cycles that were not fitted.
    estimates : dict
        Name of the compensator to the strain [1] it gives for those samples, shape (m - lag,): without its last ``lag``
        ones, where the estimate is delivered after the record.
    deviation : ndarray
        Standard deviation [1] that the estimator states, of the shape of its strain.
    """

    record: Record
    fit: PreisachFit
    time: Vector
    strain: Vector
    predicted: NDArray[np.bool_]
    estimates: dict[str, Vector]
    deviation: Vector

    def squares(self, name: str) -> float:
        """Return the measure of Section 5.5, sum of squared errors over sum of squares [%]."""
        estimate = self.estimates[name]
        keep = self.predicted[: estimate.size]
        true = self.strain[: estimate.size][keep]
        return 100.0 * float(((estimate[keep] - true) ** 2).sum() / (true**2).sum())

    def metrics(self) -> list[Metric]:
        """Return, for each compensator, the measure of Section 5.5, 4 % in the thesis, and its root."""
        metrics = []
        for name in self.estimates:
            what, squares = f"{self.record.name}, Section 5.5, {name}", self.squares(name)
            metrics.append(Metric(what=what, unit="% of squares", value=squares, target=TARGET))
            metrics.append(Metric(what=f"{what}, relative RMS", unit="%", value=10.0 * float(np.sqrt(squares))))
        return metrics


def run_recovery() -> Recovery:
    """Fit the first two cycles of the SYNTHETIC Dataset-3 and recover the strain of all four."""
    record = specimen_record(3)
    train = record.time < 200.0
    full_scale = float(record.strain.max())
    settings = PreisachSettings.of("preisach", modes=7, relaxations=7)
    fit = fit_preisach((record,), (train,), settings, full_scale=full_scale, rest_resistance=0.0)
    steps = np.diff(record.time)
    output = {"resistance": (record.resistance[1:] - fit.rest_resistance) / fit.resistance_change + SHIFT}
    scales = {"rest_resistance": SHIFT, "full_scale_resistance_change": 1.0, "full_scale_strain": full_scale}
    inverse = Stepper(compensator_model(fit.artifact), **scales)
    estimator = Stepper(compensator_model(fit.artifact, "estimator"), noise=NOISE / fit.resistance_change, **scales)
    inverse.initialize()
    estimator.initialize()
    exact = simulate(inverse, steps, output, ("strain",))
    late = simulate(estimator, steps, output, ("strain", "strain_deviation", "delay"))
    lag = round(float(late["delay"][-1] / steps[-1]))
    return Recovery(
        record=record,
        fit=fit,
        time=record.time[1:],
        strain=record.strain[1:],
        predicted=~train[1:],
        estimates={"exact inverse": exact["strain"], "estimator": late["strain"][lag:]},
        deviation=late["strain_deviation"][lag:],
    )

"""Fits for chapter 4: the modified Preisach model on the SYNTHETIC specimen.

Settings are those of ``PreisachSettings.of``, the same for all M = P; the predicted stretches play no part in a fit.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Literal

import numpy as np
from gossamer_models.fitting import Record, e1
from gossamer_models.replay import predict_resistance
from gossamer_models.sensor.fit import PreisachFit, PreisachSettings, fit_preisach
from numpy.typing import NDArray

from .metrics import Metric
from .specimen import specimen_record

Vector = NDArray[np.float64]

THESIS = {3: (2.47, 4.3, 1320.0), 5: (1.97, 2.71, 1840.0), 7: (1.18, 2.1, 2790.0)}  # Table 4.1: E1 [%] x 2, time [s]
LONGEST_FIT = 10.0  # [s]


@dataclass(frozen=True, kw_only=True)
class SpecimenFit:
    """One row of Table 4.1 on the SYNTHETIC specimen.

    Attributes
    ----------
    modes : int
        M = P.
    fit : PreisachFit
        To 0..200 s of Dataset-1.
    seconds : float
        Wall time of the fit [s].
    records : tuple of Record
        Dataset-1 and Dataset-2.
    predicted : tuple of ndarray
        Resistance [ohm] that the sensor gives for them, from rest.
    """

    modes: int
    fit: PreisachFit
    seconds: float
    records: tuple[Record, ...]
    predicted: tuple[Vector, ...]

    def metrics(self) -> list[Metric]:
        """Return the errors on Dataset-1 and Dataset-2 beside the thesis', and the time of the fit."""
        M = self.modes
        errors = [
            Metric(
                what=f"{record.name}, Preisach M = P = {M}, E1 of the change",
                unit="%",
                value=e1(record.resistance, predicted, rest=0.0),
                target=thesis,
            )
            for record, predicted, thesis in zip(self.records, self.predicted, THESIS[M], strict=False)
        ]
        return [*errors, Metric(what=f"fit M = P = {M}, two starts", unit="s", value=self.seconds, target=LONGEST_FIT)]


def run_specimen(ridge: Literal["auto"] | None = None) -> list[SpecimenFit]:
    """Fit the modal model to 0..200 s of the SYNTHETIC Dataset-1, for every M = P; ``ridge`` as of ``PreisachSettings``."""
    first, second = specimen_record(1), specimen_record(2)
    full_scale = float(second.strain.max())
    fits = []
    for M in THESIS:
        settings = PreisachSettings.of("preisach", modes=M, relaxations=M, ridge=ridge)
        begun = time.perf_counter()
        fit = fit_preisach((first,), (first.time < 200.0,), settings, full_scale=full_scale, rest_resistance=0.0)
        seconds = time.perf_counter() - begun
        predicted = (predict_resistance(fit, first), predict_resistance(fit, second))
        fits.append(SpecimenFit(modes=M, fit=fit, seconds=seconds, records=(first, second), predicted=predicted))
    return fits

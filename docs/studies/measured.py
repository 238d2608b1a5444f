"""Fits of measured records: silver thread and carbon black, beyond the thesis.

The training stretch comes first in time. The test stretch plays no part in a fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from gossamer_models.fitting import Columns, Record, nrmse, read_record
from gossamer_models.replay import predict_resistance, recover_by_fit
from gossamer_models.sensor.fit import PreisachFit, PreisachSettings, fit_preisach
from numpy.typing import NDArray

from .metrics import Metric

Vector = NDArray[np.float64]
Targets = tuple[float | None, float | None]

# the step is assumed; the records have no clock
NYLON_COLUMNS = Columns(strain="output", resistance="input", sampling_step=0.1)
CARBON_COLUMNS = Columns(time="t_s", strain="strain", resistance="R_inner_ohm")
PLANS: tuple[tuple[str, str, float, Targets, Targets | None], ...] = (
    # record, settings, part that is fitted [1], NRMSE targets [% of range] of the output, of the recovered strain
    ("strain_triangular", "nylon", 0.5, (0.8, 1.8), None),
    ("strain_sin_30", "nylon", 0.5, (0.7, 0.8), (0.7, 1.2)),
    ("random_sawtooth_7_5wt", "jagged", 0.6, (2.5, 3.5), None),
    ("velocity_profile_10wt", "carbon", 0.6, (0.9, 1.4), (3.0, 7.0)),
    ("velocity_profile_10wt", "thesis", 0.6, (None, None), None),
)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """NRMSE [% of range] of one quantity; ``train`` is None where a whole record was predicted."""

    what: str
    train: Metric | None
    test: Metric


@dataclass(frozen=True, kw_only=True)
class MeasuredFit:
    """One model fitted to the beginning of one measured record.

    Attributes
    ----------
    name, model : str
        Of the record and of the model: the thesis' drives, or an extension.
    record : Record
        The measured record.
    fit : PreisachFit
        The sensor.
    recovered : dict
        Name of the inverse to the strain [1] it recovers, shape (m,).
    targets, strain_targets : tuple
        NRMSE [% of range] on the training and the test stretch: of the output, of the strain by the first inverse.
    """

    name: str
    model: str
    record: Record
    fit: PreisachFit
    recovered: dict[str, Vector]
    targets: Targets = (None, None)
    strain_targets: Targets = (None, None)

    def comparisons(self) -> list[Comparison]:
        """Return the errors of the output and of the strain that each inverse recovers."""
        extended = "" if self.model == "extension" else f", {self.model}"
        pairs = [self._compare(f"forward{extended}", self.record.resistance, self.fit.predicted[0], self.targets)]
        targets = self.strain_targets
        for inverse, strain in self.recovered.items():
            pairs.append(self._compare(f"recovered strain, {inverse}", self.record.strain, strain, targets))
            targets = (None, None)
        return pairs

    def _compare(self, quantity: str, measured: Vector, predicted: Vector, targets: Targets) -> Comparison:
        what, size, rows = f"{self.name}, {quantity}", float(np.ptp(measured)), self.fit.train[0]
        train, test = (
            Metric(
                what=f"{what}, {stretch}",
                unit="% of range",
                value=nrmse(measured[part], predicted[part], size),
                target=target,
            )
            for stretch, part, target in (("train", rows, targets[0]), ("test", ~rows, targets[1]))
        )
        return Comparison(what=what, train=train, test=test)


@dataclass(frozen=True, kw_only=True)
class Transfer:
    """A sensor fitted to one measured record and evaluated on another.

    Attributes
    ----------
    source, target, model : str
        Names of the records and of the model.
    record : Record
        The target.
    predicted : ndarray, shape (m,)
        Output of the sensor for it, in its unit.
    """

    source: str
    target: str
    model: str
    record: Record
    predicted: Vector

    def comparison(self) -> Comparison:
        """Return the error of the output."""
        what = f"{self.source} -> {self.target}, forward, {self.model}"
        test = Metric(what=what, unit="% of range", value=nrmse(self.record.resistance, self.predicted))
        return Comparison(what=what, train=None, test=test)


def measured_records(data: Path) -> dict[str, Record]:
    """Read the measured records in the folders ``nylon_silver`` and ``cb_silicone``, by the names of their files."""
    return {
        path.stem: read_record(path, columns)
        for folder, columns in (("nylon_silver", NYLON_COLUMNS), ("cb_silicone", CARBON_COLUMNS))
        for path in sorted((data / folder).glob("*.csv"))
        if path.stem != "stepped_amplitude_7_5wt"
    }


def measured_settings() -> dict[str, PreisachSettings]:
    """Return the settings for silver thread, carbon black, jagged carbon black, and with the thesis' drives alone."""
    carbon = PreisachSettings.of("preisach-hats", extension="reversing", delay=24)
    return {
        "nylon": PreisachSettings.of("preisach-hats", extension="gain", ridge="auto"),
        "carbon": carbon,
        "jagged": replace(carbon, extension="falling", relaxations=9, signed=False, ridge="auto"),
        "thesis": PreisachSettings.of("preisach-hats"),
    }


def run_measured(data: Path) -> list[MeasuredFit]:
    """Fit the beginning of measured records."""
    records, settings = measured_records(data), measured_settings()
    fits = []
    for name, model, part, targets, strain_targets in PLANS:
        record = records[name]
        fit = _fit(record, settings[model], part)
        recovered = {}
        if strain_targets is not None:
            recovered["direct inverse"] = recover_by_fit(fit, record).strain
            if settings[model].invertible:
                exact = replace(fit, artifact=replace(fit.artifact, inverse=None))
                recovered["exact inverse"] = recover_by_fit(exact, record).strain
        fits.append(
            MeasuredFit(
                name=name,
                model="thesis' drives" if model == "thesis" else "extension",
                record=record,
                fit=fit,
                recovered=recovered,
                targets=targets,
                strain_targets=strain_targets or (None, None),
            )
        )
    return fits


def run_transfers(data: Path) -> list[Transfer]:
    """Fit one whole record and predict another."""
    records, settings = measured_records(data), measured_settings()
    transfers = []
    for source, target in (("strain_sin_30", "strain_triangular"), ("strain_triangular", "strain_mixed_15_25")):
        for name, model in (("thesis' drives", "thesis"), ("extension", "nylon")):
            predicted = predict_resistance(_fit(records[source], settings[model], 1.0), records[target])
            transfers.append(Transfer(source=source, target=target, model=name, record=records[target], predicted=predicted))
    return transfers


def _fit(record: Record, settings: PreisachSettings, part: float) -> PreisachFit:
    train = np.arange(record.time.size) < round(part * record.time.size)
    full_scale = 1.0 if record.strain.max() > 0.9 else None
    return fit_preisach((record,), (train,), settings, full_scale=full_scale)

"""Every number that identification is asked to reach, from one function; a page of results is made from it.

Training stretches come first in time and test stretches are never looked at: settings are those of
``settings_for``, the same for all records of a family. ``run_*`` return the fits, for pictures; ``assess_*`` turn them
into figures.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from ..measures import e1, nrmse
from ..specimen import dataset
from .judge import predict_output, recover_strain
from .preisach import Fit, fit_preisach
from .records import Columns, Record, read_record
from .regressors import DRIVES
from .run import settings_for
from .settings import FitSettings

Vector = NDArray[np.float64]
Limits = tuple[float | None, float | None]

NYLON = Columns(strain="output", output="input", sampling_step=0.1)  # the step is assumed; the records have no clock
CARBON = Columns(time="t_s", strain="strain", output="R_inner_ohm")
THESIS = {3: (2.47, 4.3, 1320.0), 5: (1.97, 2.71, 1840.0), 7: (1.18, 2.1, 2790.0)}  # Table 4.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One number.

    Attributes
    ----------
    what : str
        Record, model and quantity.
    unit : str
        Its unit.
    reached : float
        What was reached.
    asked : float or None
        What was asked for; None for a number that is only reported.
    more_is_better : bool
        True for a speed-up.
    """

    what: str
    unit: str
    reached: float
    asked: float | None = None
    more_is_better: bool = False

    @property
    def met(self) -> bool | None:
        """Tell whether the number is reached; None if none was asked for."""
        if self.asked is None:
            return None
        return self.reached >= self.asked if self.more_is_better else self.reached <= self.asked


@dataclass(frozen=True, kw_only=True)
class SpecimenFit:
    """One row of Table 4.1 on the SYNTHETIC specimen.

    Attributes
    ----------
    modes : int
        M = P.
    fit : Fit
        To 0..200 s of Dataset-1.
    seconds : float
        Wall time of the fit [s].
    records : tuple of Record
        Dataset-1 and Dataset-2.
    predicted : tuple of ndarray
        What the sensor says for them [ohm], from rest.
    """

    modes: int
    fit: Fit
    seconds: float
    records: tuple[Record, ...]
    predicted: tuple[Vector, ...]


@dataclass(frozen=True, kw_only=True)
class MeasuredFit:
    """One model fitted to the beginning of one measured record.

    Attributes
    ----------
    name, model : str
        Of the record and of the model: the thesis' drives, or an extension.
    record : Record
        What was measured.
    fit : Fit
        The sensor.
    recovered : dict
        Name of the inverse to the strain [1] it recovers, shape (m,).
    asked, asked_back : tuple
        NRMSE [% of range] asked for on the training and the test stretch: of the output, of the strain by the first inverse.
    """

    name: str
    model: str
    record: Record
    fit: Fit
    recovered: dict[str, Vector]
    asked: Limits = (None, None)
    asked_back: Limits = (None, None)


@dataclass(frozen=True, kw_only=True)
class Transfer:
    """A sensor fitted to one measured record and judged on another.

    Attributes
    ----------
    source, target, model : str
        Names of the records and of the model.
    record : Record
        The target.
    predicted : ndarray, shape (m,)
        What the sensor says for it, in its unit.
    """

    source: str
    target: str
    model: str
    record: Record
    predicted: Vector


def assess(data: Path | None = None) -> list[Figure]:
    """Compute all figures.

    Parameters
    ----------
    data : Path or None
        Folder with ``nylon_silver`` and ``cb_silicone``; None leaves the measured records out.

    Returns
    -------
    list of Figure
        In the order of the request.
    """
    figures = [*assess_specimen(), *assess_speed()]
    if data is not None:
        figures += assess_measured(data)
    return figures


def specimen_record(number: int) -> Record:
    """Return a SYNTHETIC dataset as a record of the change of resistance [ohm]."""
    d = dataset(number)
    return Record(
        name=d.name,
        time=d.time,
        strain=d.strain,
        output=d.resistance_change,
        lines=np.arange(d.time.size, dtype=int) + 2,
    )


def assess_specimen(fits: Iterable[SpecimenFit] | None = None) -> list[Figure]:
    """Return the figures of Table 4.1 on the SYNTHETIC specimen, fitted now or before."""
    figures = []
    for row in run_specimen() if fits is None else fits:
        M = row.modes
        for record, predicted, asked in zip(row.records, row.predicted, THESIS[M], strict=False):
            what = f"{record.name}, Preisach M = P = {M}, E1 of the change"
            figures.append(Figure(what=what, unit="%", reached=e1(record.output, predicted, rest=0.0), asked=asked))
        figures.append(Figure(what=f"fit M = P = {M}, two starts", unit="s", reached=row.seconds, asked=10.0))
    return figures


def run_specimen(modes: Iterable[int] = tuple(THESIS), ridge: Literal["auto"] | None = None) -> list[SpecimenFit]:
    """Fit the modal model to 0..200 s of the SYNTHETIC Dataset-1, for every M = P; ``ridge`` as of ``settings_for``."""
    first, second = specimen_record(1), specimen_record(2)
    full_scale = float(second.strain.max())
    fits = []
    for M in modes:
        begun = time.perf_counter()
        fit = fit_preisach(
            (first,),
            (first.time < 200.0,),
            settings_for("preisach", modes=M, relaxations=M, ridge=ridge),
            full_scale=full_scale,
            rest_output=0.0,
        )
        seconds = time.perf_counter() - begun
        predicted = (predict_output(fit, first), predict_output(fit, second))
        fits.append(SpecimenFit(modes=M, fit=fit, seconds=seconds, records=(first, second), predicted=predicted))
    return fits


def assess_speed() -> list[Figure]:
    """Compare the fit M = P = 7 with ``scipy.optimize.least_squares``: same residual, same start, finite differences.

    The peer gets the bounds but not the constraints on densities, which it cannot take, and its own settings, or the
    scaling by columns that helps it most. Its time is that of its iterations on the residual function of the fit; ours
    is that or the whole fit's, preparation and artifact included. How often the peer evaluates depends on rounding (2700 to
    20000 times from starts 1e-9 apart), so one run says little: it runs from the same start and from four such
    neighbours, and the median counts.
    """
    record = specimen_record(1)
    settings = settings_for("preisach", starts=1)
    full_scale = float(record.strain.max())

    def whole() -> Fit:
        return fit_preisach((record,), (record.time < 200.0,), settings, full_scale=full_scale, rest_output=0.0)

    fit = whole()
    solver, problem = fit.solver, fit.solver.problem
    free = problem.lower < problem.upper
    bounds = problem.lower[free], problem.upper[free]
    start = np.clip(np.concatenate([b.start for b in fit.blocks]), problem.lower, problem.upper)
    rng = np.random.default_rng(0)
    starts = [start[free], *(np.clip(start[free] + 1e-9 * rng.normal(size=free.sum()), *bounds) for _ in range(4))]

    def residual(q: Vector) -> Vector:
        x = start.copy()
        x[free] = q
        return solver.stacked(x)

    with threadpool_limits(1):  # of which the fit makes use; the peer is faster so, too
        runs = [
            (
                _seconds(whole),
                _seconds(partial(solver.minimize, start)),
                *(
                    _seconds(partial(least_squares, residual, q, bounds=bounds, x_scale=scale, max_nfev=1000))
                    for scale in (1.0, "jac")
                ),
            )
            for q in starts
        ]
    seconds, iterating, plain, scaled = np.transpose(runs)
    ours, alone = float(np.median(seconds)), float(np.median(iterating))
    figures = [
        Figure(what="fit M = P = 7, 400 samples, reading to artifact", unit="s", reached=ours, asked=10.0),
        Figure(what="its iterations alone", unit="s", reached=alone),
    ]
    for name, times, asked in (("", plain, 20.0), (" with scaled columns", scaled, None)):
        median = float(np.median(times))
        figures += [
            Figure(what=f"least_squares{name}, from the same start", unit="s", reached=float(times[0])),
            Figure(what=f"least_squares{name}, least of five", unit="s", reached=float(times.min())),
            Figure(what=f"least_squares{name}, median of five", unit="s", reached=median),
            Figure(what=f"iterations faster than least_squares{name} by", unit="times", reached=median / alone),
            Figure(
                what=f"whole fit faster than least_squares{name} by",
                unit="times",
                reached=median / ours,
                asked=asked,
                more_is_better=True,
            ),
        ]
    return figures


def _seconds(call: Callable[[], object]) -> float:
    begun = time.perf_counter()
    call()
    return time.perf_counter() - begun


def assess_measured(
    data: Path, fits: Iterable[MeasuredFit] | None = None, transfers: Iterable[Transfer] | None = None
) -> list[Figure]:
    """Return the figures on measured records, fitted now or before."""
    figures: list[Figure] = []
    for row in run_measured(data) if fits is None else fits:
        train, extended = row.fit.train[0], "" if row.model == "extension" else f", {row.model}"
        figures += _pair(f"{row.name}, forward{extended}", row.record.output, row.fit.predicted[0], train, row.asked)
        asked = row.asked_back
        for inverse, found in row.recovered.items():
            figures += _pair(f"{row.name}, recovered strain, {inverse}", row.record.strain, found, train, asked)
            asked = (None, None)
    for each in run_transfers(data) if transfers is None else transfers:
        what = f"{each.source} -> {each.target}, forward, {each.model}"
        figures.append(Figure(what=what, unit="% of range", reached=nrmse(each.record.output, each.predicted)))
    return figures


def measured_records(data: Path) -> dict[str, Record]:
    """Read the measured records, by the names of their files."""
    return {
        path.stem: read_record(path, columns)
        for folder, columns in (("nylon_silver", NYLON), ("cb_silicone", CARBON))
        for path in sorted((data / folder).glob("*.csv"))
        if path.stem != "stepped_amplitude_7_5wt"
    }


def measured_settings() -> dict[str, FitSettings]:
    """Return the settings for silver thread, carbon black, jagged carbon black, and with the thesis' drives alone."""
    carbon = settings_for("preisach-hats", extension="reversing")
    return {
        "nylon": settings_for("preisach-hats", extension="gain", ridge="auto"),
        "carbon": carbon,
        "jagged": replace(carbon, drives=DRIVES, relaxations=9, signed=False, auto_ridge=True),
        "thesis": settings_for("preisach-hats"),
    }


def run_measured(data: Path) -> list[MeasuredFit]:
    """Fit the beginning of measured records."""
    records, settings = measured_records(data), measured_settings()
    fits = []
    plans: tuple[tuple[str, str, float, Limits, Limits | None], ...] = (
        ("strain_triangular", "nylon", 0.5, (0.8, 1.8), None),
        ("strain_sin_30", "nylon", 0.5, (0.7, 0.8), (0.7, 1.2)),
        ("random_sawtooth_7_5wt", "jagged", 0.6, (2.5, 3.5), None),
        ("velocity_profile_10wt", "carbon", 0.6, (0.9, 1.4), (3.0, 7.0)),
        ("velocity_profile_10wt", "thesis", 0.6, (None, None), None),
    )
    for name, model, part, asked, asked_back in plans:
        record = records[name]
        fit = _fit(record, settings[model], part)
        recovered = {}
        if asked_back is not None:
            recovered["direct inverse"] = recover_strain(fit, record)
            if settings[model].invertible:
                exact = replace(fit, artifact=replace(fit.artifact, inverse=None))
                recovered["exact inverse"] = recover_strain(exact, record)
        fits.append(
            MeasuredFit(
                name=name,
                model="thesis' drives" if model == "thesis" else "extension",
                record=record,
                fit=fit,
                recovered=recovered,
                asked=asked,
                asked_back=asked_back or (None, None),
            )
        )
    return fits


def run_transfers(data: Path) -> list[Transfer]:
    """Fit one whole record and predict another."""
    records, settings = measured_records(data), measured_settings()
    transfers = []
    for source, target in (("strain_sin_30", "strain_triangular"), ("strain_triangular", "strain_mixed_15_25")):
        for name, model in (("thesis' drives", "thesis"), ("extension", "nylon")):
            predicted = predict_output(_fit(records[source], settings[model], 1.0), records[target])
            transfers.append(
                Transfer(source=source, target=target, model=name, record=records[target], predicted=predicted)
            )
    return transfers


def _fit(record: Record, settings: FitSettings, part: float) -> Fit:
    train = np.arange(record.time.size) < round(part * record.time.size)
    full_scale = 1.0 if record.strain.max() > 0.9 else None
    return fit_preisach((record,), (train,), settings, full_scale=full_scale)


def _pair(what: str, measured: Vector, predicted: Vector, train: NDArray[np.bool_], asked: Limits) -> list[Figure]:
    size = float(np.ptp(measured))
    return [
        Figure(
            what=f"{what}, {name}",
            unit="% of range",
            reached=nrmse(measured[rows], predicted[rows], size),
            asked=limit,
        )
        for name, rows, limit in (("train", train, asked[0]), ("test", ~train, asked[1]))
    ]

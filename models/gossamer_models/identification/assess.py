"""Every number that identification is asked to reach, from one function; a page of results is made from it.

Training stretches come first in time and test stretches are never looked at: settings are those of
``settings_for``, the same for all records of a family.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ..specimen import dataset
from .judge import predict_output, recover_strain
from .preisach import Fit, FitSettings, fit_preisach
from .records import Columns, Record, read_record
from .run import settings_for

Vector = NDArray[np.float64]

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


def assess_specimen() -> list[Figure]:
    """Return the figures of Table 4.1 on the SYNTHETIC specimen: fitted to 0..200 s of Dataset-1."""
    first, second = specimen_record(1), specimen_record(2)
    full_scale = float(second.strain.max())
    figures = []
    for M, (asked_1, asked_2, _) in THESIS.items():
        begun = time.perf_counter()
        fit = fit_preisach(
            (first,),
            (first.time < 200.0,),
            settings_for("preisach", modes=M, relaxations=M),
            full_scale=full_scale,
            rest_output=0.0,
        )
        seconds = time.perf_counter() - begun
        for record, asked in ((first, asked_1), (second, asked_2)):
            error = e1(record.output, predict_output(fit, record))
            figures.append(
                Figure(
                    what=f"{record.name}, Preisach M = P = {M}, E1 of the change", unit="%", reached=error, asked=asked
                )
            )
        figures.append(Figure(what=f"fit M = P = {M}, two starts", unit="s", reached=seconds, asked=10.0))
    return figures


def assess_speed() -> list[Figure]:
    """Compare the fit M = P = 7 with ``scipy.optimize.least_squares``: same residual, same start, finite differences.

    The peer gets the bounds but not the constraints on densities, which it cannot take, and its own settings, or the
    scaling by columns that helps it most. Both iterate on the residual function of the fit, which is prepared before.
    """
    record = specimen_record(1)
    settings = settings_for("preisach", starts=1)
    begun = time.perf_counter()
    fit = fit_preisach(
        (record,), (record.time < 200.0,), settings, full_scale=float(record.strain.max()), rest_output=0.0
    )
    seconds = time.perf_counter() - begun
    solver, problem = fit.solver, fit.solver.problem
    free = problem.lower < problem.upper
    start = np.clip(np.concatenate([b.start for b in fit.blocks]), problem.lower, problem.upper)
    begun = time.perf_counter()
    solver.minimize(start)
    iterating = time.perf_counter() - begun

    def residual(q: Vector) -> Vector:
        x = start.copy()
        x[free] = q
        return solver.stacked(x)

    peers = {}
    for name, scale in (("its defaults", 1.0), ("scaled columns", "jac")):
        begun = time.perf_counter()
        least_squares(
            residual, start[free], bounds=(problem.lower[free], problem.upper[free]), x_scale=scale, max_nfev=1000
        )
        peers[name] = time.perf_counter() - begun
    first, second = peers.values()
    return [
        Figure(what="fit M = P = 7, 400 samples, reading to artifact", unit="s", reached=seconds, asked=10.0),
        Figure(what="its iterations alone", unit="s", reached=iterating),
        *(Figure(what=f"least_squares, {name}", unit="s", reached=t) for name, t in peers.items()),
        Figure(what="iterations faster than least_squares by", unit="times", reached=first / iterating),
        Figure(
            what="iterations faster than least_squares with scaled columns by", unit="times", reached=second / iterating
        ),
        Figure(
            what="whole fit faster than least_squares by",
            unit="times",
            reached=first / seconds,
            asked=20.0,
            more_is_better=True,
        ),
    ]


def assess_measured(data: Path) -> list[Figure]:
    """Return the figures on measured records."""
    records = {
        path.stem: read_record(path, columns)
        for folder, columns in (("nylon_silver", NYLON), ("cb_silicone", CARBON))
        for path in sorted((data / folder).glob("*.csv"))
        if path.stem != "stepped_amplitude_7_5wt"
    }
    figures: list[Figure] = []
    nylon = replace(settings_for("preisach-hats", extension="falling"), direct_inverse=True)
    carbon = settings_for("preisach-hats", extension="reversing", relaxations=9)
    jagged = replace(carbon, signed=False, ridge=1e-2, relaxation_ridge=1e-2)
    for name, settings, part, forward, back in (
        ("strain_triangular", nylon, 0.5, (0.8, 1.8), None),
        ("strain_sin_30", nylon, 0.5, (0.7, 0.8), (0.7, 1.2)),
        ("random_sawtooth_7_5wt", jagged, 0.6, (2.5, 3.5), None),
        ("velocity_profile_10wt", carbon, 0.6, (0.9, 1.4), (3.0, 7.0)),
    ):
        record = records[name]
        fit = _fit(record, settings, part)
        train = fit.train[0]
        figures += _pair(f"{name}, forward", record.output, fit.predicted[0], train, forward)
        if back is None:
            continue
        figures += _pair(
            f"{name}, recovered strain, direct inverse", record.strain, recover_strain(fit, record), train, back
        )
        if settings.invertible:
            exact = replace(fit, artifact=replace(fit.artifact, inverse=None))
            found = recover_strain(exact, record)
            figures += _pair(f"{name}, recovered strain, exact inverse", record.strain, found, train, (None, None))
    for source, target in (("strain_sin_30", "strain_triangular"), ("strain_triangular", "strain_mixed_15_25")):
        for model, settings in (("thesis' drives", settings_for("preisach-hats")), ("extension", nylon)):
            fit = _fit(records[source], settings, 1.0)
            off = nrmse(records[target].output, predict_output(fit, records[target]))
            figures.append(Figure(what=f"{source} -> {target}, forward, {model}", unit="% of range", reached=off))
    return figures


def e1(measured: Vector, predicted: Vector) -> float:
    """Return the thesis' error, ``100 sum|y_m - y| / sum|y_m|`` [%]."""
    return 100.0 * float(np.abs(predicted - measured).sum() / np.abs(measured).sum())


def nrmse(measured: Vector, predicted: Vector, size: float | None = None) -> float:
    """Return the root mean square error [% of the range]."""
    size = float(np.ptp(measured)) if size is None else size
    return 100.0 * float(np.sqrt(np.mean((predicted - measured) ** 2))) / size


def _fit(record: Record, settings: FitSettings, part: float) -> Fit:
    train = np.arange(record.time.size) < round(part * record.time.size)
    full_scale = 1.0 if record.strain.max() > 0.9 else None
    return fit_preisach((record,), (train,), settings, full_scale=full_scale)


def _pair(
    what: str, measured: Vector, predicted: Vector, train: NDArray[np.bool_], asked: tuple[float | None, float | None]
) -> list[Figure]:
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

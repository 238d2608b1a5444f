r"""Identify the sensor that ships with the package; ``gossamer identify`` is the general way, for any record.

Symbols: ``s`` normalised strain [1], ``y`` measured output in the record's own unit, ``mu``, ``nu = eta*mu`` weights on the
lines of ``hysteresis.py``, ``a`` relaxation amplitudes. Switching depends on strain alone, so the output is linear in
``mu``, ``nu`` and, for given b, c and d, in ``a``::

    y = offset + U mu - D nu + Z a        U, D: what has switched up and down until each sample, Z: modes of unit amplitude

``mu`` is a sum of hat functions on a coarse grid of the triangle, so it is smooth and positive everywhere. ``eta`` is one
number, found by a search on a line. Separate weights for ``nu`` fit no better on the records at hand and do harm: cells of
eta 0.1 and 10 balance each other along the path of the record and drift on every other path, and where eta rises with
strain, the inverse amplifies errors from cycle to cycle (see the compensator's README).

Run ``python -m gossamer_models.sensor.identify RECORD.csv --out SENSOR.json``; ``--help`` lists the options.
"""

from __future__ import annotations

import csv
import hashlib
import shlex
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import casadi as ca
import numpy as np
import typer
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar, nnls

from ..errors import DataError, GossamerError, ParameterError
from ..identification.densities import hat_functions
from ..identification.regressors import switched
from .artifact import RelaxationTerm, SensorArtifact
from .exponentials import exponential_sum
from .relaxation import ModeBank, decay, rise

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """How to fit.

    Attributes
    ----------
    n_lines : int
        Lines and bins along a line of the finished tables.
    n_knots : int
        Knots of the hat functions along each axis.
    train_fraction : float
        Leading part of the record that is fitted [1]; the rest measures the prediction.
    skip : int
        Samples at the start that are left out: a meter that clips at its lower end, for instance.
    least_spring, least_weight : float
        Lower bounds of the weights on the spring line and on all others, in units of the output's range.
    ridge : float
        Penalty on the hysteretic weights; a record of equal cycles fixes sums along its own path only.
    eta : tuple of float
        Range in which eta [1] is searched.
    terms : tuple of (float, float, int)
        b [s**-c], c [1] and d of every relaxation term.
    least_amplitudes : tuple of float
        Lower bound of each amplitude, in units of the output's range. A record at one rate without holds does not
        fix them.
    """

    n_lines: int = 32
    n_knots: int = 6
    train_fraction: float = 0.5
    skip: int = 10
    least_spring: float = 0.1
    least_weight: float = 0.005
    ridge: float = 3e-3
    eta: tuple[float, float] = (0.8, 1.05)
    terms: tuple[tuple[float, float, int], ...] = ((0.3, 0.5, 1),)
    least_amplitudes: tuple[float, ...] = (0.03,)

    def __post_init__(self) -> None:
        if len(self.terms) != len(self.least_amplitudes):
            msg = f"need one least amplitude per term: {len(self.least_amplitudes)} != {len(self.terms)}"
            raise ParameterError(msg)
        if not (0.0 < self.train_fraction <= 1.0 and self.n_lines > self.n_knots >= 2):
            msg = (
                f"cannot fit {self.train_fraction:g} of a record with {self.n_knots} knots on {self.n_lines} lines: "
                "take a fraction in 0..1 and more lines than knots"
            )
            raise ParameterError(msg)


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """Result of a fit.

    Attributes
    ----------
    artifact : SensorArtifact
        Normalised sensor.
    offset, scale : float
        Output of the record = offset + scale * normalised output, in the record's unit.
    eta : float
        Part of its weight that an operator loses when it switches down [1].
    train_error, test_error : float
        Root mean square error [% of the record's range]; the second is not a number if everything was fitted.
    """

    artifact: SensorArtifact
    offset: float
    scale: float
    eta: float
    train_error: float
    test_error: float


def identify(strain: Vector, output: Vector, h: float, settings: FitSettings | None = None) -> Identification:
    """Fit a sensor to a record.

    Parameters
    ----------
    strain : ndarray, shape (m,)
        Strain over its full scale [1], in 0..1.
    output : ndarray, shape (m,)
        Resistance or any signal linear in it.
    h : float
        Sampling step [s].
    settings : FitSettings or None
        None for the settings of the artifact that ships with the package.

    Returns
    -------
    Identification
        The sensor, the record's scale and the errors reached.

    Raises
    ------
    DataError
        The record is too short, not finite, out of range or constant, or ``h`` is not positive.
    """
    settings = settings or FitSettings()
    _check(strain, output, h, settings)
    n_train = round(settings.train_fraction * strain.size)
    unit = float(np.ptp(output))
    up, down = switched(strain, settings.n_lines)
    hats, spring = hat_functions(settings.n_lines, settings.n_knots)
    terms = tuple(_unit_term(*term) for term in settings.terms)
    modes = [relaxed(strain, h, term)[:, None] for term in terms]
    ones = np.ones((strain.size, 1))
    shape = np.hstack([hats, spring])
    ups, downs = up @ shape, down @ shape
    n, n_all = hats.shape[1], shape.shape[1]
    low = np.concatenate(
        [
            np.full(n, settings.least_weight),
            np.full(n_all - n, settings.least_spring),
            [0.0, 0.0],
            settings.least_amplitudes,
        ]
    )
    penalty = settings.ridge * np.sqrt(n_train) * np.eye(n, low.size)
    rows = slice(settings.skip, n_train)

    def fit(eta: float) -> tuple[Vector, Vector, float]:
        X = np.hstack([ups - eta * downs, ones, -ones, *modes])
        wanted = np.concatenate([(output / unit - X @ low)[rows], np.zeros(n)])
        excess, misfit = nnls(np.vstack([X[rows], penalty]), wanted, maxiter=20_000)
        return low + excess, X @ (low + excess) - output / unit, float(misfit)

    eta = float(minimize_scalar(lambda value: fit(value)[2], bounds=settings.eta, options={"xatol": 1e-5}).x)
    q, error, _ = fit(eta)
    mu = np.zeros((settings.n_lines, settings.n_lines))
    mu[np.triu_indices(settings.n_lines)] = shape @ q[:n_all]
    scale = float(mu.sum()) / settings.n_lines
    mu /= scale
    amplitudes = q[n_all + 2 :] / scale
    artifact = SensorArtifact(
        mu=tuple(map(tuple, mu.tolist())),
        nu=tuple(map(tuple, (eta * mu).tolist())),
        relaxation=tuple(replace(t, amplitude=float(a)) for t, a in zip(terms, amplitudes, strict=True)),
    )
    return Identification(
        artifact=artifact,
        offset=float(q[n_all] - q[n_all + 1]) * unit,
        scale=scale * unit,
        eta=eta,
        train_error=_percent(error[rows]),
        test_error=_percent(error[n_train:]),
    )


def relaxed(strain: Vector, h: float, term: RelaxationTerm) -> Vector:
    """Return the dynamic output [1], shape (m,), of one term for a record of normalised strain sampled every ``h`` [s]."""
    bank = ModeBank.of((term,))
    z, ends, step = ca.SX.sym("z", bank.size), ca.SX.sym("ends", 2), ca.SX(h)
    first, second = rise(bank, ends[0], step)
    delta = ca.fmax(ends[1] - ends[0], 0.0)
    advance = ca.Function("advance", [z, ends], [decay(bank, z, step) + delta * (first + delta * second)])
    pairs = np.vstack([strain[:-1], strain[1:]])
    modes = advance.mapaccum("record", strain.size - 1)(np.zeros(bank.size), pairs)
    return np.concatenate([[0.0], np.array(ca.sum1(modes)).ravel()])


def read_record(path: Path, strain_column: str, output_column: str) -> tuple[Vector, Vector]:
    """Read two columns of a CSV file with a header line.

    Raises
    ------
    DataError
        The file cannot be read, a column is missing or a value is no number.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = [(float(row[strain_column]), float(row[output_column])) for row in csv.DictReader(file)]
    except (OSError, KeyError, TypeError, ValueError) as error:
        msg = f"cannot read columns {strain_column!r} and {output_column!r} of {path}: {error!r}. Name other columns."
        raise DataError(msg) from error
    table = np.array(rows, dtype=float).reshape(len(rows), 2)
    return table[:, 0], table[:, 1]


def _check(strain: Vector, output: Vector, h: float, settings: FitSettings) -> None:
    problem = None
    if strain.ndim != 1 or strain.shape != output.shape:
        problem = f"strain has shape {strain.shape} and output {output.shape}: need two columns of one length"
    elif settings.train_fraction * strain.size < settings.skip + 50:
        problem = f"{strain.size} samples are too few: at least 50 must be left to fit after skipping {settings.skip}"
    elif not (np.isfinite(strain).all() and np.isfinite(output).all() and np.ptp(output) > 0.0):
        problem = "the record is constant or holds values that are not finite"
    elif strain.min() < 0.0 or strain.max() > 1.0:
        problem = f"strain runs from {strain.min():g} to {strain.max():g}; divide it by its full scale, into 0..1"
    elif not h > 0.0:
        problem = f"the sampling step must be a positive time [s], not {h!r}"
    if problem is not None:
        msg = f"cannot identify a sensor: {problem}."
        raise DataError(msg)


def _unit_term(rate: float, exponent: float, power: int) -> RelaxationTerm:
    decay_rates, weights = exponential_sum(rate, exponent)
    return RelaxationTerm(
        amplitude=1.0,
        power=power,
        rate=rate,
        exponent=exponent,
        decay_rates=tuple(decay_rates.tolist()),
        weights=tuple(weights.tolist()),
    )


def _percent(error: Vector) -> float:
    return 100.0 * float(np.sqrt(np.mean(error**2))) if error.size else float("nan")


app = typer.Typer(add_completion=False)


@app.command()
def _command(
    record: Annotated[Path, typer.Argument(help="CSV file with a header line")],
    out: Annotated[Path, typer.Option(help="artifact to write")],
    origin: Annotated[str, typer.Option(help="where the record comes from, for the provenance")] = "not stated",
    sampling_step: Annotated[float, typer.Option(help="time between samples [s]")] = 0.1,
    strain_column: Annotated[str, typer.Option(help="normalised strain, 0..1")] = "output",
    output_column: Annotated[str, typer.Option(help="resistance or a signal linear in it")] = "input",
    train_fraction: Annotated[float, typer.Option(help="leading part of the record to fit")] = 0.5,
) -> None:
    """Fit a sensor to a record and write it as an artifact."""
    settings = FitSettings(train_fraction=train_fraction)
    try:
        strain, output = read_record(record, strain_column, output_column)
        found = identify(strain, output, sampling_step, settings)
    except GossamerError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from None
    arguments = [record.name if arg == str(record) else arg for arg in sys.argv[1:]]
    provenance = {
        "data": record.name,
        "origin": origin,
        "sha256": hashlib.sha256(record.read_bytes()).hexdigest(),
        "command": "python -m gossamer_models.sensor.identify " + shlex.join(arguments),
        "settings": repr(settings),
        "train_error_percent_of_range": f"{found.train_error:.3f}",
        "test_error_percent_of_range": f"{found.test_error:.3f}",
        "offset": repr(found.offset),
        "scale": repr(found.scale),
        "eta": f"{found.eta:.5f}",
        "assumption_time": f"the record has no clock; one sample every {sampling_step:g} s is assumed",
        "assumption_relaxation": "cycles of one rate do not fix the relaxation: exponents, rates and least amplitudes "
        f"{settings.terms}, {settings.least_amplitudes} are assumed",
        "assumption_weights": "full cycles fix sums of weights only: smooth weights and one eta for all are assumed",
    }
    replace(found.artifact, provenance=provenance).write(out)
    typer.echo(f"{out}: error {found.train_error:.2f} % fitted, {found.test_error:.2f} % predicted")


if __name__ == "__main__":
    app()

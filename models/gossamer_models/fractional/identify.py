r"""Identify a fractional model from records of strain and resistance by separable least squares.

Symbols: ``y`` change of resistance over its scale [1], :math:`\theta` orders, rates and exponents, ``c`` coefficients,
:math:`\Phi(\theta)` columns of unit coefficient. Every model of Chapter 3 of [1]_ is linear in its coefficients and,
because a phase turns a record into its cosine and sine parts, in its phases too::

    y = Phi(theta) c      columns: strain, terms on the record, terms on its quadrature, fading integrals

so :math:`C_k, b_k` become two linear coefficients, :math:`C_k\cos(\pi b_k/2)` and :math:`-C_k\sin(\pi b_k/2)`, and
every pair of these is one :math:`(C_k, b_k)` within the bounds of the thesis. A search over :math:`\theta` remains,
in a box, with ``c`` eliminated at every step (variable projection [2]_, Jacobian of [3]_). The modes do not depend on
the orders and are computed once; what depends on :math:`\theta` is differentiated by CasADi.

References
----------
.. [1] M. R. Sunny, dissertation, Virginia Tech, chapter 3.
.. [2] G. H. Golub, V. Pereyra, SIAM Journal on Numerical Analysis 10(2), 413-432, 1973, doi:10.1137/0710036.
.. [3] L. Kaufman, BIT Numerical Mathematics 15, 49-57, 1975, doi:10.1007/BF01932995.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ..errors import DataError, ParameterError
from .artifact import MODELS, FadingTerm, FractionalArtifact, FractionalTerm, ModelName
from .columns import Columns
from .kernels import ModeGrid
from .model import predict
from .problem import SeparableProblem, random_starts

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
LEAST_SINGULAR = 1e-12  # of a Jacobian with columns of unit length: below, a direction counts as not determined
AT_BOUND = 1e-6  # of the width of the box


@dataclass(frozen=True, kw_only=True, eq=False)
class UniformRecord:
    """One measurement, sampled in equal steps.

    Attributes
    ----------
    strain : ndarray, shape (m,)
        Strain [1] from the first loading on.
    resistance : ndarray, shape (m,)
        Resistance [ohm].
    sampling_step : float
        Time between samples [s].
    rest_resistance : float
        Resistance [ohm] before the first loading; models and errors count from there.
    train : slice
        Samples that are fitted.
    weight : float
        Weight [1] of the squared errors of this record in a fit with others.
    name : str
        For tables and messages.
    """

    strain: Vector
    resistance: Vector
    sampling_step: float
    rest_resistance: float = 0.0
    train: slice = field(default_factory=lambda: slice(None))
    weight: float = 1.0
    name: str = "record"

    @classmethod
    def resampled(
        cls, time: Vector, strain: Vector, resistance: Vector, *, train_until: float = np.inf, name: str = "record"
    ) -> UniformRecord:
        """Bring samples at increasing times to as many in equal steps, by linear interpolation.

        Parameters
        ----------
        time, strain, resistance : ndarray, shape (m,)
            Time [s], strain [1] and resistance [ohm]; the first sample is taken for the sensor at rest.
        train_until : float
            Samples up to this time [s] are fitted.
        name : str
            For tables and messages.
        """
        even = np.linspace(time[0], time[-1], time.size)
        return cls(
            strain=np.interp(even, time, strain),
            resistance=np.interp(even, time, resistance),
            sampling_step=float((time[-1] - time[0]) / max(time.size - 1, 1)),
            rest_resistance=float(resistance[0]),
            train=slice(0, int(np.searchsorted(even, train_until, side="right"))),
            name=name,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FractionalSettings:
    """How to fit.

    Attributes
    ----------
    n_terms, n_fading : int
        Number of fractional terms, and of fading integrals (model-1 only): N and M - N of the thesis, 5 and 3 in
        Table 3.2.
    orders, rates, exponents : tuple of float
        Bounds of :math:`a_k` [1], :math:`p_l` [1/s] and :math:`q_l` [1].
    nonnegative : bool
        True: no coefficient is negative, which makes an integral model passive; False: as in the thesis.
    ridge : float
        Penalty on the size of each term [1], relative to the measured change; terms of nearby orders otherwise cancel
        each other.
    starts, seed : int
        Number of random starts, and what they are drawn from.
    most_evaluations : int
        Of the columns, per start.
    shortest, longest : float
        Range of times [s] of the memory.
    """

    n_terms: int = 5
    n_fading: int = 3
    orders: tuple[float, float] = (0.001, 0.999)
    rates: tuple[float, float] = (1e-4, 10.0)
    exponents: tuple[float, float] = (0.1, 4.0)
    nonnegative: bool = True
    ridge: float = 1e-2
    starts: int = 12
    seed: int = 0
    most_evaluations: int = 60
    shortest: float = 1e-4
    longest: float = 1e5

    def __post_init__(self) -> None:
        for name, (low, high), least, most in (
            ("orders", self.orders, 0.0, 1.0),
            ("rates", self.rates, 0.0, np.inf),
            ("exponents", self.exponents, 0.0, np.inf),
        ):
            if not least < low < high < most:
                msg = f"bounds of {name} are {low:g} to {high:g}; they must increase within {least:g} to {most:g}"
                raise ParameterError(msg)
        if self.n_terms < 1 or self.n_fading < 0 or self.starts < 1 or self.ridge < 0.0:
            msg = "need one or more terms and starts, and neither fading integrals nor a ridge below zero"
            raise ParameterError(msg)


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """How far a model is from a stretch of a record.

    Attributes
    ----------
    e1 : float
        100 sum |R_ex - R| / sum |R_ex| [%] of the change of resistance, the measure of Section 3.3.
    nrmse : float
        Root mean square error [% of the range of the record].
    """

    e1: float
    nrmse: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One fitted number: value, standard error, and whether the data determine it."""

    value: float
    standard_error: float
    determined: bool


@dataclass(frozen=True, kw_only=True)
class FractionalFit:
    """Result of a fit.

    Attributes
    ----------
    artifact : FractionalArtifact
        The model.
    parameters : dict of Parameter
        By the thesis' names: ``C_0``, ``C_1``, ``a_1``, ``b_1``, ..., ``p_1``, ``q_1``; coefficients of the
        normalised model.
    covariance : ndarray, shape (n, n)
        Of the parameters, in this order, for white residuals; those of a model that is not quite right are not white,
        and then it tells only which parameters the data cannot separate.
    train, test : tuple of Misfit
        One per record; not a number where a record has no such stretch.
    warnings : tuple of str
        What the data do not determine.
    costs : tuple of float
        Root mean square residual [% of the scale] that each start came to.
    seconds : float
        Wall time.
    """

    artifact: FractionalArtifact
    parameters: dict[str, Parameter]
    covariance: Matrix
    train: tuple[Misfit, ...]
    test: tuple[Misfit, ...]
    warnings: tuple[str, ...]
    costs: tuple[float, ...]
    seconds: float = field(compare=False)


def identify_fractional(
    records: Sequence[UniformRecord],
    model: ModelName,
    settings: FractionalSettings | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> FractionalFit:
    """Fit one of the three fractional models to one or more records.

    Parameters
    ----------
    records : sequence of UniformRecord
        Measurements of one sensor.
    model : {"model-1", "sub-model-1", "sub-model-2"}
        See ``FractionalArtifact``.
    settings : FractionalSettings or None
        None for five terms and three fading integrals.
    progress : callable
        Told the misfit that each start came to.

    Returns
    -------
    FractionalFit
        The model, its parameters with errors, and the misfits.

    Raises
    ------
    DataError
        A record is not finite, constant, too long for the memory or too short for the parameters.
    ParameterError
        There is no such model.
    """
    began = time.perf_counter()
    settings = settings or FractionalSettings()
    if model not in MODELS:
        msg = f"there is no fractional model {model!r}; it is one of {', '.join(MODELS)}"
        raise ParameterError(msg)
    if not records:
        msg = "there is no record to fit. Give at least one."
        raise DataError(msg)
    for record in records:
        _check(record, settings)
    fit = _Fit(records, model, settings)
    costs, points = [], []
    for k, start in enumerate(random_starts(*fit.box, settings.n_terms, settings.starts, settings.seed)):
        found = least_squares(
            fit.problem.residual,
            start,
            fit.problem.jacobian,
            bounds=fit.box,
            x_scale=fit.box[1] - fit.box[0],
            max_nfev=settings.most_evaluations,
        )
        costs.append(float(100.0 * np.sqrt(2.0 * found.cost / fit.problem.y.size)))
        points.append(found.x)
        progress(f"{model}: start {k + 1} of {settings.starts}, misfit {costs[-1]:.3f} %")
    theta = points[int(np.argmin(costs))]
    artifact = fit.artifact(theta)
    parameters, covariance, warnings = fit.certainty(theta, artifact)
    ends = [record.train.indices(record.strain.size)[1] for record in records]
    return FractionalFit(
        artifact=artifact,
        parameters=parameters,
        covariance=covariance,
        train=tuple(misfit(artifact, record, record.train) for record in records),
        test=tuple(misfit(artifact, record, slice(end, None)) for record, end in zip(records, ends, strict=True)),
        warnings=warnings,
        costs=tuple(costs),
        seconds=time.perf_counter() - began,
    )


def misfit(artifact: FractionalArtifact, record: UniformRecord, stretch: slice = slice(None)) -> Misfit:
    """Compare a model, run through the whole record, with a stretch of it; not a number if that is empty."""
    change = record.resistance - record.rest_resistance
    error = change + artifact.rest_resistance - predict(artifact, record.strain, record.sampling_step)
    size, part = np.abs(change[stretch]).sum(), error[stretch]
    if not size > 0.0:
        return Misfit(e1=float("nan"), nrmse=float("nan"))
    return Misfit(
        e1=float(100.0 * np.abs(part).sum() / size),
        nrmse=float(100.0 * np.sqrt(np.mean(part**2)) / np.ptp(change)),
    )


class _Fit:
    """One model on some records: the problem to solve, and what its solution means."""

    def __init__(self, records: Sequence[UniformRecord], model: ModelName, settings: FractionalSettings) -> None:
        self._model, self._settings, self._rest = model, settings, records[0].rest_resistance
        self.full_scale = max(float(np.abs(record.strain).max()) for record in records)
        changes = [(record.resistance - record.rest_resistance)[record.train] for record in records]
        self.scale = max(float(np.ptp(change)) for change in changes)
        N, L = settings.n_terms, settings.n_fading if model == "model-1" else 0
        grid = ModeGrid(settings.shortest, settings.longest)
        columns = [
            Columns(record.strain / self.full_scale, record.sampling_step, record.train, model, N, L, grid)
            for record in records
        ]
        box = [settings.orders] * N + [settings.rates] * L + [settings.exponents] * L
        self.box = np.array([low for low, _ in box]), np.array([high for _, high in box])
        # With C_k >= 0, b_k in -1..1 leaves the sine parts free, and b_k in -2..0 the cosine parts.
        nonnegative = np.full(columns[0].n_columns, settings.nonnegative)
        if model != "sub-model-1":
            first = 1 if model == "model-1" else 1 + N
            nonnegative[first : first + N] = False
        self.problem = SeparableProblem(
            columns,
            [change / self.scale for change in changes],
            [record.weight for record in records],
            nonnegative,
            settings.ridge,
        )

    def artifact(self, theta: Vector) -> FractionalArtifact:
        """Return the model of a point, with its best coefficients; terms by order, fading integrals by rate."""
        N = self._settings.n_terms
        _, _, c = self.problem.solve(theta)
        A, B = c[1 : 1 + N], np.zeros(N) if self._model == "sub-model-1" else c[1 + N : 1 + 2 * N]
        terms = [_term(self._model, *numbers) for numbers in zip(A, B, theta[:N], strict=True)]
        p, q = np.split(theta[N:], 2)
        fading = [
            FadingTerm(coefficient=float(C), rate=float(rate), exponent=float(exponent))
            for C, rate, exponent in zip(c[c.size - p.size :], p, q, strict=True)
        ]
        return FractionalArtifact(
            model=self._model,
            direct=float(c[0]),
            terms=tuple(sorted(terms, key=lambda term: term.order)),
            fading=tuple(sorted(fading, key=lambda term: term.rate)),
            full_scale_strain=self.full_scale,
            resistance_change=self.scale,
            rest_resistance=self._rest,
            shortest=self._settings.shortest,
            longest=self._settings.longest,
        )

    def certainty(
        self, theta: Vector, artifact: FractionalArtifact
    ) -> tuple[dict[str, Parameter], Matrix, tuple[str, ...]]:
        """Return the parameters with standard errors, their covariance, and what is not determined."""
        N, L = len(artifact.terms), len(artifact.fading)
        theta = np.array(
            [t.order for t in artifact.terms]
            + [t.rate for t in artifact.fading]
            + [t.exponent for t in artifact.fading]
        )
        Phi, slopes, c = self.problem.solve(theta)
        residual = Phi @ c - self.problem.y
        names, values, J = ["C_0"], [artifact.direct], [Phi[:, 0]]
        for k, term in enumerate(artifact.terms):
            angle = 0.5 * np.pi * term.phase
            cosine, sine = Phi[:, 1 + k], Phi[:, 1 + N + k] if self._model != "sub-model-1" else np.zeros(residual.size)
            names += [f"C_{k + 1}", f"a_{k + 1}"]
            values += [term.coefficient, term.order]
            J += [np.cos(angle) * cosine - np.sin(angle) * sine, slopes[k] @ c]
            if self._model != "sub-model-1":
                names.append(f"b_{k + 1}")
                values.append(term.phase)
                J.append(-0.5 * np.pi * term.coefficient * (np.sin(angle) * cosine + np.cos(angle) * sine))
        for k, fading in enumerate(artifact.fading):
            names += [f"C_{N + k + 1}", f"p_{k + 1}", f"q_{k + 1}"]
            values += [fading.coefficient, fading.rate, fading.exponent]
            J += [Phi[:, Phi.shape[1] - L + k], slopes[N + k] @ c, slopes[N + L + k] @ c]
        covariance = _covariance(np.column_stack(J), residual)
        errors = np.sqrt(np.diag(covariance))
        parameters = {
            name: Parameter(value=float(value), standard_error=float(error), determined=bool(error < abs(value)))
            for name, value, error in zip(names, values, errors, strict=True)
        }
        warnings = []
        loose = [name for name, parameter in parameters.items() if not parameter.determined]
        if loose:
            warnings.append(
                f"the data do not determine {', '.join(loose)}: standard errors exceed the values. "
                "The model's output is unaffected on records like these; take fewer terms if the numbers matter."
            )
        at_bound = [
            name
            for name, value, low, high in zip(
                [f"a_{k + 1}" for k in range(N)] + [f"{s}_{k + 1}" for s in "pq" for k in range(L)],
                theta,
                *self.box,
                strict=True,
            )
            if min(value - low, high - value) < AT_BOUND * (high - low)
        ]
        if at_bound:
            warnings.append(f"{', '.join(at_bound)} ended at a bound: the data ask for a value outside the model.")
        return parameters, covariance, tuple(warnings)


def _term(model: ModelName, A: float, B: float, order: float) -> FractionalTerm:
    """Turn a cosine and a sine coefficient into coefficient and phase, the phase within the bounds of the model."""
    if model == "sub-model-1":
        return FractionalTerm(coefficient=float(A), order=float(order))
    leading = B if model == "model-1" else A
    sign = -1.0 if leading < 0.0 else 1.0
    phase = 2.0 / np.pi * np.arctan2(-sign * B, sign * A)
    return FractionalTerm(coefficient=float(sign * np.hypot(A, B)), order=float(order), phase=float(phase))


def _covariance(J: Matrix, residual: Vector) -> Matrix:
    """Return the covariance of a least squares estimate from its Jacobian, for residuals that are white."""
    size = np.linalg.norm(J, axis=0)
    acting = size > 0.0
    covariance = np.diag(np.where(acting, 0.0, np.inf))
    _, s, V = np.linalg.svd(J[:, acting] / size[acting], full_matrices=False)
    half = V.T / np.maximum(s, LEAST_SINGULAR) / size[acting, None]
    spread = residual @ residual / max(residual.size - size.size, 1)
    covariance[np.ix_(acting, acting)] = spread * half @ half.T
    return np.asarray(covariance)


def _check(record: UniformRecord, settings: FractionalSettings) -> None:
    train = record.strain[record.train]
    n_parameters = 1 + 3 * (settings.n_terms + settings.n_fading)
    problem = None
    if record.strain.ndim != 1 or record.strain.shape != record.resistance.shape:
        problem = (
            f"strain has shape {record.strain.shape} and resistance {record.resistance.shape}: need two equal columns"
        )
    elif not (np.isfinite(record.strain).all() and np.isfinite(record.resistance).all()):
        row = int(np.argmin(np.isfinite(record.strain) & np.isfinite(record.resistance)))
        problem = f"row {row} holds a value that is not finite"
    elif train.size < 2 * n_parameters:
        problem = f"{train.size} samples are too few for up to {n_parameters} parameters: give twice as many"
    elif not (np.ptp(train) > 0.0 and np.ptp(record.resistance[record.train]) > 0.0):
        problem = "strain or resistance is constant where it is to be fitted"
    elif not record.weight > 0.0:
        problem = f"its weight is {record.weight:g}; leave a record out instead"
    if problem is not None:
        msg = f"cannot fit {record.name!r}: {problem}."
        raise DataError(msg)

r"""Fit a fractional model to records of strain and resistance by separable least squares.

Symbols: ``y`` change of resistance over its scale [1], :math:`\theta` orders, rates and exponents, ``c`` coefficients,
:math:`\Phi(\theta)` columns of unit coefficient; ``A``, ``B`` coefficients of a term on the strain and on its quadrature.
Every model of Chapter 3 of the thesis is linear in its coefficients and, because a phase turns a record into its cosine and
sine parts, in its phases too::

    y = Phi(theta) c      columns: strain, terms on the record, terms on its quadrature, fading integrals

so :math:`C_k, b_k` become two linear coefficients, :math:`A = C_k\cos(\pi b_k/2)` and :math:`B = -C_k\sin(\pi b_k/2)`, and
every pair of these is one :math:`(C_k, b_k)` within the bounds of the thesis. The sum of squares is that of Eq. (3.14). A
search over :math:`\theta` remains, in a box, with ``c`` eliminated at every step (``fitting/separable.py``). The modes do
not depend on the orders and are computed once; what depends on :math:`\theta` is differentiated by CasADi.

How well the parameters are known follows from ``J``, the Jacobian of the residuals by :math:`C_k, a_k, b_k, p_l, q_l`.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import inf

import numpy as np
from gossamer_files.options import option
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from ..arrays import Matrix, Rows, Vector
from ..fitting.errors import Parameter, SensorFit, alike, covariance, rest_doubt
from ..fitting.records import Record, in_equal_steps
from .artifact import FractionalArtifact
from .model import predict
from .problem import FractionalProblem, FractionalSettings, prepare

RESTED = 0.01  # of the range of resistance that counts as another resistance at rest, which was fitted
AT_BOUND = 1e-6  # of the width of the box
UNEVEN = 0.01  # of the median step: larger differences of steps are reported


def parameters(problem: FractionalProblem, theta: Vector) -> tuple[tuple[Parameter, ...], Matrix]:
    """Return the parameters by the thesis' names and their covariance, shape (n, n), for white residuals.

    ``C_0``, ``C_1``, ``a_1``, ``b_1``, ..., ``p_1``, ``q_1`` belong to the normalised model; ``R_0`` [ohm] is present
    if it was fitted. A term with a coefficient of zero is not determined and has no effect on the others.
    """
    artifact, model = problem.artifact(theta), problem.settings.model
    N, L = len(artifact.terms), len(artifact.fading)
    Phi, c = problem.separable.solve(theta)
    by_theta = [slope @ c[columns] for columns, slope in problem.separable.derivatives(theta)]
    residual = Phi @ c - problem.separable.y
    rows = [("C_0", artifact.direct, Phi[:, 0])]
    for k, term in enumerate(artifact.terms):
        angle = 0.5 * np.pi * term.phase
        cosine, sine = Phi[:, 1 + k], Phi[:, 1 + N + k] if model != "sub-model-1" else np.zeros(residual.size)
        rows += [
            (f"C_{k + 1}", term.coefficient, np.cos(angle) * cosine - np.sin(angle) * sine),
            (f"a_{k + 1}", term.order, by_theta[k]),
        ]
        if model != "sub-model-1":
            turned = np.sin(angle) * cosine + np.cos(angle) * sine
            rows.append((f"b_{k + 1}", term.phase, -0.5 * np.pi * term.coefficient * turned))
    for k, fading in enumerate(artifact.fading):
        rows += [
            (f"C_{N + k + 1}", fading.coefficient, Phi[:, problem.settings.first_fading + k]),
            (f"p_{k + 1}", fading.rate, by_theta[N + k]),
            (f"q_{k + 1}", fading.exponent, by_theta[N + L + k]),
        ]
    if problem.rest_fitted:
        rows.append(("R_0", artifact.rest_resistance, Phi[:, -1] / artifact.resistance_change))
    J = np.column_stack([np.zeros_like(slope) if name[0] == "C" and value == 0.0 else slope for name, value, slope in rows])
    variance = float(residual @ residual) / max(residual.size - len(rows), 1)
    covariances, _ = covariance(J, np.empty((0, len(rows))), variance)
    deviations = np.sqrt(np.diag(covariances))
    return tuple(
        Parameter(name=name, value=float(value), deviation=float(deviation), determined=bool(deviation < abs(value)))
        for (name, value, _), deviation in zip(rows, deviations, strict=True)
    ), covariances


@dataclass(frozen=True, kw_only=True)
class FractionalFit(SensorFit):
    """Result of a fit.

    Attributes
    ----------
    artifact : FractionalArtifact
        The model.
    settings : FractionalSettings
        Settings of the fit; the range of times of the memory covers the records.
    parameters : tuple of Parameter
        By the thesis' names, see ``parameters``.
    covariance : ndarray, shape (n, n)
        Covariances of the parameters, in this order.
    costs : tuple of float
        Root mean square residual [% of the scale] after each start.
    seconds : float
        Wall time.
    """

    artifact: FractionalArtifact
    settings: FractionalSettings
    parameters: tuple[Parameter, ...]
    covariance: Matrix
    costs: tuple[float, ...]
    seconds: float = field(compare=False)


def fit_fractional(
    records: tuple[Record, ...],
    train: tuple[Rows, ...],
    settings: FractionalSettings,
    *,
    full_scale: float | None = None,
    rest_resistance: float | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> FractionalFit:
    """Fit one of the three fractional models to one or several records of one sensor.

    Parameters
    ----------
    records : tuple of Record
        Resampled in equal steps if they have none.
    train : tuple of ndarray of bool
        Samples of each record to fit.
    settings : FractionalSettings
        The model and how to fit it; the range of times of its memory is widened to what the records need.
    full_scale : float or None
        Strain [1] at the end of the range; None for the largest in the records.
    rest_resistance : float or None
        Resistance [ohm] before the first loading, where it is known; None to fit it.
    progress : callable
        Called with a sentence after each start.

    Returns
    -------
    FractionalFit
        The model, its predictions, and the result of the search.

    Raises
    ------
    DataError
        The records cannot be fitted: too short, constant, or beyond full scale.
    """
    began = time.perf_counter()
    problem = prepare(records, train, settings, full_scale, rest_resistance)
    points, costs = _search(problem, progress)
    theta = _sorted(points[int(np.argmin(costs))], settings)
    artifact = problem.artifact(theta)
    known, covariance = parameters(problem, theta)
    return FractionalFit(
        artifact=artifact,
        rest_resistance=artifact.rest_resistance,
        settings=problem.settings,
        records=records,
        predicted=tuple(predict_record(artifact, record) for record in records),
        train=train,
        parameters=known,
        covariance=covariance,
        costs=costs,
        seconds=time.perf_counter() - began,
    )


def predict_record(artifact: FractionalArtifact, record: Record) -> Vector:
    """Return the resistance [ohm] that a model gives at the samples of a record, in equal steps or not, shape (m,)."""
    even, _ = in_equal_steps(record, np.ones(record.time.size, dtype=bool))
    return np.interp(record.time, even.time, predict(artifact, even.strain, float(even.time[1] - even.time[0])))


def _search(problem: FractionalProblem, progress: Callable[[str], None]) -> tuple[list[Vector], tuple[float, ...]]:
    """Search from every start; return where each ends and its root mean square residual [% of the scale]."""
    settings, separable = problem.settings, problem.separable
    low, high = settings.box
    points, costs = [], []
    for k, start in enumerate(random_starts(settings)):
        with threadpool_limits(1):  # small matrices: waking other threads for them costs many times their work
            solution = least_squares(
                separable.residual,
                start,
                separable.jacobian,
                bounds=(low, high),
                x_scale=high - low,
                max_nfev=settings.most_evaluations,
            )
        points.append(solution.x)
        costs.append(float(100.0 * np.sqrt(2.0 * solution.cost / separable.y.size)))
        progress(f"{settings.model}: start {k + 1} of {settings.starts}, misfit {costs[-1]:.3f} %")
    return points, tuple(costs)


def random_starts(settings: FractionalSettings) -> Iterator[Vector]:
    """Draw starting points: orders spread over their range, the others uniform in the logarithm."""
    low, high = settings.box
    rng, n = np.random.default_rng(settings.seed), settings.terms
    for _ in range(settings.starts):
        share = rng.uniform(0.02, 0.98, low.size)
        theta = low * (high / low) ** share
        theta[:n] = low[:n] + (high[:n] - low[:n]) * (np.arange(n) + share[:n]) / n
        yield theta


def _sorted(theta: Vector, settings: FractionalSettings) -> Vector:
    """Return a point with its terms in the order of their orders, its fading integrals in that of their rates."""
    a, p, q = np.split(theta, [settings.terms, settings.terms + settings.n_fading])
    return np.concatenate([np.sort(a), np.sort(p), q[np.argsort(p)]])


def doubts(fit: FractionalFit) -> tuple[str, ...]:
    """Return the assumptions and what the data do not determine, one sentence each."""
    sentences = [_uneven(record) for record in fit.records]
    if any(each.name == "R_0" for each in fit.parameters):
        advice = f"If the sensor was at rest, give the resistance at rest ({option('rest_resistance')})."
        rest, full_scale = fit.rest_resistance, fit.artifact.full_scale_strain
        sentences += [rest_doubt(record, rest, full_scale, RESTED, advice) for record in fit.records]
    loose = [each.name for each in fit.parameters if not each.determined]
    if loose:
        sentences.append(
            f"The data do not determine {', '.join(loose)}: standard errors exceed the values. "
            "The model's output is unaffected on records like these; take fewer terms if the numbers matter."
        )
    bounds = {"a": fit.settings.orders, "p": fit.settings.rates, "q": fit.settings.exponents}
    at_bound = [each.name for each in fit.parameters if _at_bound(each.value, *bounds.get(each.name[0], (-inf, inf)))]
    if at_bound:
        sentences.append(f"{', '.join(at_bound)} ended at a bound: the data suggest a value beyond it.")
    names = tuple(each.name for each in fit.parameters)
    sentences.append(alike(names, fit.covariance, "Take fewer terms if the numbers matter."))
    if not fit.artifact.can_step:
        sentences.append(
            f"The fractional {fit.settings.model} needs the whole record and works offline only: no FMU can be built from "
            "it. For an FMU, identify fractional-sub-model-1."
        )
    return tuple(filter(None, sentences))


def _at_bound(value: float, low: float, high: float) -> bool:
    return min(value - low, high - value) < AT_BOUND * (high - low) < inf


def _uneven(record: Record) -> str:
    """Return a sentence on the resampling in equal steps; empty if the record has equal steps."""
    steps = np.diff(record.time)
    if np.ptp(steps) <= UNEVEN * float(np.median(steps)):
        return ""
    even, _ = in_equal_steps(record, np.ones(record.time.size, dtype=bool))
    back = np.interp(record.time, even.time, even.strain)
    moved = 100.0 * float(np.abs(back - record.strain).max() / np.ptp(record.strain))
    return (
        f"{record.name}: samples {steps.min():.3g} to {steps.max():.3g} s apart were brought to steps of "
        f"{even.time[1] - even.time[0]:.3g} s, which moves the strain by up to {moved:.2g} % of its range."
    )

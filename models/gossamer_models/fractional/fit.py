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
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from ..arrays import Matrix, Rows, Vector
from ..fitting.errors import Errors, stretch_errors
from ..fitting.records import Record, in_equal_steps
from ..fitting.uncertainty import Parameter
from .artifact import FractionalArtifact
from .model import predict
from .parameters import parameters
from .problem import FractionalProblem, prepare
from .settings import FractionalSettings


@dataclass(frozen=True, kw_only=True)
class FractionalFit:
    """Result of a fit.

    Attributes
    ----------
    artifact : FractionalArtifact
        The model.
    settings : FractionalSettings
        Settings of the fit; the range of times of the memory covers the records.
    records : tuple of Record
        Fitted records.
    predicted : tuple of ndarray
        Resistance [ohm] at the samples of every record.
    train : tuple of ndarray of bool
        Samples of every record that were fitted.
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
    records: tuple[Record, ...]
    predicted: tuple[Vector, ...]
    train: tuple[Rows, ...]
    parameters: tuple[Parameter, ...]
    covariance: Matrix
    costs: tuple[float, ...]
    seconds: float = field(compare=False)

    @property
    def rest_resistance(self) -> float:
        """Resistance [ohm] of the unstrained sensor at rest, given or fitted."""
        return self.artifact.rest_resistance

    @property
    def errors(self) -> tuple[Errors, ...]:
        """Errors on the training and the test stretch of every record."""
        return stretch_errors(self.records, self.predicted, self.train, self.rest_resistance)


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

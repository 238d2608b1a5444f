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
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from ..errors import DataError, ParameterError
from .artifact import MODELS, FractionalArtifact, ModelName
from .parameters import ModelFit, Parameter
from .problem import random_starts
from .records import Misfit, UniformRecord, misfit
from .settings import FractionalSettings

Matrix = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class FractionalFit:
    """Result of a fit.

    Attributes
    ----------
    artifact : FractionalArtifact
        The model.
    parameters : dict of Parameter
        By the thesis' names: ``C_0``, ``C_1``, ``a_1``, ``b_1``, ..., ``p_1``, ``q_1``; coefficients of the
        normalised model. ``R_0`` [ohm] where it was fitted.
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
    *,
    full_scale: float | None = None,
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
    full_scale : float or None
        Strain [1] at the end of the range; None for the largest in the records.

    Returns
    -------
    FractionalFit
        The model, its parameters with errors, and the misfits.

    Raises
    ------
    DataError
        A record is not finite, constant, too long for the memory or too short for the parameters; or the resistance at
        rest is known for some records and not for others.
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
    if len({record.rest_resistance is None for record in records}) > 1:
        msg = (
            "the resistance at rest is given for some records and to be fitted for others. Give it for all or for none."
        )
        raise DataError(msg)
    for record in records:
        _check(record, settings if model == "model-1" else replace(settings, n_fading=0))
    fit = ModelFit(records, model, settings, full_scale)
    costs, points = [], []
    for k, start in enumerate(random_starts(*fit.box, settings.n_terms, settings.starts, settings.seed)):
        with threadpool_limits(1):  # small matrices: waking other threads for them costs many times their work
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

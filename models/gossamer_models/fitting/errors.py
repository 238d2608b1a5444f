"""How good a fit is: errors against the measurement, how well data determine parameters, what must be said of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Matrix, Rows, Vector
from .records import Record

ALIKE = 0.98  # correlation from which the data do not separate two parameters
LEAST_SINGULAR = 1e-12  # of a Jacobian with columns of unit length: below, the data do not determine a direction
UNSTRAINED = 0.01  # of full scale


def e1(measured: Vector, predicted: Vector, *, rest: float) -> float:
    r"""Return the thesis' error, :math:`100 \sum|R - R'| / \sum|R - R_0|` [%].

    Parameters
    ----------
    measured, predicted : ndarray, shape (m,)
        Outputs :math:`R` and :math:`R'` of one stretch.
    rest : float
        Output :math:`R_0` of the unstrained sensor at rest; zero where outputs are changes from there.

    Returns
    -------
    float
        Not a number if the stretch is empty or never leaves :math:`R_0`.

    Notes
    -----
    Section 3.3 of [1]_, without the root that is printed above the fraction line. The thesis measures changes of
    resistance: relative to the resistance itself, a large constant would make every model look good.

    References
    ----------
    .. [1] M. R. Sunny, Towards Structural Health Monitoring of Gossamer Structures Using Conductive Polymer Nanocomposite
       Sensors, dissertation, Virginia Tech, 2010, Chapter 3.
    """
    size = float(np.abs(measured - rest).sum())
    return 100.0 * float(np.abs(predicted - measured).sum()) / size if size > 0.0 else float("nan")


def nrmse(measured: Vector, predicted: Vector, size: float | None = None) -> float:
    """Return the root mean square error [% of ``size``, or of the range of the measurement]; not a number if empty."""
    if not measured.size:
        return float("nan")
    size = float(np.ptp(measured)) if size is None else size
    return 100.0 * float(np.sqrt(np.mean((predicted - measured) ** 2))) / size


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Errors of a model on one stretch of a record.

    Attributes
    ----------
    record, stretch : str
        Which record, and which part of it.
    samples : int
        Number of samples.
    e1 : float
        Error of the change of resistance from rest [%], see ``e1``.
    nrmse : float
        Root mean square error over the range of the record [%].
    strain_nrmse : float or None
        The same of the strain that the compensator recovers; None for a model without one.
    """

    record: str
    stretch: str
    samples: int
    e1: float
    nrmse: float
    strain_nrmse: float | None = None


def stretch_errors(
    records: Sequence[Record],
    predicted: Sequence[Vector],
    train: Sequence[Rows],
    rest_resistance: float,
    recovered: Sequence[Vector] | None = None,
) -> tuple[Errors, ...]:
    """Return the errors of a prediction on the fitted samples of every record and on its other ones, where there are any.

    ``recovered`` is the strain that a compensator gives, where there is one.
    """
    return tuple(
        Errors(
            record=record.name,
            stretch=stretch,
            samples=int(rows.sum()),
            e1=e1(record.resistance[rows], output[rows], rest=rest_resistance),
            nrmse=nrmse(record.resistance[rows], output[rows], float(np.ptp(record.resistance))),
            strain_nrmse=None
            if recovered is None
            else nrmse(record.strain[rows], recovered[k][rows], float(np.ptp(record.strain))),
        )
        for k, (record, output, fitted) in enumerate(zip(records, predicted, train, strict=True))
        for stretch, rows in (("train", fitted), ("test", ~fitted))
        if rows.any()
    )


@dataclass(frozen=True, kw_only=True)
class SensorFit:
    """What every fit of a sensor gives.

    Attributes
    ----------
    records : tuple of Record
        Fitted records.
    train : tuple of ndarray of bool
        Samples of every record that were fitted.
    predicted : tuple of ndarray
        Resistance [ohm] at the samples of every record.
    rest_resistance : float
        Resistance [ohm] of the unstrained sensor at rest, given or fitted.
    """

    records: tuple[Record, ...]
    train: tuple[Rows, ...]
    predicted: tuple[Vector, ...]
    rest_resistance: float

    @property
    def errors(self) -> tuple[Errors, ...]:
        """Errors on the training and the test stretch of every record."""
        return stretch_errors(self.records, self.predicted, self.train, self.rest_resistance)


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One fitted number.

    Attributes
    ----------
    name : str
        For instance ``b_mu[2]`` or ``C_1``.
    value, deviation : float
        Estimate and its standard deviation.
    determined : bool
        Whether the data determine it: rather than regularisation or a bound, or with a deviation below the value, as the fit
        states.
    """

    name: str
    value: float
    deviation: float
    determined: bool


def covariance(data: Matrix, preferred: Matrix, variance: float) -> tuple[Matrix, Matrix]:
    r"""Return how well the parameters of a least squares problem are determined.

    Parameters
    ----------
    data, preferred : ndarray, shapes (m, n) and (k, n)
        Jacobians J of the residuals and P of what is preferred to be small.
    variance : float
        :math:`\sigma^2` of the residuals.

    Returns
    -------
    covariance : ndarray, shape (n, n)
        :math:`C = \sigma^2 (J^T J + P^T P)^{-1}`; infinite on the diagonal for a parameter that nothing depends on.
    resolution : ndarray, shape (n, n)
        :math:`C J^T J / \sigma^2`: the identity if the data alone determine the parameters, zero if the regularisation
        does.

    Notes
    -----
    Linearised, with white residuals of one variance. Residuals of a model that is not exact are correlated, so deviations
    are too small; they still show which parameters the data do not separate.
    """
    J = np.vstack([data, preferred])
    size = np.linalg.norm(J, axis=0)
    acting = size > 0.0
    U, singular, V = np.linalg.svd(J[:, acting] / size[acting], full_matrices=False)
    half = V.T / np.maximum(singular, LEAST_SINGULAR) / size[acting, None]
    U = U[: len(data)]  # the rows of the data; squares of small singular values would lose all digits
    C, resolution = np.diag(np.where(acting, 0.0, np.inf)), np.zeros((size.size, size.size))
    C[np.ix_(acting, acting)] = variance * half @ half.T
    resolution[np.ix_(acting, acting)] = half @ (U.T @ U * singular) @ (V * size[acting])
    return C, resolution


def alike(names: tuple[str, ...], covariance: Matrix, advice: str) -> str:
    """Return a sentence on two parameters that the data do not separate, with advice; an empty text if there are none."""
    deviations = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    with np.errstate(invalid="ignore"):  # no data at all: infinite deviations
        correlation = np.nan_to_num(np.triu(np.abs(covariance / np.outer(deviations, deviations)), 1))
    i, k = np.unravel_index(int(np.argmax(correlation)), correlation.shape)
    if not correlation[i, k] > ALIKE:
        return ""
    return f"The data do not separate {names[i]} from {names[k]}: their correlation is {correlation[i, k]:.3f}. {advice}"


def rest_doubt(record: Record, rest_resistance: float, full_scale: float, reach: float, advice: str) -> str:
    """Return a sentence if a record begins unstrained, but not with the resistance at rest; empty otherwise.

    ``reach`` is how far apart the two may be, over the range of the record [1].
    """
    first = float(record.resistance[0])
    off = abs(first - rest_resistance) > reach * float(np.ptp(record.resistance))
    if record.strain[0] > UNSTRAINED * full_scale or not off:
        return ""
    return (
        f"{record.name} begins unstrained with a resistance of {first:.6g}, but the resistance at rest is "
        f"{rest_resistance:.6g}. {advice}"
    )

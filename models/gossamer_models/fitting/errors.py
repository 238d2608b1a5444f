"""Errors of a model against a measurement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Rows, Vector
from .records import Record


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
    records: tuple[Record, ...], predicted: tuple[Vector, ...], train: tuple[Rows, ...], rest_resistance: float
) -> tuple[Errors, ...]:
    """Return the errors of a prediction on the fitted samples of every record and on its other ones, where there are any."""
    return tuple(
        Errors(
            record=record.name,
            stretch=stretch,
            samples=int(rows.sum()),
            e1=e1(record.resistance[rows], output[rows], rest=rest_resistance),
            nrmse=nrmse(record.resistance[rows], output[rows], float(np.ptp(record.resistance))),
        )
        for record, output, fitted in zip(records, predicted, train, strict=True)
        for stretch, rows in (("train", fitted), ("test", ~fitted))
        if rows.any()
    )

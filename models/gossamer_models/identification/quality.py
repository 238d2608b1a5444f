"""How good a fit is: errors on stretches of records, and how well the data determine each parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Errors of one stretch.

    Attributes
    ----------
    record, stretch : str
        Where.
    samples : int
        How many samples.
    e1 : float
        The thesis' error, ``100 sum|y_m - y| / sum|y_m|`` [%].
    nrmse : float
        Root mean square error over the range of the record [%].
    """

    record: str
    stretch: str
    samples: int
    e1: float
    nrmse: float


def errors(record: str, stretch: str, measured: Vector, predicted: Vector, size: float) -> Errors:
    """Compare a prediction with a measurement; ``size`` is the range of the whole record."""
    off = predicted - measured
    total = float(np.abs(measured).sum())
    return Errors(
        record=record,
        stretch=stretch,
        samples=off.size,
        e1=100.0 * float(np.abs(off).sum()) / total if total else float("nan"),
        nrmse=100.0 * float(np.sqrt(np.mean(off**2))) / size if off.size else float("nan"),
    )

"""How far a model is from a measurement: the two measures that every table of this project uses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


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
    Section 3.3 of [1]_, which prints a root above the line; read without. The thesis measures changes of resistance:
    relative to the resistance itself, a large constant would make every model look good.

    References
    ----------
    .. [1] M. R. Sunny, dissertation, Virginia Tech, chapter 3.
    """
    size = float(np.abs(measured - rest).sum())
    return 100.0 * float(np.abs(predicted - measured).sum()) / size if size > 0.0 else float("nan")


def nrmse(measured: Vector, predicted: Vector, size: float | None = None) -> float:
    """Return the root mean square error [% of ``size``, or of the range of what was measured]; not a number if empty."""
    if not measured.size:
        return float("nan")
    size = float(np.ptp(measured)) if size is None else size
    return 100.0 * float(np.sqrt(np.mean((predicted - measured) ** 2))) / size

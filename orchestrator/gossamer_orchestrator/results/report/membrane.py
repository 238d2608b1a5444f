"""The square membrane as triangles, its zones and its sensors, at the instants of the slider.

Symbols: ``w`` deflection [m] of the nodes, positive as the membrane states it; ``x``, ``y`` on the stretched membrane.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import ResultsError
from ..square import square_history
from ..surface import face_strains

SENSORS = (
    (1, 1),
    (2, 1),
    (1, 2),
    (2, 2),
)  # places of the four sensors in thirds of the side, as the membrane numbers them


def membrane_mesh(data: xr.Dataset, membrane: str, rows: NDArray[np.intp], side: tuple[float, str]) -> dict[str, Any]:
    """Return the nodes of the membrane, their deflections and the strain between them.

    Parameters
    ----------
    data : xarray.Dataset
        Results with the deflections ``w`` of the nodes within the edge [m], the first index along x. The edge is fixed.
    membrane : str
        Name of the membrane.
    rows : numpy.ndarray, shape (frames,)
        Rows that are shown.
    side : tuple of float and str
        Side of the stretched square, and its unit.

    Returns
    -------
    dict
        ``nx``, ``ny`` nodes along x and y, ``side`` and ``unit``, ``w`` of shape (frames, nx * ny) with y the fastest,
        ``strain``, the largest of each cell, of shape (frames, (nx - 1) * (ny - 1)), None if the parameters are not
        known, and ``sensors``, their places in parts of the side.
    """
    w = np.pad(data[f"{membrane}.w"].isel(time=rows).to_numpy(), ((0, 0), (1, 1), (1, 1)))
    strain = None
    with suppress(ResultsError):
        history = square_history(data, membrane, rows)
        pairs = zip(history.places, history.eigenstrain, strict=True)
        strain = np.stack([face_strains(history.surface, *pair).largest for pair in pairs])
    return {
        "nx": w.shape[1],
        "ny": w.shape[2],
        "side": side[0],
        "unit": side[1],
        "w": w.reshape(len(rows), -1),
        "strain": strain,
        "sensors": [[i / 3.0, j / 3.0] for i, j in SENSORS],
    }

"""The square membrane as triangles, its zones and its sensors, at the instants of the slider.

Symbols: ``w`` deflection [m] of the nodes, positive as the membrane states it; ``x``, ``y`` on the stretched membrane.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

SENSORS = (
    (1, 1),
    (2, 1),
    (1, 2),
    (2, 2),
)  # places of the four sensors in thirds of the side, as the membrane numbers them


def membrane_mesh(data: xr.Dataset, membrane: str, rows: NDArray[np.intp], side: tuple[float, str]) -> dict[str, Any]:
    """Return the nodes of the membrane, and their deflections.

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
        and ``sensors``, their places in parts of the side.
    """
    w = np.pad(data[f"{membrane}.w"].isel(time=rows).to_numpy(), ((0, 0), (1, 1), (1, 1)))
    return {
        "nx": w.shape[1],
        "ny": w.shape[2],
        "side": side[0],
        "unit": side[1],
        "w": w.reshape(len(rows), -1),
        "sensors": [[i / 3.0, j / 3.0] for i, j in SENSORS],
    }

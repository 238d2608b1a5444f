"""The square membrane as a surface of faces, from the deflections ``membrane.w`` that a run records.

Symbols: ``L`` side without strain [m], ``d`` displacement of each edge [m], ``w`` deflection [m]. Motion within the
plane is not recorded: nodes move with the even stretch of the edges, and along z.
"""

from __future__ import annotations

import json
import math

import numpy as np
import xarray as xr

from ..errors import ResultsError
from ..fmi.shape import Surface
from .roles import need
from .shapes import ShapeHistory

ZONES = 4  # along a side
_THIRDS = ((1, 1), (2, 1), (1, 2), (2, 2))  # places of the sensors, in the order of the strains


def square_parameters(data: xr.Dataset, membrane: str) -> dict[str, float]:
    """Return the parameters of a square membrane that are recorded, or else stated by its FMU."""
    known = dict(json.loads(data.attrs.get("fmus", "{}")).get(membrane, {}).get("parameters", {}))
    for name in ("side_length", "edge_displacement", "poisson_ratio"):
        if f"{membrane}.{name}" in data.data_vars:
            known[name] = float(data[f"{membrane}.{name}"][0])
    return known


def square_history(data: xr.Dataset, membrane: str, rows: np.ndarray) -> ShapeHistory:
    """Return the shapes of a square membrane at some rows of its results.

    Raises
    ------
    ResultsError
        Its deflections or parameters are not in the results.
    """
    (heights,) = need(data, f"{membrane}.w")
    known = square_parameters(data, membrane)
    L, d, nu = (known.get(name, math.nan) for name in ("side_length", "edge_displacement", "poisson_ratio"))
    if math.isnan(L + d + nu):
        msg = (
            f"the results do not state side_length, edge_displacement and poisson_ratio of {membrane}; results.nc does."
        )
        raise ResultsError(msg)
    w = np.pad(heights.isel(time=rows).to_numpy(), ((0, 0), (1, 1), (1, 1)))  # the edge stays
    n = w.shape[1] - 1
    x, y = (part.ravel() / n for part in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    i, j = (part.ravel() for part in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    first = i * (n + 1) + j  # the node at i along x, j along y
    flat = np.zeros_like(x)
    surface = Surface(
        nodes=np.column_stack([d + L * x, d + L * y, flat]),
        faces=np.column_stack([first, first + n + 1, first + n + 2, first + 1]),
        element=np.arange(n * n),
        region=np.zeros(n * n, dtype=int),
        zone=ZONES * (ZONES * j // n) + ZONES * i // n,
        poisson_ratio=np.array([nu]),
        direction=np.array([[1.0, 0.0, 0.0]]),
        sensor_points=np.array([[d + L * a / 3.0, d + L * b / 3.0, 0.0] for a, b in _THIRDS]),
        sensor_directions=np.tile([0.0, 1.0, 0.0], (4, 1)),
    )
    stretched = (L + 2.0 * d) * np.column_stack([x, y, flat])
    places = np.tile(stretched, (len(rows), 1, 1))
    places[..., 2] = w.reshape(len(rows), -1)
    return ShapeHistory(surface, data["time"].to_numpy()[rows], places, np.zeros((len(rows), 1, 3)))

"""Results as an xarray Dataset; ``columns`` says how columns become variables."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..scenario.plan import Plan
from .columns import Column, attributes, group, plan_columns


def make_dataset(
    plan: Plan,
    time: NDArray[np.float64],
    table: NDArray[np.float64],
    **more: Any,  # noqa: ANN401
) -> xr.Dataset:
    """Arrange what was recorded, with units, descriptions and provenance.

    Parameters
    ----------
    plan : Plan
        What was run.
    time : numpy.ndarray, shape (n,)
        Recorded points [s].
    table : numpy.ndarray, shape (n, len(plan.columns))
        What was recorded there.
    **more
        More attributes of the dataset, for instance how the run ended.
    """
    data = arrange(time, table, plan_columns(plan))
    data.attrs = attributes(plan) | more
    return data


def arrange(time: NDArray[np.float64], table: NDArray[np.float64], columns: Iterable[Column]) -> xr.Dataset:
    """Group the columns of a table into variables."""
    grouped, labels = group(columns)
    coordinates: dict[str, Any] = {"time": ("time", time, {"units": "s", "long_name": "time"})}
    coordinates |= {dim: (dim, np.array(values, dtype=np.int32)) for dim, values in labels.items()}
    variables: dict[str, Any] = {}
    for each in grouped:
        array = np.full((len(time), each.size), np.nan)
        array[:, each.cells] = table[:, each.columns]
        described = {"units": each.unit, "long_name": each.description}
        variables[each.name] = (("time", *each.dims), array.reshape(-1, *each.shape), described)
    return xr.Dataset(variables, coords=coordinates)

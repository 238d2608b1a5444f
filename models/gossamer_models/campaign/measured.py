"""What sensors would have read: gain and noise, which a campaign's store does not hold but its seed determines."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Matrix
from ..errors import DataError
from .cases import SENSORS, noise_generator
from .description import NOISE, SENSOR_GAIN
from .ranges import Distribution

if TYPE_CHECKING:
    import xarray as xr

_KINDS = {"strain": 0, "resistance": 1}


def unit_noise(law: Distribution | None, kind: str, key: tuple[int, int], numbers: Sequence[int], steps: int) -> Matrix:
    """Draw the noise of some cases.

    Parameters
    ----------
    law : Distribution or None
        None for no noise.
    kind : {"strain", "resistance"}
        Signal.
    key : tuple of int
        Seed of the campaign, and number of the draw: 0 is the noise of the campaign, others are fresh.
    numbers : sequence of int, length n
        Cases.
    steps : int
        Samples.

    Returns
    -------
    ndarray, shape (n, 4, steps)
        Noise [1]: of strain, or of resistance in units of the full-scale change. A function of kind, key and number.
    """
    seed, draw = key
    noise = np.zeros((len(numbers), SENSORS, steps))
    if law is None:
        return noise
    for row, number in zip(noise, numbers, strict=True):
        random = noise_generator(seed, number, draw, _KINDS[kind])
        if law.uniform is not None:
            low, high = law.uniform
            row[:] = low + (high - low) * random.random(row.shape)
        else:
            row[:] = (law.normal or 0.0) * random.standard_normal(row.shape)
    return noise


def measured_strain(data: xr.Dataset, draw: int = 0) -> xr.DataArray:
    """Return strain as sensors without hysteresis would read it: gain times strain plus noise.

    Parameters
    ----------
    data : xarray.Dataset
        From ``read_campaign``, or some of its cases.
    draw : int
        0 is the noise of the campaign; 1, 2, ... are fresh, for training.

    Returns
    -------
    xarray.DataArray, shape (case, sensor, time)
        Strain [1].
    """
    read: xr.DataArray = data[SENSOR_GAIN] * data["strain"] + _noise(data, "strain", draw)
    return read.astype(np.float32).rename("measured_strain").transpose(*data["strain"].dims)


def measured_resistance(data: xr.Dataset, draw: int = 0) -> xr.DataArray:
    """Return the resistance with noise; that of draw 0 is what the compensators got.

    Parameters
    ----------
    data : xarray.Dataset
        From ``read_campaign``, or some of its cases, of a campaign with a chain.
    draw : int
        0 is the noise of the campaign; 1, 2, ... are fresh.

    Returns
    -------
    xarray.DataArray, shape (case, sensor, time)
        Resistance [ohm].

    Raises
    ------
    DataError
        The campaign has no chain.
    """
    if "resistance" not in data:
        msg = "this campaign has no resistance. Add [chain] to campaign.toml and run it into another folder."
        raise DataError(msg)
    change = data["resistance"].attrs["full_scale_change"]
    noisy: xr.DataArray = data["resistance"] + change * _noise(data, "resistance", draw)
    return noisy.astype(np.float32).rename("measured_resistance")


def _noise(data: xr.Dataset, kind: str, draw: int) -> xr.DataArray:
    campaign = json.loads(data.attrs["campaign"])
    law = campaign["noise"][kind]
    numbers = data["case"].to_numpy().tolist()
    noise = unit_noise(law and Distribution(**law), kind, (campaign["seed"], draw), numbers, data.sizes["time"])
    histories = data["strain"].copy(data=noise)
    return histories * data[NOISE] if NOISE in data else histories

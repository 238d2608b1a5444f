r"""Cases of a campaign: damage, load, material, sensors and their noise, from the seed and the number of the case alone.

Symbols: ``N`` cases, ``u`` points of the unit cube [1], one row per case, one column per quantity.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..arrays import Matrix, Vector
from ..errors import DataError
from ..twin.lasting_error import random_errors
from .description import NOISE, SENSOR_ERROR, SENSOR_GAIN, CampaignPlan, Distribution, Vary

if TYPE_CHECKING:
    import xarray as xr

_CASES, _STRATA, _NOISE, _ERRORS = range(4)  # what random numbers are for
_BELOW_ONE = np.nextafter(1.0, 0.0)
_KINDS = {"strain": 0, "resistance": 1}


@dataclass(frozen=True)
class Cases:
    """What distinguishes some cases of a campaign.

    Attributes
    ----------
    numbers : sequence of int, length n
        Their numbers, from 0.
    damage : ndarray, shape (n, zones)
        Lost fraction of Young's modulus of each zone [1].
    varied : dict of ndarray, shape (n,)
        Quantities that vary, by name, in the unit of the membrane's table; ``noise`` is a factor [1].
    sensor_gain : ndarray, shape (n, sensors)
        Ratio of a sensor's reading to the right one [1].
    sensor_error : ndarray, shape (n, sensors)
        Root mean square of a sensor's own error over the range of what it feels [1].
    onset : ndarray, shape (n,)
        When damage begins [s]; 0: it is there from the start.
    """

    numbers: Sequence[int]
    damage: Matrix
    varied: dict[str, Vector]
    sensor_gain: Matrix
    sensor_error: Matrix
    onset: Vector


def draw_cases(campaign: CampaignPlan, numbers: Sequence[int]) -> Cases:
    """Draw cases.

    Parameters
    ----------
    campaign : CampaignPlan
        What to draw from.
    numbers : sequence of int, length n
        Numbers of the cases, 0 to ``campaign.count`` - 1.

    Returns
    -------
    Cases
        The same for a number whatever other numbers are drawn with it.

    Notes
    -----
    Philox [1]_ keyed by seed and number. A Latin hypercube [2]_ puts, in every column, one case in each of N equal
    strata; the permutation of the strata is a function of seed and column.

    References
    ----------
    .. [1] J. K. Salmon, M. A. Moraes, R. O. Dror, D. E. Shaw, Parallel random numbers: as easy as 1, 2, 3, SC11, 2011,
       doi:10.1145/2063384.2063405.
    .. [2] M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21(2), 239-245, 1979, doi:10.2307/1268522.
    """
    vary = dict(sorted(campaign.vary.items()))
    gain, error = vary.pop(SENSOR_GAIN, Vary(range=(1.0, 1.0))), vary.pop(SENSOR_ERROR, Vary(range=(0.0, 0.0)))
    zones, sensors = campaign.membrane.structure.n_zones, campaign.membrane.structure.n_sensors
    blocks = [1, zones, zones, sensors, len(vary), 1, 1, sensors, 1]
    u = np.split(unit_points(campaign, numbers, sum(blocks)), np.cumsum(blocks[:-1]), axis=1)
    count, order, depth, gains, rest, when, gained, errors, wrong = u
    first, last = campaign.damage.onset
    return Cases(
        numbers=numbers,
        damage=_listed(campaign, numbers) if campaign.damage.cases else _drawn(campaign, count, order, depth),
        varied={name: _spread(v, campaign.base(name), rest[:, i]) for i, (name, v) in enumerate(vary.items())},
        sensor_gain=np.where(gained < gain.share, _spread(replace(gain, share=1.0), 1.0, gains), 1.0),
        sensor_error=np.where(wrong < error.share, _spread(replace(error, share=1.0), 0.0, errors), 0.0),
        onset=np.maximum(first + (last - first) * when[:, 0], 0.0),
    )


def unit_points(campaign: CampaignPlan, numbers: Sequence[int], columns: int) -> Matrix:
    """Draw points of the unit cube, shape (n, columns) [1], as the campaign samples: at random or one per stratum."""
    u = np.array([generator(campaign.seed, _CASES, number).random(columns) for number in numbers]).reshape(-1, columns)
    if campaign.sampling == "random":
        return u
    N = campaign.count
    strata = np.column_stack([_strata(campaign.seed, N, column)[list(numbers)] for column in range(columns)])
    return np.asarray(np.minimum((strata + u) / N, _BELOW_ONE))


def generator(seed: int, *key: int) -> np.random.Generator:
    """Return the random generator of a seed and a key; other keys give independent ones."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=key)))


@lru_cache(maxsize=256)
def _strata(seed: int, cases: int, column: int) -> NDArray[np.int64]:
    return generator(seed, _STRATA, column).permutation(cases)


def _listed(campaign: CampaignPlan, numbers: Sequence[int]) -> Matrix:
    listed = campaign.damage.cases
    damage = np.zeros((len(numbers), campaign.membrane.structure.n_zones))
    for row, number in zip(damage, numbers, strict=True):
        for zone, value in listed[number % len(listed)].items():
            row[zone - 1] = value
    return damage


def _drawn(campaign: CampaignPlan, count: Matrix, order: Matrix, depth: Matrix) -> Matrix:
    r"""Turn points of the unit cube into damages, shape (n, zones).

    The first column tells how many zones: below the share h of healthy cases none, the rest divided equally. The zones are
    those with the smallest points of the second block, so that every set of zones is as likely.
    """
    law = campaign.damage
    (fewest, most), (low, high) = law.zones, law.depth
    left = (count - law.healthy) / max(1.0 - law.healthy, np.finfo(float).tiny)
    zones = np.where(count < law.healthy, 0, np.minimum(fewest + np.floor(left * (most - fewest + 1)), most))
    rank = order.argsort(axis=1, kind="stable").argsort(axis=1, kind="stable")
    return np.where(rank < zones, low + (high - low) * depth, 0.0)


def _spread(vary: Vary, base: float, u: Matrix) -> Matrix:
    """Turn points of the unit interval into values of a range: uniform, or with a uniform logarithm for a factor.

    Points beyond the share of the cases that it varies in give the constant value. Powers are taken one by one: NumPy's
    depend on the place of a number in its array, in the last bit.
    """
    if vary.share < 1.0:
        return np.where(u < vary.share, _spread(replace(vary, share=1.0), base, u / vary.share), base)
    if vary.factor is not None:
        low, high = vary.factor
        powers = np.array([(high / low) ** x for x in u.ravel().tolist()]).reshape(u.shape)
        return np.asarray(base * np.clip(low * powers, low, high))
    low, high = vary.range or (1.0, 1.0)
    return np.asarray(np.clip(low + (high - low) * u, low, high))


def unit_noise(
    law: Distribution | None, kind: str, key: tuple[int, int], numbers: Sequence[int], shape: tuple[int, int]
) -> Matrix:
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
    shape : tuple of int
        Sensors and samples.

    Returns
    -------
    ndarray, shape (n, sensors, samples)
        Noise [1]: of strain, or of resistance in units of the full-scale change. A function of kind, key and number.
    """
    seed, draw = key
    noise = np.zeros((len(numbers), *shape))
    if law is None:
        return noise
    for row, number in zip(noise, numbers, strict=True):
        row[:] = law.draw(row.shape, generator(seed, _NOISE, number, draw, _KINDS[kind]))
    return noise


def sensor_errors(level: Matrix, strain: Matrix, seed: int, numbers: Sequence[int]) -> Matrix:
    """Return the errors of the sensors of some cases along their strain [1], both of shape (n, sensors, T).

    Parameters
    ----------
    level : ndarray, shape (n, sensors)
        ``Cases.sensor_error``.
    strain : ndarray, shape (n, sensors, T)
        What they feel [1].
    seed : int
        Of the campaign; the errors are a function of it and of the number of the case.
    numbers : sequence of int, length n
        Cases.
    """
    errors = np.zeros(strain.shape)
    for error, size, felt, number in zip(errors, level, strain, numbers, strict=True):
        if size.any():
            error[:] = size[:, None] * random_errors(felt, generator(seed, _ERRORS, number))
    return errors


def measured_strain(data: xr.Dataset, draw: int = 0) -> xr.DataArray:
    """Return strain as sensors would read it: gain times strain plus the error of the sensor plus noise.

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
    if SENSOR_ERROR in data:
        seed, numbers = json.loads(data.attrs["campaign"])["seed"], data["case"].to_numpy().tolist()
        strain = data["strain"].to_numpy().astype(float)
        read = read + data["strain"].copy(data=sensor_errors(data[SENSOR_ERROR].to_numpy(), strain, seed, numbers))
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
    shape = data.sizes["sensor"], data.sizes["time"]
    noise = unit_noise(law and Distribution(**law), kind, (campaign["seed"], draw), numbers, shape)
    histories = data["strain"].copy(data=noise)
    return histories * data[NOISE] if NOISE in data else histories

"""Sensors and their compensators in the results of a run: what they read, and how far the strain is off.

What a compensator states of a time is recorded later, by its delay. The strain of a sensor is the true one where that was
recorded, else the compensated one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr
from gossamer_files.thinning import Array, Pixels

from ..errors import ResultsError
from .dataset import compensators, find_all, origins_of, sensors

LEAST_ERROR = 1e-9  # [%] less is round-off
LEAST_RANGE = 1e-6  # [1] errors in shares of a smaller range say nothing

Curve = Callable[[xr.Dataset], Array]


def curve_of(name: str, place: int | None = None, factor: float = 1.0) -> Curve:
    """Return a function that reads ``factor`` times a variable, of an array its element ``place`` from 0."""

    def read(part: xr.Dataset) -> Array:
        values = part[name].to_numpy()
        values = values if place is None else values.reshape(len(values), -1)[:, place]
        return factor * np.asarray(values, dtype=float)

    return read


@dataclass(frozen=True)
class StrainError:
    """How far compensated strain is from the true one of the same time.

    Attributes
    ----------
    rms, span : float
        Root mean square of the error, and range of the true strain [1]; not a number without any.
    beyond : float
        Share of the points whose error is above two stated deviations [1]; not a number where none are stated.
    curve, reach : ndarray
        Thinned error and two deviations [1]. The last rows have none: their strain is not yet compensated.
    """

    rms: float
    span: float
    beyond: float
    curve: Array
    reach: Array | None

    @property
    def sentence(self) -> str:
        """Say it in few words: in % of the range, in strain where that hardly changes."""
        percent = self.span >= LEAST_RANGE
        size = 100.0 * self.rms / self.span if percent else 100.0 * self.rms
        shown = "< 1e-9" if size < LEAST_ERROR else f"{size:.2g}" if size < 99.5 else f"{size:.0f}"
        return f"RMS error {shown} {'% of range' if percent else '% strain'}"


class Reader:
    """A sensor and its compensator, as far as they were recorded.

    Attributes
    ----------
    number : int
        Of the membrane's strain that they read, from 1.
    sensor, compensator : str
        Names of the components, empty if there is none.
    true : tuple of str and int or None, or None
        Variable that is the true strain, and its place in an array.
    delay : float
        How much later than it was the compensated strain is recorded [s].
    """

    def __init__(self, data: xr.Dataset, number: int, sensor: str, compensator: str) -> None:
        self.data, self.number, self.sensor, self.compensator = data, number, sensor, compensator
        self.time: Array = data["time"].to_numpy()
        self.true = self._true()
        self.late = self._recorded(f"{compensator}.strain")
        self.resistance, self.reading = (self._recorded(f"{sensor}.resistance"), self._recorded(f"{compensator}.resistance"))
        self.deviation = self._recorded(f"{compensator}.strain_deviation") if self.late else ""
        stated = self._recorded(f"{compensator}.delay")
        self.delay = float(data[stated][-1]) if stated else 0.0

    @property
    def label(self) -> str:
        """Number and names."""
        names = ", ".join(filter(None, (self.sensor, self.compensator)))
        return f"{self.number}: {names}" if names else f"{self.number}"

    @property
    def rows_late(self) -> int:
        """How many rows the delay is."""
        return int(np.searchsorted(self.time, self.time[0] + self.delay - 1e-9)) if self.delay > 0.0 else 0

    @property
    def strain(self) -> tuple[Curve, int] | None:
        """The strain of the sensor, and how many rows later than it was it is recorded."""
        if self.true:
            return curve_of(*self.true), 0
        return (curve_of(self.late), self.rows_late) if self.late else None

    def later(self, read: Curve, rows: slice, shift: int) -> Array:
        """Return what is recorded ``shift`` rows later than some rows; not a number beyond the end."""
        values = np.full(min(rows.stop, len(self.time)) - rows.start, np.nan)
        found = read(self.data.isel(time=slice(rows.start + shift, rows.stop + shift)))
        values[: len(found)] = found
        return values

    @cached_property
    def error(self) -> StrainError | None:
        """The error of the compensated strain, its delay taken out; None where one of both was not recorded."""
        if not self.true or not self.late:
            return None
        pixels, true, shift = Pixels(len(self.time)), curve_of(*self.true), self.rows_late
        squares, count, low, high, beyond, banded = 0.0, 0, np.inf, -np.inf, 0, 0
        errors: list[Array] = []
        reaches: list[Array] = []
        for rows in pixels.parts():
            here = true(self.data.isel(time=rows))
            error = self.later(curve_of(self.late), rows, shift) - here
            errors.append(pixels.thin(error))
            squares, count = squares + float(np.nansum(error**2)), count + int(np.isfinite(error).sum())
            if self.deviation:
                reach = self.later(curve_of(self.deviation, factor=2.0), rows, shift)
                reaches.append(pixels.thin(reach))
                beyond += int((np.abs(error) > reach).sum())
                banded += int(np.isfinite(error + reach).sum())
            low, high = min(low, float(np.fmin.reduce(here))), max(high, float(np.fmax.reduce(here)))
        rms, span = (math.sqrt(squares / count), high - low) if count else (math.nan, math.nan)
        share = beyond / banded if banded else math.nan
        return StrainError(rms, span, share, np.concatenate(errors), np.concatenate(reaches) if reaches else None)

    def _recorded(self, name: str) -> str:
        return name if name in self.data else ""

    def _true(self) -> tuple[str, int | None] | None:
        """Name what the sensor felt: its own input if a file feeds it, else the membrane's strain."""
        own, numbers = self._recorded(f"{self.sensor}.strain"), _strain_numbers(self.data)
        replayed = own and own not in origins_of(self.data)
        if self.number in numbers and not replayed:
            return f"{find_all(self.data, 'membrane')[0]}.strain", numbers.index(self.number)
        return (own, None) if own else None


def readers_of(data: xr.Dataset) -> list[Reader]:
    """List the sensors with their compensators by number; of a membrane alone, its strains."""
    names: dict[int, dict[str, str]] = {}
    for role, find in (("sensor", sensors), ("compensator", compensators)):
        try:
            found = find(data)
        except ResultsError:  # there is no membrane
            found = dict(enumerate(find_all(data, role), start=1))
        for number, name in found.items():
            names.setdefault(number, {})[role] = name
    names = names or {number: {} for number in _strain_numbers(data)}
    readers = [
        Reader(data, number, own.get("sensor", ""), own.get("compensator", "")) for number, own in sorted(names.items())
    ]
    return [each for each in readers if each.true or each.late or each.resistance or each.reading]


def _strain_numbers(data: xr.Dataset) -> list[int]:
    """List the numbers of the membrane's strains, if they were recorded."""
    strains = data.get(f"{next(iter(find_all(data, 'membrane')), '')}.strain")
    return [] if strains is None or strains.ndim != 2 else [int(n) for n in strains[strains.dims[1]].to_numpy()]

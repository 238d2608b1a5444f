"""What a page draws of each sensor and its compensator: curves, error, loop, spectrogram.

What a compensator states of a time is recorded later, by its delay. The strain of a sensor is the true one where that was
recorded, else the compensated one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import ResultsError
from ...pages.thin import Pixels
from ..dataset import compensators, find_all, origins_of, sensors
from ..judgements import Judgement
from .spectra import spectrogram, spectrum

LOOP_ROWS = 2000  # of a loop of resistance over strain

Array = NDArray[np.float64]
Curve = Callable[[xr.Dataset], Array]


def curve_of(name: str, place: int | None = None) -> Curve:
    """Return a function that reads a variable, of an array its element ``place`` from 0."""

    def read(part: xr.Dataset) -> Array:
        values = part[name].to_numpy()
        return np.asarray(values if place is None else values.reshape(len(values), -1)[:, place], dtype=float)

    return read


def sensor_curves(data: xr.Dataset) -> tuple[dict[str, Curve], dict[int, dict[str, Any]]]:
    """Return the curves of each sensor, named ``number/what``, and what stands where."""
    curves: dict[str, Curve] = {}
    readers = _readers(data)
    for number, reader in readers.items():
        sensor, late = reader.get("sensor", ""), reader.get("compensator", "")
        if true := _true_strain(data, number, sensor):
            reader["strain"] = true
            curves[f"{number}/strain"] = curve_of(*true)
        if f"{sensor}.resistance" in data:
            curves[f"{number}/resistance"] = curve_of(f"{sensor}.resistance")
        if f"{late}.resistance" in data:
            curves[f"{number}/reading"] = curve_of(f"{late}.resistance")
        if f"{late}.strain" in data:
            curves[f"{number}/compensated"] = curve_of(f"{late}.strain")
            reader["delay"] = float(data[f"{late}.delay"][-1]) if f"{late}.delay" in data else 0.0
            if f"{late}.strain_deviation" in data:
                for what, sign in (("low", -2.0), ("high", 2.0)):
                    curves[f"{number}/{what}"] = _band(f"{late}.strain", f"{late}.strain_deviation", sign)
    return curves, readers


def _readers(data: xr.Dataset) -> dict[int, dict[str, Any]]:
    """Return the names of sensor and compensator by the number of the sensor; of a membrane alone, its strains."""
    readers: dict[int, dict[str, Any]] = {}
    for role, find in (("sensor", sensors), ("compensator", compensators)):
        try:
            found = find(data)
        except ResultsError:  # there is no membrane
            found = dict(enumerate(find_all(data, role), start=1))
        for number, name in found.items():
            readers.setdefault(number, {})[role] = name
    return dict(sorted(readers.items())) or {number: {} for number in _strain_numbers(data)}


def _strain_numbers(data: xr.Dataset) -> list[int]:
    """List the numbers of the membrane's strains, if they were recorded."""
    strains = data.get(f"{next(iter(find_all(data, 'membrane')), '')}.strain")
    return [] if strains is None or strains.ndim != 2 else [int(n) for n in strains[strains.dims[1]].to_numpy()]


def _true_strain(data: xr.Dataset, number: int, sensor: str) -> tuple[str, int | None] | None:
    """Name what a sensor felt, and its place in an array: its own input if a file feeds it, else the membrane's strain."""
    own, numbers = f"{sensor}.strain", _strain_numbers(data)
    replayed = own in data and own not in origins_of(data)
    if number in numbers and not replayed:
        return f"{find_all(data, 'membrane')[0]}.strain", numbers.index(number)
    return (own, None) if own in data else None


def _band(name: str, deviation: str, sign: float) -> Curve:
    return lambda part: np.asarray(part[name].to_numpy() + sign * part[deviation].to_numpy(), dtype=float)


def _strain_of(data: xr.Dataset, reader: dict[str, Any]) -> tuple[Curve, float] | None:
    """Return the strain of a sensor, and how much later than it was it is recorded [s]."""
    late = f"{reader.get('compensator', '')}.strain"
    if "strain" in reader:
        return curve_of(*reader["strain"]), 0.0
    return (curve_of(late), reader["delay"]) if late in data else None


def rows_later(time: Array, delay: float) -> int:
    """Return how many rows a delay [s] is."""
    return int(np.searchsorted(time, time[0] + delay - 1e-9)) if delay > 0.0 else 0


def _later(data: xr.Dataset, read: Curve, rows: slice, shift: int) -> Array:
    """Return what is recorded ``shift`` rows later than some rows; not a number beyond the end."""
    values = np.full(min(rows.stop, data.sizes["time"]) - rows.start, np.nan)
    found = read(data.isel(time=slice(rows.start + shift, rows.stop + shift)))
    values[: len(found)] = found
    return values


def loops(
    data: xr.Dataset, time: Array, ended: Sequence[Judgement], reader: dict[str, Any], instants: NDArray[np.intp]
) -> dict[str, Any]:
    """Return resistance over strain of the same time, with spectra, and both at the slider's instants.

    The loops are those of the first and the last window, or of the last rows.
    """
    sensor, late = reader.get("sensor", ""), reader.get("compensator", "")
    name = next((n for n in (f"{sensor}.resistance", f"{late}.resistance") if n in data), None)
    found = _strain_of(data, reader)
    if name is None or found is None:
        return {}
    read, delay = found
    shift, resistance_of = rows_later(time, delay), curve_of(name)
    ends = [int(np.searchsorted(time, window.time)) for window in ended]
    if len(ends) > 1:
        spans = [("first window", 0, ends[0]), ("last window", ends[-2], ends[-1])]
    else:
        spans = [("end of the run", max(0, len(time) - LOOP_ROWS), len(time) - 1)]
    drawn = []
    for title, first, last in spans:
        rows = slice(max(first, last - LOOP_ROWS), last + 1)
        resistance = resistance_of(data.isel(time=rows))
        loop: dict[str, Any] = {"name": title, "strain": _later(data, read, rows, shift), "resistance": resistance}
        drawn.append(loop | spectrum(time[rows], resistance))
    known = instants + shift < len(time)
    strain = np.full(len(instants), np.nan)
    strain[known] = read(data.isel(time=instants[known] + shift))
    return {"loops": drawn, "at": {"strain": strain, "resistance": resistance_of(data.isel(time=instants))}}


def spectrogram_of(data: xr.Dataset, time: Array, reader: dict[str, Any]) -> dict[str, Any]:
    """Return the spectrogram of the strain of a sensor."""
    found = _strain_of(data, reader)
    if found is None:
        return {}
    read, delay = found
    values = np.concatenate([read(data.isel(time=rows)) for rows in Pixels(len(time)).parts()])
    drawn = spectrogram(time - delay, values)
    return {"spectrogram": drawn} if drawn else {}


def error_of(
    data: xr.Dataset, time: Array, pixels: Pixels, reader: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Array]]:
    """Return the error of the compensated strain, its delay taken out: RMS, the true range, and its curve.

    Where deviations are stated, ``beyond`` is the share of the points [1] whose error is above two of them. The last rows
    have no error: their strain is not yet compensated.
    """
    late = reader.get("compensator", "")
    if "strain" not in reader or f"{late}.strain" not in data:
        return {}, {}
    names = {"error": f"{late}.strain", "above": f"{late}.strain_deviation"}
    parts: dict[str, list[Array]] = {what: [] for what, name in names.items() if name in data}
    true, shift = curve_of(*reader["strain"]), rows_later(time, reader["delay"])
    squares, count, low, high = 0.0, 0, np.inf, -np.inf
    beyond, banded = 0, 0  # points above two deviations, and points that have one
    for rows in pixels.parts():
        here = true(data.isel(time=rows))
        error = _later(data, curve_of(names["error"]), rows, shift) - here
        parts["error"].append(pixels.thin(error))
        squares, count = squares + float(np.nansum(error**2)), count + int(np.isfinite(error).sum())
        if "above" in parts:
            above = 2.0 * _later(data, curve_of(names["above"]), rows, shift)
            parts["above"].append(pixels.thin(above))
            beyond += int((np.abs(error) > above).sum())
            banded += int(np.isfinite(error + above).sum())
        low, high = min(low, float(np.fmin.reduce(here))), max(high, float(np.fmax.reduce(here)))
    found = {"rms": float(np.sqrt(squares / count)), "span": high - low} if count else {}
    found |= {"beyond": beyond / banded} if banded else {}
    return found, {what: np.concatenate(each) for what, each in parts.items()}

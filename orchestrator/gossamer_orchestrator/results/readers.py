"""How charts and words read the results of a run, which may be longer than memory: curves, sensors and compensators.

What a compensator states of a time is recorded later, by its delay. The strain of a sensor is the true one where that was
recorded, else the compensated one.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from gossamer_files.charts import Array, Chart, Trace, curve
from gossamer_files.thinning import Pixels
from numpy.typing import NDArray

from ..errors import ResultsError
from .dataset import compensators, find_all, is_whole, origins_of, sensors
from .files import read_watch
from .judgements import MOST_WINDOWS, windows_of
from .shapes import ShapeHistory, load_shapes

logger = logging.getLogger(__name__)

LEAST_ERROR = 1e-9  # [%] less is round-off
FRAMES = 240  # instants of the slider
NUMBERS = 600_000  # of all frames of the membrane, at most
LEAST_RANGE = 1e-6  # [1] errors in shares of a smaller range say nothing

Curve = Callable[[xr.Dataset], Array]


class Times:
    """The times of the rows [s], which may be longer than memory.

    Parameters
    ----------
    data : xarray.Dataset
        Results.
    """

    def __init__(self, data: xr.Dataset) -> None:
        self._time = data["time"].variable

    def __len__(self) -> int:
        return len(self._time)

    def __getitem__(self, rows: int | slice | NDArray[np.intp]) -> Any:  # noqa: ANN401
        return self._time[rows].to_numpy()[()]

    def first_from(self, times: Any) -> NDArray[np.intp]:  # noqa: ANN401
        """Return the first row at or after each of some times [s]; one beyond the last where there is none."""
        parts = Pixels(len(self)).parts()
        return np.asarray(sum((np.searchsorted(self[rows], times) for rows in parts), start=np.zeros((), dtype=np.intp)))

    def are_even(self) -> bool:
        """Tell whether all steps are alike, but for rounding."""
        step = self[1] - self[0]
        steps = (np.diff(self[rows.start : rows.stop + 1]) for rows in Pixels(len(self)).parts())
        ends = [(each.min(), each.max()) for each in steps if each.size]
        return bool(max(high for _, high in ends) - min(low for low, _ in ends) <= 1e-6 * step + 1e-12)


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
        self.time = Times(data)
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
        return int(self.time.first_from(self.time[0] + self.delay - 1e-9)) if self.delay > 0.0 else 0

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


class Recorded:
    """What a run recorded.

    Parameters
    ----------
    data : xarray.Dataset
        Results, from memory or from the disk, with at least one row.
    folder : Path
        Where ``watch.json`` and the shapes of membranes may be.

    Attributes
    ----------
    time : Times
        Of all rows [s].
    ended : list of Judgement
        Windows of the detector; none if there is no detector.
    watch : dict
        What the digital twin saw that watched the run, empty if none did.
    membrane : str
        Name of the first membrane, empty if there is none.
    """

    def __init__(self, data: xr.Dataset, folder: Path) -> None:
        self.data = data
        self.time = Times(data)
        self.pixels = Pixels(len(self.time))
        ended = windows_of(data)[::-1]
        self.ended = ended[:: -(-len(ended) // MOST_WINDOWS) or 1][::-1]
        self.watch: dict[str, Any] = read_watch(folder) or {}
        self.folder = folder
        self.membrane = next(iter(find_all(data, "membrane")), "")
        self.drawn: set[str] = set()  # variables that some chart shows

    @cached_property
    def t(self) -> Array:
        """Times of thinned curves [s]."""
        return np.concatenate([self.pixels.times(self.time[rows]) for rows in self.pixels.parts()])

    def thin(self, read: Curve, *names: str) -> Array:
        """Return a curve, of each pixel's rows the smallest and the largest value; it is fast if it needs few variables."""
        data = self.data[list(names)] if names else self.data
        return np.concatenate([self.pixels.thin(read(data.isel(time=rows))) for rows in self.pixels.parts()])

    def curve(self, label: str, name: str, color: str = "@0", factor: float = 1.0, **line: Any) -> Trace:  # noqa: ANN401
        """Return a recorded scalar over time."""
        self.drawn.add(name)
        return curve(label, self.t, self.thin(curve_of(name, factor=factor), name), color, **{"width": 1.4} | line)

    @cached_property
    def shapes(self) -> dict[str, ShapeHistory]:
        """Shapes of the membranes that can be drawn in space; none, with a warning, where they cannot be read."""
        try:
            return load_shapes(self.folder)
        except ResultsError as error:
            logger.warning("%s", error)
            return {}

    @cached_property
    def heights(self) -> xr.DataArray | None:
        """Deflections of the nodes of a square membrane, if they were recorded of all."""
        w = self.data.get(f"{self.membrane}.w")
        return w if w is not None and w.ndim == 3 and is_whole(w) else None

    @property
    def history(self) -> ShapeHistory | None:
        """Shapes of the first membrane."""
        return self.shapes.get(self.membrane)

    @cached_property
    def instants(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows of the slider's instants, and which shapes of the membrane belong to them."""
        if (history := self.history) is not None:
            surface = history.surface
            count = max(2, min(FRAMES, NUMBERS // (surface.nodes.size + 2 * len(surface.faces))))
            shown = np.unique(np.linspace(0, len(history.time) - 1, count).round().astype(int))
            after = self.time.first_from(history.time[shown] - 1e-9 * (self.time[-1] - self.time[0]))
            return np.minimum(after, len(self.time) - 1), shown
        size = 1 if self.heights is None else 3 * int(np.prod(self.heights.shape[1:]))
        count = max(2, min(FRAMES, NUMBERS // size))
        rows = np.unique(np.linspace(0, len(self.time) - 1, count).round().astype(int))
        return rows, np.arange(len(rows))


def over_time(title: str, y: str, traces: list[Trace], **more: Any) -> Chart:  # noqa: ANN401
    """Return a chart over time; all of them are zoomed together."""
    return Chart(title, "time [s]", y, traces, linked="time", **more)

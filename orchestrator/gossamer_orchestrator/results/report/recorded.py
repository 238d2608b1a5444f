"""The results that the charts of a run are made of; they may be longer than memory, so that curves over time are thinned."""

from __future__ import annotations

import logging
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from gossamer_files.charts import Array, Chart, Trace, curve
from gossamer_files.thinning import Pixels
from numpy.typing import NDArray

from ...errors import ResultsError
from ..dataset import find_all, is_whole
from ..files import read_watch
from ..judgements import windows_of
from ..readers import Curve, curve_of
from ..shapes import ShapeHistory, load_shapes

logger = logging.getLogger(__name__)

FRAMES = 240  # instants of the slider
NUMBERS = 600_000  # of all frames of the membrane, at most


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
    time : ndarray
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
        self.time: Array = data["time"].to_numpy()
        self.pixels = Pixels(len(self.time))
        self.ended = windows_of(data)
        self.watch: dict[str, Any] = read_watch(folder) or {}
        self.folder = folder
        self.membrane = next(iter(find_all(data, "membrane")), "")
        self.drawn: set[str] = set()  # variables that some chart shows

    @cached_property
    def t(self) -> Array:
        """Times of thinned curves [s]."""
        return np.concatenate([self.pixels.times(self.time[rows]) for rows in self.pixels.parts()])

    def thin(self, read: Curve) -> Array:
        """Return a curve, of each pixel's rows the smallest and the largest value."""
        return np.concatenate([self.pixels.thin(read(self.data.isel(time=rows))) for rows in self.pixels.parts()])

    def curve(self, label: str, name: str, color: str = "@0", factor: float = 1.0, **line: Any) -> Trace:  # noqa: ANN401
        """Return a recorded scalar over time."""
        self.drawn.add(name)
        return curve(label, self.t, self.thin(curve_of(name, factor=factor)), color, **{"width": 1.4} | line)

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
            after = np.searchsorted(self.time, history.time[shown] - 1e-9 * (self.time[-1] - self.time[0]))
            return np.minimum(after, len(self.time) - 1), shown
        size = 1 if self.heights is None else 3 * int(np.prod(self.heights.shape[1:]))
        count = max(2, min(FRAMES, NUMBERS // size))
        rows = np.unique(np.linspace(0, len(self.time) - 1, count).round().astype(int))
        return rows, np.arange(len(rows))


def over_time(title: str, y: str, traces: list[Trace], **more: Any) -> Chart:  # noqa: ANN401
    """Return a chart over time; all of them are zoomed together."""
    return Chart(title, "time [s]", y, traces, linked="time", **more)

"""Collect what a page of a run draws, from results that may be longer than memory.

Symbols: ``t`` times [s], ``frames`` the instants of the slider. Large arrays are numpy arrays in what is returned; ``page``
packs them.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import ResultsError
from ...pages.thin import Pixels
from ..dataset import LIKENESS, find_all, is_whole
from ..files import read_watch
from ..judgements import Judgement, changes, true_damage, windows
from ..plots.axes import side
from ..shapes import ShapeHistory, load_shapes
from .membrane import membrane_mesh
from .sensors import Array, Curve, curve_of, error_of, loops, sensor_curves, spectrogram_of
from .surface import surface_content

FRAMES = 240  # instants of the slider
NUMBERS = 600_000  # of all frames of the membrane, at most
OTHERS = 24  # curves of what has no picture of its own
MOST_WINDOWS = 5000


def collect(data: xr.Dataset, ended: Sequence[Judgement], folder: Path) -> dict[str, Any]:
    """Return all that a page draws.

    Parameters
    ----------
    data : xarray.Dataset
        Results, from memory or from the disk.
    ended : sequence of Judgement
        Windows of the detector, as ``windows_of`` lists them.
    folder : Path
        Where ``watch.json`` may be.
    """
    time, pixels = data["time"].to_numpy(), Pixels(data.sizes["time"])
    membrane = next(iter(find_all(data, "membrane")), "")
    heights = data.get(f"{membrane}.w")
    if heights is not None and not is_whole(heights):
        heights = None
    history = load_shapes(folder).get(membrane)
    rows, shown = _instants(time, heights, history)
    curves, readers = sensor_curves(data)
    centre = f"{membrane}.deflection"
    covered = {"deflection": curve_of(centre)} if centre in data else {}
    others = _other_scalars(data, judged=bool(ended))
    t, lines = _thin_all(data, time, pixels, curves | covered | others)
    for number, reader in readers.items():
        own = {key.split("/")[1]: lines[key] for key in curves if key.startswith(f"{number}/")}
        errors, more = error_of(data, time, pixels, reader)
        reader |= loops(data, time, ended, reader, rows) | spectrogram_of(data, time, reader) | errors
        reader["curves"] = own | more
    constant = {name: float(lines[name][0]) for name in others if np.ptp(lines[name]) == 0.0}
    return {
        "rows": len(time),
        "stride": pixels.stride,
        "start": float(time[0]),
        "end": float(time[-1]),
        "time": t,
        "frames": time[rows],
        "frame_rows": rows,
        "deflection": lines.get("deflection"),
        "sensors": [{"number": number, **reader} for number, reader in readers.items()],
        "others": [
            {"name": name, "unit": data[name].attrs.get("units", ""), "values": lines[name]}
            for name in others
            if name not in constant
        ],
        "constant": constant,
        "square": heights is not None or history is None,
        "side": side(data),
        "membrane": None if heights is None or history is not None else membrane_mesh(data, membrane, rows, side(data)),
        "surface": None if history is None else surface_content(history, shown),
        "damage": _damage(data, time, ended),
        "watch": read_watch(folder),
    }


def _instants(
    time: Array, heights: xr.DataArray | None, history: ShapeHistory | None
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Choose the rows of the slider's instants, and the shapes of a membrane on a mesh then."""
    if history is not None:
        surface = history.surface
        count = max(2, min(FRAMES, NUMBERS // (surface.nodes.size + 2 * len(surface.faces))))
        shown = np.unique(np.linspace(0, len(history.time) - 1, count).round().astype(int))
        after = np.searchsorted(time, history.time[shown] - 1e-9 * (time[-1] - time[0]))
        return np.minimum(after, len(time) - 1), shown
    size = 1 if heights is None else 2 * int(np.prod(heights.shape[1:]))
    rows = np.linspace(0, len(time) - 1, max(2, min(FRAMES, NUMBERS // size))).round().astype(int)
    return np.unique(rows), np.zeros(0, dtype=np.intp)


def windows_of(data: xr.Dataset) -> list[Judgement]:
    """List the windows of the detector, few enough for a page; none if there is no detector."""
    try:
        ended = windows(data)
    except ResultsError:
        return []
    stride = -(-len(ended) // MOST_WINDOWS) if ended else 1
    return ended[::-1][::stride][::-1]


def _other_scalars(data: xr.Dataset, *, judged: bool) -> dict[str, Curve]:
    """Return curves of recorded scalars that no other picture shows."""
    known: dict[str, tuple[str, ...]] = {
        "membrane": ("deflection",),
        "sensor": ("resistance", "strain"),
        "detector": ("valid",),
    }
    if judged:
        known["detector"] += (*LIKENESS, "risk")
    known["compensator"] = ("resistance", "strain", "strain_deviation", "delay")
    shown = {f"{name}.{v}" for role, names in known.items() for name in find_all(data, role) for v in names}
    return {str(n): curve_of(str(n)) for n in data.data_vars if data[n].dims == ("time",) and n not in shown}


def _thin_all(
    data: xr.Dataset, time: Array, pixels: Pixels, curves: dict[str, Curve]
) -> tuple[Array, dict[str, Array]]:
    """Thin all curves in one pass over the file."""
    parts: dict[str, list[Array]] = {name: [] for name in curves}
    times = []
    for rows in pixels.parts():
        part = data.isel(time=rows)
        times.append(pixels.times(time[rows]))
        for name, read in curves.items():
            parts[name].append(pixels.thin(read(part)))
    return np.concatenate(times), {name: np.concatenate(each) for name, each in parts.items()}


def _damage(data: xr.Dataset, time: Array, ended: Sequence[Judgement]) -> dict[str, Any] | None:
    """Return windows and the true damage as steps: a value holds from its time on."""
    true: dict[str, Any] | None = None
    if name := true_damage(data):
        rows = np.concatenate([[0], changes(data[[name]])])[:MOST_WINDOWS]
        true = {"time": time[rows], "values": data[name].isel(time=rows).to_numpy().reshape(len(rows), -1)}
    if not ended and true is None:
        return None
    found: dict[str, Any] | None = None
    if ended:
        at = np.searchsorted(time, [window.time for window in ended])
        found = {
            "time": np.array([window.time for window in ended]),
            "estimated": np.stack([window.estimated for window in ended]),
            "deviation": np.stack([window.deviation for window in ended]),
            "valid": [window.valid for window in ended],
            "likeness": ended[-1].likeness,
            "likeness_values": np.array([window.likeness_value for window in ended]),
            "risk": np.array([window.risk for window in ended]),
        }
        detector = find_all(data, "detector")[0]
        for name in ("probability", "index"):
            if f"{detector}.{name}" in data:
                values = data[f"{detector}.{name}"].isel(time=at).to_numpy()
                if values.shape == found["estimated"].shape:  # else of some zones only
                    found[name] = values
    return {"true": true, "windows": found}

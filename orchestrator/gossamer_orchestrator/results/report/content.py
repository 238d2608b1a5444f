"""Collect what a page of a run draws, from results that may be longer than memory.

Symbols: ``t`` times [s], ``frames`` the instants of the slider. Large arrays are numpy arrays in what is returned; ``page``
packs them.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...errors import ResultsError
from ...pages.thin import Pixels
from ..columns import LIKENESS
from ..judgements import Judgement, changes, true_damage, windows
from ..plots.axes import side
from ..roles import compensators, find_all, sensors
from ..shapes import ShapeHistory, load_shapes
from .membrane import membrane_mesh
from .spectra import spectrogram, spectrum
from .surface import surface_content

FRAMES = 240  # instants of the slider
NUMBERS = 600_000  # of all frames of the membrane, at most
LOOP_ROWS = 2000  # of a loop of resistance over strain
OTHERS = 24  # curves of what has no picture of its own
MOST_WINDOWS = 5000
WATCH = "watch.json"

Array = NDArray[np.float64]
Curve = Callable[[xr.Dataset], Array]


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
    history = load_shapes(folder).get(membrane)
    rows, shown = _instants(time, heights, history)
    curves, readers = _sensor_curves(data)
    centre = f"{membrane}.deflection"
    covered = {"deflection": _reader(centre)} if centre in data else {}
    others = _other_scalars(data, judged=bool(ended))
    t, lines = _thin_all(data, time, pixels, curves | covered | others)
    for number, reader in readers.items():
        reader |= _loops(data, time, ended, reader)
        reader |= _at_rows(data, rows, reader) | _strain_spectrogram(data, time, reader)
        errors, more = _errors(data, time, pixels, reader)
        reader |= errors
        reader["curves"] = {key.split("/")[1]: lines[key] for key in curves if key.startswith(f"{number}/")} | more
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


def read_watch(folder: Path) -> dict[str, Any] | None:
    """Read what the twin found, if it watched the run."""
    try:
        content = json.loads((folder / WATCH).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None


def _sensor_curves(data: xr.Dataset) -> tuple[dict[str, Curve], dict[int, dict[str, Any]]]:
    """Return the curves of each sensor, named ``number/what``, and what stands where."""
    membrane = next(iter(find_all(data, "membrane")), "")
    curves: dict[str, Curve] = {}
    readers: dict[int, dict[str, Any]] = {}
    for role, find in (("sensor", sensors), ("compensator", compensators)):
        try:
            found = find(data)
        except ResultsError:  # there is no membrane
            found = dict(enumerate(find_all(data, role), start=1))
        for number, name in found.items():
            readers.setdefault(number, {})[role] = name
    strains = data.get(f"{membrane}.strain")
    if not readers and strains is not None and strains.ndim == 2:
        readers = {int(number): {} for number in strains[strains.dims[1]].to_numpy()}  # a membrane alone
    for number, reader in sorted(readers.items()):
        sensor, late = reader.get("sensor", ""), reader.get("compensator", "")
        if strains is not None and strains.ndim == 2 and number in strains[strains.dims[1]].to_numpy():
            place = int(np.flatnonzero(strains[strains.dims[1]].to_numpy() == number)[0])
            curves[f"{number}/strain"] = _reader(f"{membrane}.strain", place)
            reader["strain"] = (f"{membrane}.strain", place)
        if f"{sensor}.resistance" in data:
            curves[f"{number}/resistance"] = _reader(f"{sensor}.resistance")
        if f"{late}.resistance" in data:
            curves[f"{number}/reading"] = _reader(f"{late}.resistance")
        if f"{late}.strain" in data:
            curves[f"{number}/compensated"] = _reader(f"{late}.strain")
            reader["delay"] = float(data[f"{late}.delay"][-1]) if f"{late}.delay" in data else 0.0
            if f"{late}.strain_deviation" in data:
                for what, sign in (("low", -2.0), ("high", 2.0)):
                    curves[f"{number}/{what}"] = _band(f"{late}.strain", f"{late}.strain_deviation", sign)
    return curves, dict(sorted(readers.items()))


def _reader(name: str, place: int | None = None) -> Curve:
    def read(part: xr.Dataset) -> Array:
        values = part[name].to_numpy()
        return np.asarray(values if place is None else values.reshape(len(values), -1)[:, place], dtype=float)

    return read


def _band(name: str, deviation: str, sign: float) -> Curve:
    return lambda part: np.asarray(part[name].to_numpy() + sign * part[deviation].to_numpy(), dtype=float)


def _other_scalars(data: xr.Dataset, *, judged: bool) -> dict[str, Curve]:
    """Return curves of recorded scalars that no other picture shows."""
    known: dict[str, tuple[str, ...]] = {"membrane": ("deflection",), "sensor": ("resistance",), "detector": ("valid",)}
    if judged:
        known["detector"] += LIKENESS
    known["compensator"] = ("resistance", "strain", "strain_deviation", "delay")
    shown = {f"{name}.{v}" for role, names in known.items() for name in find_all(data, role) for v in names}
    return {str(n): _reader(str(n)) for n in data.data_vars if data[n].dims == ("time",) and n not in shown}


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


def _pair(data: xr.Dataset, reader: dict[str, Any]) -> tuple[Curve, Curve] | None:
    """Return what a loop shows: strain, the compensated one if there is no other, and resistance."""
    sensor, late = reader.get("sensor", ""), reader.get("compensator", "")
    resistance = next((n for n in (f"{sensor}.resistance", f"{late}.resistance") if n in data), None)
    if resistance is None or ("strain" not in reader and f"{late}.strain" not in data):
        return None
    strain = _reader(*reader["strain"]) if "strain" in reader else _reader(f"{late}.strain")
    return strain, _reader(resistance)


def _loops(data: xr.Dataset, time: Array, ended: Sequence[Judgement], reader: dict[str, Any]) -> dict[str, Any]:
    """Return resistance over strain of the first and the last window, or of the last rows, and the spectra of both."""
    pair = _pair(data, reader)
    if pair is None:
        return {}
    ends = [int(np.searchsorted(time, window.time)) for window in ended]
    if len(ends) > 1:
        spans = [("first window", 0, ends[0]), ("last window", ends[-2], ends[-1])]
    else:
        spans = [("end of the run", max(0, len(time) - LOOP_ROWS), len(time) - 1)]
    loops = []
    for name, first, last in spans:
        rows = slice(max(first, last - LOOP_ROWS), last + 1)
        part = data.isel(time=rows)
        strain, resistance = (read(part) for read in pair)
        loop: dict[str, Any] = {"name": name, "strain": strain, "resistance": resistance}
        loops.append(loop | spectrum(time[rows], resistance))
    return {"loops": loops}


def _strain_spectrogram(data: xr.Dataset, time: Array, reader: dict[str, Any]) -> dict[str, Any]:
    """Return the spectrogram of the true strain of a sensor, of the compensated one if there is no other."""
    late = f"{reader.get('compensator', '')}.strain"
    if "strain" not in reader and late not in data:
        return {}
    read = _reader(*reader["strain"]) if "strain" in reader else _reader(late)
    found = spectrogram(time, np.concatenate([read(data.isel(time=rows)) for rows in Pixels(len(time)).parts()]))
    return {"spectrogram": found} if found else {}


def _at_rows(data: xr.Dataset, rows: NDArray[np.intp], reader: dict[str, Any]) -> dict[str, Any]:
    pair = _pair(data, reader)
    if pair is None:
        return {}
    part = data.isel(time=rows)
    strain, resistance = (read(part) for read in pair)
    return {"at": {"strain": strain, "resistance": resistance}}


def _errors(
    data: xr.Dataset, time: Array, pixels: Pixels, reader: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Array]]:
    """Return the error of the compensated strain, its delay taken out: RMS and the true range, and its curve.

    The last rows have no error: their strain is not yet compensated.
    """
    late = reader.get("compensator", "")
    if "strain" not in reader or f"{late}.strain" not in data:
        return {}, {}
    names = {"error": f"{late}.strain", "above": f"{late}.strain_deviation"}
    parts: dict[str, list[Array]] = {what: [] for what, name in names.items() if name in data}
    true = _reader(*reader["strain"])
    shift = int(np.searchsorted(time, time[0] + reader["delay"] - 1e-9)) if reader["delay"] > 0.0 else 0
    squares, count, low, high = 0.0, 0, np.inf, -np.inf
    for rows in pixels.parts():
        here = true(data.isel(time=rows))
        later = data.isel(time=slice(rows.start + shift, rows.stop + shift))
        for what, each in parts.items():
            values = np.full(len(here), np.nan)
            values[: later.sizes["time"]] = later[names[what]].to_numpy()
            values = values - here if what == "error" else 2.0 * values
            each.append(pixels.thin(values))
            if what == "error":
                squares, count = squares + float(np.nansum(values**2)), count + int(np.isfinite(values).sum())
        low, high = min(low, float(np.fmin.reduce(here))), max(high, float(np.fmax.reduce(here)))
    found = {"rms": float(np.sqrt(squares / count)), "span": high - low} if count else {}
    return found, {what: np.concatenate(each) for what, each in parts.items()}


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
        }
        detector = find_all(data, "detector")[0]
        for name in ("probability", "index"):
            if f"{detector}.{name}" in data:
                values = data[f"{detector}.{name}"].isel(time=at).to_numpy()
                found[name] = values.reshape(len(at), -1)
    return {"true": true, "windows": found}

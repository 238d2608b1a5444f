"""Say which sensors left the range that they were identified in, and where recovered strain is far off the true one."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray as xr

from ...names import split_endpoint
from ...pages.thin import Pixels
from ...words import percent
from ..dataset import origins_of
from ..plots.sensors import LEAST_RANGE
from .sensors import Array, curve_of, error_of, rows_later, sensor_curves

WITHIN_BAND = (
    0.1  # share of the errors above two stated deviations, up to which the compensator has said how wrong it is
)
LARGE_ERROR = 0.5  # RMS error of recovered strain over the range of the true one, from which the strain is called wrong


def sensor_doubts(data: xr.Dataset) -> list[str]:
    """List reasons to doubt the strain of a run: components out of their identified range, and strain that is wrong."""
    readers = sensor_curves(data)[1]
    beyond = [
        _beyond(data, name, readers)
        for name in (
            str(each).removesuffix(".saturated") for each in data.data_vars if str(each).endswith(".saturated")
        )
        if float(data[f"{name}.saturated"].max()) > 0.5
    ]
    if beyond:
        beyond.append("Do not trust the strain and damage that follow from what was outside its identified range.")
    return [*beyond, *filter(None, (_wrong(data, reader) for reader in readers.values()))]


def _beyond(data: xr.Dataset, name: str, readers: dict[int, dict[str, Any]]) -> str:
    """Say how far a component left its identified range, as far as that was recorded."""
    rows = data[f"{name}.saturated"].to_numpy() > 0.5
    when = f"in {percent(float(np.mean(rows)))} of the run"
    if rows.ndim > 1:
        return f"{name} was outside its identified range {when}."
    limits = json.loads(data.attrs.get("fmus", "{}")).get(name, {}).get("parameters", {})
    names = ("rest_resistance", "full_scale_resistance_change", "full_scale_strain")
    rest, rise, full = (float(limits.get(each, np.nan)) for each in names)
    known = np.isfinite([rest, rise, full]).all()
    for reader in readers.values():
        if reader.get("sensor") == name and "strain" in reader:
            felt = (
                [f"{name}.strain"] if f"{name}.strain" in data else reader["strain"]
            )  # its input, or where that begins
            strain = 100.0 * _furthest(curve_of(*felt)(data)[rows], 0.5 * full)
            limit = f", 0 to {100.0 * full:.4g} % strain" if known else ""
            return f"{name} reached {strain:.4g} % strain, outside its identified range{limit}, {when}."
        read = _reading(data, name)
        if reader.get("compensator") == name and read:
            late = rows_later(
                data["time"].to_numpy(), reader["delay"]
            )  # what it judges may have been read so long before
            near = rows | np.append(rows[late:], np.zeros(min(late, rows.size), dtype=bool))
            resistance = _furthest(curve_of(read)(data)[near], rest + 0.5 * rise)
            limit = (
                f", 0 to {100.0 * full:.4g} % strain: from {rest:.5g} ohm at rest to {rest + rise:.5g} ohm when first loaded"
                if known
                else ""
            )
            return (
                f"{name} read {resistance:.5g} ohm, and {when} no strain explains what it read within its identified "
                f"range{limit}."
            )
    return f"{name} was outside its identified range {when}."


def _reading(data: xr.Dataset, name: str) -> str:
    """Name the recorded resistance that a compensator reads; empty if there is none."""
    candidates = (f"{name}.resistance", origins_of(data).get(f"{name}.resistance", ""))
    return next((each for each in candidates if each in data and split_endpoint(each)[1]), "")


def _furthest(values: Array, middle: float) -> float:
    """Return the value that is furthest from the middle of a range; the largest where that is not known."""
    return float(values[np.argmax(np.abs(values - middle))] if np.isfinite(middle) else values.max())


def _wrong(data: xr.Dataset, reader: dict[str, Any]) -> str:
    """Say that recovered strain is off by more than half of the range of the true strain; empty if it is not."""
    found, _ = error_of(data, data["time"].to_numpy(), Pixels(data.sizes["time"]), reader)
    if not found or found["span"] < LEAST_RANGE or found["rms"] <= LARGE_ERROR * found["span"]:
        return ""
    if found.get("beyond", 1.0) <= WITHIN_BAND:
        return ""
    share = 100.0 * found["rms"] / found["span"]
    return (
        f"The strain that {reader['compensator']} recovers is wrong: its RMS error of {100.0 * found['rms']:.3g} % strain "
        f"is {share:.0f} % of the range of the true strain, {100.0 * found['span']:.3g} % strain."
    )

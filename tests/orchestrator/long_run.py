"""Made-up results of a run of ten minutes, whose curves share their numbers so that they fit in memory."""

from __future__ import annotations

import numpy as np
import xarray as xr

STEP = 3e-4  # [s]
ROWS = 2_000_000
WINDOW = 844  # rows


def long_run(rows: int = ROWS) -> xr.Dataset:
    """Return what the chain records: a vibration with noise, and four zones of which one loses stiffness."""
    time = STEP * np.arange(rows)
    swing = np.sin(2.0 * np.pi * time / 0.1266) + 0.01 * np.random.default_rng(1).normal(size=rows)
    judged = np.repeat(np.linspace(0.0, 0.4, rows // WINDOW + 1), WINDOW)[:rows]
    zones = np.outer(judged, [0.0, 1.0, 0.0, 0.05])
    strain = 0.1 + 0.05 * swing
    some = np.full(rows, 1e-3)
    variables = {
        "membrane.damage": (("time", "zone"), zones),
        "membrane.strain": (("time", "sensor"), np.broadcast_to(strain[:, None], (rows, 4))),
        "membrane.deflection": ("time", swing),
        "membrane.w": (("time", "w_i", "w_j"), np.broadcast_to(swing[:, None, None], (rows, 7, 7))),
        "detector.damage": (("time", "zone"), zones),
        "detector.deviation": (("time", "zone"), np.broadcast_to(some[:, None], (rows, 4))),
        "detector.misfit": ("time", judged),
        "detector.valid": ("time", np.ones(rows)),
    }
    for k in range(1, 5):
        variables[f"sensor{k}.resistance"] = ("time", swing)
        variables[f"compensator{k}.resistance"] = ("time", swing)
        variables[f"compensator{k}.strain"] = ("time", strain)
        variables[f"compensator{k}.strain_deviation"] = ("time", some)
    coordinates = {"time": time, "zone": np.arange(1, 5), "sensor": np.arange(1, 5)}
    return xr.Dataset(variables, coords=coordinates, attrs={"title": "Ten minutes"})

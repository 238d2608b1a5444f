"""Made-up results with known damage."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr
from gossamer_orchestrator.results.report import write_report


@pytest.fixture
def data() -> xr.Dataset:
    """Zone 2 loses 30 % at t = 5; judged 0 at t = 4 and 20 % at t = 8; zone 7 falsely 4 %."""
    time = np.arange(10.0)
    true, estimated, index, valid = np.zeros((10, 16)), np.zeros((10, 16)), np.ones((10, 16)), np.zeros(10)
    true[5:, 1], estimated[8:, 1], estimated[8:, 6] = 0.3, 0.2, 0.04
    index[4:], index[8:] = 1.1, 2.0
    valid[4:] = 1.0
    i, j = np.meshgrid(np.arange(1, 8), np.arange(1, 8), indexing="ij")
    shape = np.sin(np.pi * i / 8) * np.sin(np.pi * j / 8)
    strains = 0.02 + 0.01 * np.sin(time)[:, None] * np.ones(4)
    variables = {
        "membrane.damage": (("time", "zone"), true),
        "membrane.strain": (("time", "sensor"), strains),
        "membrane.deflection": ("time", np.sin(time)),
        "membrane.w": (("time", "w_i", "w_j"), np.sin(time)[:, None, None] * shape),
        "detector.damage": (("time", "zone"), estimated),
        "detector.index": (("time", "zone"), index),
        "detector.valid": ("time", valid),
        "detector.similarity": ("time", 0.5 * valid),
    }
    for k in range(1, 5):
        variables[f"sensor{k}.resistance"] = ("time", 100.0 + time)
        variables[f"compensator{k}.strain"] = ("time", strains[:, 0])
    coordinates = {"time": time, "zone": np.arange(1, 17), "sensor": np.arange(1, 5)}
    return xr.Dataset(variables, coords=coordinates, attrs={"title": "made up"})


@pytest.fixture
def report(data, tmp_path) -> str:
    """Address of the page of these results, with a detector that states deviations and a twin that watched."""
    data = data.drop_vars("detector.similarity")
    data["detector.deviation"] = (data["detector.damage"].dims, 0.1 * data["detector.damage"].to_numpy())
    data["detector.misfit"] = ("time", np.full(10, 0.4))
    for k in range(1, 5):
        data[f"compensator{k}.strain_deviation"] = ("time", np.full(10, 1e-3))
    (tmp_path / "watch.json").write_text(
        '{"alarms": [6.0], "findings": [{"onset": 5.0, "onset_deviation": 0.1}], "misfit": []}'
    )
    return write_report(data, tmp_path).as_uri()


@pytest.fixture
def later_window_invalid() -> Callable[[xr.Dataset], xr.Dataset]:
    """Make the last window of results end without a valid judgement."""

    def change(data: xr.Dataset) -> xr.Dataset:
        data["detector.valid"][8:] = 0.0
        data["detector.similarity"][8:] = 0.28
        return data

    return change

"""Made-up results with known damage."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr
from browsing import opened
from gossamer_orchestrator.results.report import write_report


def made_up() -> xr.Dataset:
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
def data() -> xr.Dataset:
    """Made-up results."""
    return made_up()


@pytest.fixture(scope="module")
def report(tmp_path_factory) -> str:
    """Address of the page of these results, with a detector that states deviations and a twin that watched."""
    data, tmp_path = made_up().drop_vars("detector.similarity"), tmp_path_factory.mktemp("report")
    data["detector.deviation"] = (data["detector.damage"].dims, 0.08 * data["detector.damage"].to_numpy())
    data["detector.misfit"] = ("time", np.full(10, 0.4))
    for k in range(1, 5):
        data[f"compensator{k}.strain_deviation"] = ("time", np.full(10, 1e-3))
        data[f"compensator{k}.resistance"] = ("time", 100.0 + np.arange(10.0) + 0.1)
    guid = "{8d800c1a-0c0f-5918-b007-0f87caa7e815}"
    fmus = {"membrane": "membrane", "detector": "detector"}
    fmus |= {f"{role}{k}": role for role in ("sensor", "compensator") for k in range(1, 5)}
    data.attrs["fmus"] = json.dumps(
        {name: {"file": f"{model}.fmu", "model": model, "guid": guid} for name, model in fmus.items()}
    )
    finding = {"onset": 5.0, "onset_deviation": 0.1, "damage": [0.0, 0.3] + [0.0] * 14, "deviation": [0.01] * 16}
    (tmp_path / "watch.json").write_text(json.dumps({"alarms": [6.0], "findings": [finding], "misfit": []}))
    return write_report(data, tmp_path).as_uri()


@pytest.fixture(scope="module")
def drawn(browser, report):
    """The page, drawn once for all tests of a file, and what it complains about."""
    troubles: list[str] = []
    page = opened(browser, report, troubles, viewport={"width": 1400, "height": 900})
    yield page, troubles
    page.close()


@pytest.fixture
def page(drawn):
    """The page at the end of the run, in light colours on a screen; it must not complain until the end of the test."""
    page, troubles = drawn
    page.emulate_media(media="screen", color_scheme="light")
    page.evaluate("setInstant(page.content.frames.length - 1)")
    page.evaluate("page.figures.forEach(moveFigure)")
    yield page
    assert troubles == []


@pytest.fixture
def later_window_invalid() -> Callable[[xr.Dataset], xr.Dataset]:
    """Make the last window of results end without a valid judgement."""

    def change(data: xr.Dataset) -> xr.Dataset:
        data["detector.valid"][8:] = 0.0
        data["detector.similarity"][8:] = 0.28
        return data

    return change

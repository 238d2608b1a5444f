"""The page of a run in a real browser, as its reader sees it."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from browsing import PATIENCE, opened
from gossamer_orchestrator.fmi.shape import Surface
from gossamer_orchestrator.results.report import write_report
from gossamer_orchestrator.results.shapes import create_shapes


def test_the_slider_moves_every_picture_and_nothing_is_amiss(browser, report):
    troubles: list[str] = []
    page = opened(browser, report, troubles, viewport={"width": 1400, "height": 900})
    assert page.inner_text("#verdict").startswith("Damaged: zone 2 lost 20.0 ± 2.0 % of its stiffness")
    assert page.locator("figure").count() == 11
    assert page.inner_text("#clock") == "9.0000 s"
    heights = "() => Array.from(page.figures.find(each => each.title === 'Membrane').div.data[0].z)"
    shown = "() => page.figures[0].div.data[0].z.flat()"
    last, judged = page.evaluate(heights), page.evaluate(shown)
    assert judged[1] == pytest.approx(20.0)
    assert max(map(abs, last)) == pytest.approx(1e3 * abs(np.sin(9.0)), rel=1e-5)
    page.focus("#instant")
    page.keyboard.press("Home")
    for _ in range(4):
        page.keyboard.press("ArrowRight")
    assert page.inner_text("#clock") == "4.0000 s"
    page.evaluate("page.figures.forEach(moveFigure)")
    assert page.evaluate(heights) != last
    assert max(map(abs, page.evaluate(heights))) == pytest.approx(1e3 * abs(np.sin(4.0)), rel=1e-5)
    assert max(page.evaluate(shown)) == 0.0
    lines = page.evaluate("page.figures.filter(f => f.timed).map(f => f.div.layout.shapes[0].x0)")
    assert lines == [4.0] * len(lines)
    page.select_option("#sensor", "2")
    page.evaluate(
        "Plotly.relayout(page.figures.filter(f => f.timed)[0].div, {'xaxis.range[0]': 1, 'xaxis.range[1]': 3})"
    )
    page.wait_for_function("page.figures.filter(f => f.timed).every(f => f.div.layout.xaxis.range[1] === 3)")
    assert troubles == []
    page.close()


def test_a_membrane_on_a_mesh_moves_with_the_slider_in_every_colour(browser, data, tmp_path):
    data = data.drop_vars("membrane.w")
    half = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.0, 0.0]])
    surface = Surface(
        nodes=half,
        faces=np.array([[0, 1, 2, 3], [1, 4, 2, -1]]),
        element=np.arange(2),
        region=np.zeros(2, dtype=int),
        zone=np.arange(2),
        poisson_ratio=np.array([0.3]),
        direction=np.array([[1.0, 0.0, 0.0]]),
        sensor_points=np.array([[0.1, 0.1, 0.0]]),
        sensor_directions=np.array([[1.0, 0.0, 0.0]]),
    )
    moved = half * [0.99, 0.8, 1.0] + [0.0, 0.0, 0.5]  # shorter along both: slack
    file = create_shapes(tmp_path / "shapes.nc", {"membrane": surface}, 0.0, {"membrane": (half, np.zeros((1, 3)))})
    file.append(np.concatenate([[9.0], moved.ravel(), np.zeros(3)])[None])
    file.close()
    (tmp_path / "messages.txt").write_text("warning: the membrane <is> strange\n", encoding="utf-8")
    troubles: list[str] = []
    page = opened(browser, write_report(data, tmp_path).as_uri(), troubles, viewport={"width": 1400, "height": 900})
    assert "warning: the membrane <is> strange" in page.inner_text(".messages")
    membrane = "page.figures.find(each => each.title === 'Membrane').div"
    skin = f"{membrane}.data[0]"
    assert page.evaluate(f"Array.from({skin}.z)") == pytest.approx([0.5] * 5)
    assert page.evaluate(f"{membrane}.data[5].x.length") == 2  # both faces are marked
    for choice, top in (("strain", -0.01), ("mark", 2.0), ("estimated", 20.0), ("true", 30.0)):
        page.select_option("[aria-label='Colour of the membrane']", choice)
        page.wait_for_function(f"{skin}.intensitymode === 'cell' && {skin}.intensity.length === 3")
        page.wait_for_function(f"Math.abs(Math.max(...{skin}.intensity) - {top}) < 1e-4")
    page.focus("#instant")
    page.keyboard.press("Home")
    page.evaluate("page.figures.forEach(moveFigure)")
    assert page.evaluate(f"Array.from({skin}.z)") == [0.0] * 5
    assert page.evaluate(f"{membrane}.data[5].x.length") == 0
    assert troubles == []
    page.close()


@pytest.mark.parametrize(("width", "scheme"), [(1400, "dark"), (400, "light")])
def test_the_page_fits_wide_and_narrow_windows_in_light_and_dark(browser, report, tmp_path, width, scheme):
    troubles: list[str] = []
    page = opened(browser, report, troubles, viewport={"width": width, "height": 900}, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == (
        "rgb(20, 24, 29)" if scheme == "dark" else "rgb(255, 255, 255)"
    )
    page.screenshot(path=tmp_path / f"{width}_{scheme}.png", full_page=True, timeout=PATIENCE)
    assert troubles == []
    page.close()


def test_without_deflections_the_membrane_is_flat_and_says_so(browser, data, tmp_path):
    troubles: list[str] = []
    page = opened(browser, write_report(data.drop_vars("membrane.w"), tmp_path).as_uri(), troubles)
    assert "are not recorded, so it is drawn flat" in page.inner_text("figure:has-text('Membrane')")
    assert troubles == []
    stranger = xr.Dataset({"a.y": ("time", [0.0, 1.0])}, coords={"time": [0.0, 1.0]})
    page = opened(browser, write_report(stranger, tmp_path).as_uri(), troubles)
    assert page.locator("figure").count() == 1
    assert troubles == []

"""The page of a run in a real browser, as its reader sees it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from browsing import PATIENCE, opened
from gossamer_orchestrator.fmi.shape import Surface
from gossamer_orchestrator.results.report import write_report
from gossamer_orchestrator.results.shapes import create_shapes


def test_the_slider_moves_every_picture_and_nothing_is_amiss(page):
    assert page.inner_text("#verdict").startswith("Damaged: zone 2 lost 20.0\xa0±\xa01.6\xa0% of its stiffness")
    assert page.locator("figure").count() == 11
    contents = page.locator("nav a").all_inner_texts()
    assert contents[0] == "Damage"
    assert page.evaluate(
        "[...document.querySelectorAll('nav a')].every((a) => document.querySelector(a.getAttribute('href')))"
    )
    assert page.inner_text("#clock") == "9.0000 s"
    heights = "() => Array.from(page.figures.find(each => each.title === 'Membrane').div.data[0].z)"
    zones = "page.figures.find(each => each.title === 'Damage of the zones [%]')"
    shown = f"() => {zones}.div.data[0].z.flatMap((each) => Array.from(each))"
    last, judged = page.evaluate(heights), page.evaluate(shown)
    assert judged[1] == pytest.approx(20.0)
    assert max(map(abs, last)) == pytest.approx(abs(np.sin(9.0)), rel=1e-5)
    page.focus("#instant")
    page.keyboard.press("Home")
    for _ in range(4):
        page.keyboard.press("ArrowRight")
    assert page.inner_text("#clock") == "4.0000 s"
    page.evaluate("page.figures.forEach(moveFigure)")
    assert page.evaluate(heights) != last
    assert max(map(abs, page.evaluate(heights))) == pytest.approx(abs(np.sin(4.0)), rel=1e-5)
    assert max(page.evaluate(shown)) == 0.0
    lines = page.evaluate("page.figures.filter(f => f.timed).map(f => f.div.layout.shapes[0].x0)")
    assert lines == [4.0] * len(lines)
    page.select_option("#choice", index=2)
    page.evaluate("Plotly.relayout(page.figures.filter(f => f.timed)[0].div, {'xaxis.range[0]': 1, 'xaxis.range[1]': 3})")
    page.wait_for_function("page.figures.filter(f => f.timed).every(f => f.div.layout.xaxis.range[1] === 3)")


def test_a_judgement_that_is_not_valid_is_grey_says_so_and_calls_no_zone_damaged(
    browser, data, later_window_invalid, tmp_path
):
    data["detector.deviation"] = (data["detector.damage"].dims, np.full((10, 16), 0.2))
    data["detector.damage"][4:, 1] = 0.1
    data["detector.damage"][8:, 2:14] = 0.8
    troubles: list[str] = []
    address = write_report(later_window_invalid(data), tmp_path).as_uri()
    page = opened(browser, address, troubles, viewport={"width": 1400, "height": 900})
    named = "page.figures.find(each => each.title.startsWith('{}')).div"
    zones, bars, membrane, history = (
        named.format(title) for title in ("Damage of the zones", "Damage of each", "Membrane", "Damage over time")
    )
    words, grey = ("{}.data.flatMap(each => each.text || []).filter(each => each.includes('valid'))", "theme().unsure[1][1]")
    for instant, said in (("page.content.frames.length - 1", ["<b>not valid</b>"]), ("5", [])):
        page.evaluate(f"setInstant({instant})")
        page.evaluate("page.figures.forEach(moveFigure)")
        assert page.evaluate(words.format(zones)) == page.evaluate(words.format(bars)) == said
        assert page.evaluate(f"{zones}.data[0].colorscale.at(-1)[1] === {grey}") == bool(said)
        assert page.evaluate(f"{bars}.data[0].error_y.array.some(each => each > 0)") != bool(said)
        assert page.evaluate(f"{membrane}.data[2].x.length > 0") != bool(said)
    assert page.evaluate(f"{history}.data.map(each => each.name).filter(each => each.includes('zone'))") == [
        "zone 2 ± 2 deviations",
        "zone 2 ± 2 deviations",
        "zone 2",
        "zone 2, true",
    ]
    low, high, line = (page.evaluate(f"Array.from({history}.data[{k}].y, each => each || 0)") for k in (1, 2, 3))
    assert low == [0.0] * 8
    assert high == pytest.approx([0.0, 50.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert line == pytest.approx([0.0, 10.0, 10.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    page.select_option("[aria-label='Colour of the membrane']", "estimated damage")
    page.wait_for_function(f"{membrane}.data[0].colorbar.title.text === '%'")
    page.evaluate("setInstant(page.content.frames.length - 1)")
    page.evaluate("page.figures.forEach(moveFigure)")
    page.wait_for_function(f"{membrane}.data[0].colorbar.title.text === '%, not valid'")
    assert page.evaluate(f"{membrane}.data[0].colorscale.at(-1)[1] === {grey}")
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
        segments=np.array([[3, 2], [2, 4]]),
        segment_zone=np.array([-1, -1]),
    )
    moved = half * [0.99, 0.8, 1.0] + [0.0, 0.0, 0.5]  # shorter along both: slack
    file = create_shapes(tmp_path / "shapes.nc", {"membrane": surface}, 0.0, {"membrane": (half, np.zeros((1, 3)))})
    file.append(np.concatenate([[9.0], moved.ravel(), np.zeros(3)])[None])
    (tmp_path / "messages.txt").write_text("warning: the membrane <is> strange\n", encoding="utf-8")
    troubles: list[str] = []
    page = opened(browser, write_report(data, tmp_path).as_uri(), troubles, viewport={"width": 1400, "height": 900})
    assert "warning: the membrane <is> strange" in page.inner_text(".messages")
    membrane = "page.figures.find(each => each.title === 'Membrane').div"
    skin = f"{membrane}.data[0]"
    assert page.evaluate(f"Array.from({skin}.z)") == pytest.approx([0.5] * 5)
    assert page.evaluate(f"{membrane}.data[6].x.length") == 2  # both faces are marked
    ropes = f"Object.values({membrane}.data.find(each => each.name === 'cables and beams').{{}}).slice(0, 5)"
    assert page.evaluate(ropes.format("x")) == pytest.approx([0.0, 0.99, None, 0.99, 1.98])
    assert page.evaluate(ropes.format("z")) == pytest.approx([0.508, 0.508, None, 0.508, 0.508])  # lifted, to be seen
    assert page.locator(".legend").get_by_text("cables and beams").count() == 1
    for choice, top in (("largest strain", -1.0), ("wrinkles", 2.0), ("estimated damage", 20.0), ("true damage", 30.0)):
        page.select_option("[aria-label='Colour of the membrane']", choice)
        page.wait_for_function(f"{skin}.intensitymode === 'cell' && {skin}.intensity.length === 3")
        page.wait_for_function(f"Math.abs(Math.max(...{skin}.intensity) - {top}) < 1e-4")
    page.focus("#instant")
    page.keyboard.press("Home")
    page.evaluate("page.figures.forEach(moveFigure)")
    assert page.evaluate(f"Array.from({skin}.z)") == [0.0] * 5
    assert page.evaluate(ropes.format("z")) == pytest.approx([0.008, 0.008, None, 0.008, 0.008])
    assert page.evaluate(f"{membrane}.data[6].x.length") == 0
    assert troubles == []
    page.close()


def test_the_page_fits_a_wide_window_in_the_dark_and_fills_its_rows(page):
    page.emulate_media(color_scheme="dark")
    assert page.evaluate("document.documentElement.scrollWidth") <= 1400
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(20, 24, 29)"
    boxes = [each.bounding_box() for each in page.locator("figure").all()]
    rows = {box["y"]: [other for other in boxes if other["y"] == box["y"]] for box in boxes}
    for row in rows.values():
        assert sum(box["width"] for box in row) > 0.9 * page.locator("#pictures").bounding_box()["width"]
        assert len({box["height"] for box in row}) == 1


def test_the_page_fits_a_narrow_window_in_light_with_its_tables(browser, report, tmp_path):
    troubles: list[str] = []
    page = opened(browser, report, troubles, viewport={"width": 400, "height": 900}, color_scheme="light")
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    wide = "[...document.querySelectorAll('.columns > .wide')]"
    tables = f"{wide}.map((each) => each.scrollWidth - each.clientWidth)"
    assert page.evaluate(tables) == [0, 0, 0]
    page.screenshot(path=tmp_path / "narrow.png", full_page=True, timeout=PATIENCE)
    page.set_viewport_size({"width": 1400, "height": 900})
    page.evaluate(f"{wide}.forEach((each) => {{ each.querySelector('tbody td').textContent = 'x'.repeat(200) }})")
    fits = f"{wide}.map((each) => each.querySelector('caption')).filter(Boolean).map((each) => each.offsetWidth <= 700)"
    assert page.evaluate(fits) == [True] * 3  # captions of wide tables can be read whole
    assert troubles == []
    page.close()


def test_zones_and_sensors_are_numbered_and_marks_at_the_border_are_whole(page):
    sensors, zones = (page.evaluate(f"page.figures.find(each => each.title === 'Membrane').div.data[{k}]") for k in (4, 5))
    assert sensors["text"] == ["1", "2", "3", "4"]
    assert zones["text"] == [f"{zone}" for zone in range(1, 17)]
    assert sensors["mode"] == zones["mode"] == "markers+text"
    clipped = """page.figures.flatMap((each) => each.div.data)
        .filter((each) => each.type === "scatter" && each.mode.includes("markers") && each.cliponaxis !== false).length"""
    assert page.evaluate(clipped) == 0


def test_what_is_read_lies_over_what_the_sensor_has_and_a_note_says_what_the_band_is(page):
    lines = page.evaluate("page.figures.find(each => each.title === 'Resistance').div.data")
    assert [line["name"] for line in lines] == ["of the sensor", "as read"]
    assert lines[0]["line"]["width"] > 2 * lines[1]["line"]["width"]
    assert "two strain_deviation wide to each side" in page.inner_text("figure:has(strong:text-is('Strain')) small")
    words = "page.figures.find(each => each.title === '{}').div.layout.annotations.map(each => each.text)"
    (left,) = page.evaluate(words.format("Error of the compensated strain"))
    assert left == "0\xa0% of the points leave the band; 5\xa0% would be right"


def test_a_spectrum_has_powers_of_ten_alone_and_few_variables_title_their_panel(browser, tmp_path):
    time = 3e-4 * np.arange(2000.0)
    resistance = 100.0 + 10.0 * np.sin(2.0 * np.pi * 30.0 * time) + np.random.default_rng(1).normal(0.0, 0.01, time.size)
    data = xr.Dataset({"sensor1.resistance": ("time", resistance), "sensor1.strain": ("time", 1e-3 * resistance)})
    data = data.assign_coords(time=time).assign({"a.y": ("time", time), "b.y": ("time", -time)})
    troubles: list[str] = []
    page = opened(browser, write_report(data, tmp_path).as_uri(), troubles)
    ticks = "[...page.figures.find(each => each.title.startsWith('Spectrum')).div.querySelectorAll('.xtick, .ytick')]"
    words = page.evaluate(f"{ticks}.map((each) => each.textContent.replace(/\\u200b/g, '')).filter(Boolean)")
    assert {"100", "101", "102", "103"} <= set(words)  # a power of ten each
    assert all(re.fullmatch(r"10[−\d]+", word) for word in words), words
    assert page.locator("strong:text-is('a.y, b.y')").count() == 1
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


def test_data_that_cannot_be_unpacked_are_said_in_whole_sentences(browser, report, tmp_path):
    text = Path(report.removeprefix("file://")).read_text(encoding="utf-8")
    broken = tmp_path / "broken.html"
    broken.write_text(re.sub(r'(id="data">)[^<]*', r"\1AAAA", text), encoding="utf-8")
    page = browser.new_page()
    page.goto(broken.as_uri())
    page.wait_for_function("document.getElementById('status').textContent.startsWith('The pictures')")
    said = page.inner_text("#status")
    assert re.fullmatch(r"The pictures cannot be drawn: [^.]+(\.[^.]+)*\. The tables below are complete\.", said), said
    page.close()

"""The page of a run for those who wait, use no mouse, do not see it, prefer the dark or paper."""

from __future__ import annotations

from itertools import pairwise

import pytest
from browsing import opened

WIDE = {"width": 1400, "height": 900}
MEMBRANE = "page.figures.find(each => each.title === 'Membrane')"
FIRST = """new MutationObserver(() => { window.first ??= page.figures.map((each) => [inWindow(each), each.drawn]); })
    .observe(document, { subtree: true, attributes: true, attributeFilter: ["data-ready"] });"""
TEXT, LINE = 4.5, 3.0  # contrast that WCAG 2.2 demands, level AA (1.4.3, 1.4.11)


def test_what_the_window_shows_is_drawn_first(browser, report):
    context = browser.new_context(viewport=WIDE)
    context.add_init_script(FIRST)
    page = opened(context, report, [])
    first = page.evaluate("first")
    assert all(drawn for seen, drawn in first if seen)
    assert not all(drawn for _, drawn in first)
    assert page.evaluate("page.figures.every((each) => each.drawn)")
    context.close()


def test_keys_move_a_picture_and_those_linked_with_it(page):
    ranges = "page.figures.filter((each) => each.timed).map((each) => each.div.layout.xaxis.range)"
    page.focus(".plot[aria-label^='Estimated damage of the zones over time']")
    page.keyboard.press("+")
    page.wait_for_function(f"{ranges}.every(([low, high]) => Math.abs(low - 0.9) + Math.abs(high - 8.1) < 1e-6)")
    page.keyboard.press("ArrowRight")
    page.wait_for_function(f"{ranges}.every(([low, high]) => Math.abs(low - 1.62) + Math.abs(high - 8.82) < 1e-6)")
    page.keyboard.press("0")
    page.wait_for_function(f"{ranges}.every(([low, high]) => low === 0 && high === 9)")


def test_keys_turn_the_membrane(page):
    eye = f"{MEMBRANE}.div.layout.scene.camera.eye"
    before = page.evaluate(eye)
    page.focus(".plot[aria-label^='The membrane in three dimensions']")
    page.keyboard.press("ArrowRight")
    turned = page.evaluate(eye)
    assert turned["z"] == pytest.approx(before["z"])
    assert turned["x"] > before["x"] + 0.1
    page.keyboard.press("-")
    assert page.evaluate(eye) == pytest.approx({axis: 1.25 * value for axis, value in turned.items()})
    page.keyboard.press("0")
    assert page.evaluate(eye) == pytest.approx(before)


def test_the_tools_of_a_picture_are_one_stop_of_the_tab_key_and_are_seen(page):
    name = "document.activeElement.getAttribute('aria-label')"
    page.focus(".plot >> nth=0")
    page.keyboard.press("Tab")
    assert page.evaluate(name) == "Download plot as a PNG"
    page.wait_for_function("getComputedStyle(document.activeElement.closest('.modebar')).opacity === '1'")
    page.keyboard.press("ArrowRight")
    assert page.evaluate(name) == "Zoom"
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent").startswith("Numbers of: Damage over time")
    page.keyboard.press("Enter")
    page.wait_for_selector(".numbers[open] td")
    page.focus("#play")
    page.keyboard.press("Enter")
    assert page.inner_text("#play") == "Pause"
    page.keyboard.press("Enter")
    assert page.inner_text("#play") == "Play"


def test_every_picture_has_a_name_and_a_table(page):
    page.evaluate("document.querySelectorAll('.numbers').forEach((each) => { each.open = true; })")
    page.wait_for_function("document.querySelectorAll('.numbers caption').length === page.figures.length")
    for figure in page.locator("figure").all():
        assert figure.locator(".plot").get_attribute("aria-label")
        assert figure.locator("tbody tr").count()
    bars = page.locator("figure:has-text('Damage of each zone') tbody tr").nth(1)
    assert bars.all_inner_texts() == ["2\t20\t3.2\t30"]  # zone, estimated, two deviations, true
    page.focus("#instant")
    page.keyboard.press("Home")
    page.evaluate("page.figures.forEach(moveFigure)")
    assert bars.all_inner_texts() == ["2\t0"]  # not yet judged


def test_headings_and_landmarks_are_in_order_and_tables_have_heads(page):
    levels = page.evaluate("[...document.querySelectorAll('h1, h2, h3')].map((each) => Number(each.tagName[1]))")
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    tree = page.locator("body").aria_snapshot()
    for role in ("banner", "main", 'region "Verdict"', 'form "Time of all pictures"', 'region "What happened"'):
        assert f"- {role}:" in tree
    assert page.get_attribute("html", "lang") == "en"
    heads = "[...document.querySelectorAll('table')].every((each) => each.caption && each.querySelector('th[scope]'))"
    assert page.evaluate(heads)


def luminance(color):
    shares = [int(color[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in shares]
    return sum(weight * share for weight, share in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def contrast(one, other):
    """WCAG 2.2: (L1 + 0.05) / (L2 + 0.05) of the relative luminances, the larger above."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_words_and_lines_stand_out(page, scheme):
    page.emulate_media(color_scheme=scheme)
    names = ("ink", "soft", "paper", "panel", "accent", "alarm", "fine", "unsure")
    find = "name => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`)"
    css = {name: page.evaluate(find, name) for name in names}
    for ground in (css["paper"], css["panel"]):
        assert min(contrast(css[name], ground) for name in ("ink", "soft")) >= TEXT
        assert min(contrast(css[name], ground) for name in ("accent", "alarm", "fine", "unsure")) >= LINE
    colors = page.evaluate("theme()")
    assert colors["panel"] == css["panel"]
    assert colors["dark"] is (scheme == "dark")
    assert contrast(colors["ink"], colors["panel"]) >= TEXT
    assert min(contrast(line, colors["panel"]) for line in (*colors["lines"], colors["grey"], colors["alarm"])) >= LINE


def test_paper_is_white_has_all_pictures_and_cuts_none(page):
    widths = "page.figures.map((each) => [each.div.clientWidth, Math.round(each.div._fullLayout.width)])"
    page.emulate_media(color_scheme="dark")
    before = page.evaluate(widths)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    for room, width in page.evaluate(widths):
        assert width == room <= 180 / 25.4 * 96
    inks = page.evaluate("page.figures.map((each) => each.div.layout.font.color)")
    assert set(inks) == {"#1b2026"}
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.evaluate(widths) == before
    assert set(page.evaluate("page.figures.map((each) => each.div.layout.font.color)")) == {"#e6eaee"}
    page.emulate_media(media="print")
    assert page.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--paper')") == "#ffffff"

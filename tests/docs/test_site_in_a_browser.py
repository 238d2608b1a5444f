"""The site in a real browser, opened from disk: the membrane moves, the search finds, nothing is amiss."""

import shutil
from pathlib import Path

import pytest

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # 3-D without a graphics card
PATIENCE = 120_000  # [ms]


@pytest.fixture(scope="module")
def page(site):
    with sync_api.sync_playwright() as driver:
        program = next(filter(None, map(shutil.which, NAMES)), driver.chromium.executable_path)
        if not Path(program).is_file():
            pytest.skip("there is no Chromium here; 'apt install chromium' or 'playwright install chromium' has one")
        browser = driver.chromium.launch(executable_path=program, args=FLAGS, timeout=PATIENCE)
        page, troubles = browser.new_page(viewport={"width": 1400, "height": 1000}), []
        page.on("console", lambda message: message.type == "error" and troubles.append(message.text))
        page.on("pageerror", lambda error: troubles.append(str(error)))
        page.on("request", lambda request: request.url.startswith("http") and troubles.append(request.url))
        page.goto((site / "index.html").as_uri(), timeout=PATIENCE)
        yield page
        assert not troubles
        browser.close()


def test_the_membrane_moves_until_it_is_stopped(page):
    heights = "() => document.querySelector('#membrane').data[0].z[4][4]"
    first = page.wait_for_function("() => document.querySelector('#membrane').data?.[0].z[4][4]", timeout=PATIENCE)
    page.wait_for_function(f"(before) => ({heights})() !== before", arg=first.json_value(), timeout=PATIENCE)
    page.get_by_role("button", name="Pause").click(timeout=PATIENCE)
    page.get_by_role("button", name="Play").wait_for(timeout=PATIENCE)
    stopped = page.evaluate(heights)
    page.wait_for_timeout(500)
    assert page.evaluate(heights) == stopped


def test_the_search_finds_pages_without_a_server(page):
    page.locator("input[name=query]").press_sequentially("stretched exponential", timeout=PATIENCE)
    results = page.locator("a.md-search-result__link")
    results.first.wait_for(state="attached", timeout=PATIENCE)
    addresses = [each.get_attribute("href") for each in results.all()]
    assert any("fmus/sensor/index.html" in address or "gossamer_models.modes" in address for address in addresses), addresses

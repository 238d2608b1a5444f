"""Open a page of results in a browser, as its reader does."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # 3-D without a graphics card
PATIENCE = 120_000  # [ms]


@contextmanager
def launched() -> Iterator[object]:
    """Start a browser without a window; skip the test where there is none."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with sync_api.sync_playwright() as driver:
        program = next(filter(None, map(shutil.which, NAMES)), driver.chromium.executable_path)
        if not Path(program).is_file():
            pytest.skip("there is no Chromium here; 'apt install chromium' or 'playwright install chromium' has one")
        browser = driver.chromium.launch(executable_path=program, args=FLAGS)
        yield browser
        browser.close()


def opened(browser, url, troubles, **settings):
    """Open a page and wait until all is drawn; list what it complains about and what it asks for."""
    page = browser.new_page(**settings)
    page.set_default_timeout(PATIENCE)
    page.on("console", lambda message: message.type == "error" and troubles.append(message.text))
    page.on("pageerror", lambda error: troubles.append(str(error)))
    page.on("request", lambda request: request.url.startswith("http") and troubles.append(request.url))
    page.goto(url)
    page.wait_for_selector("body[data-ready=all]", state="attached")
    return page

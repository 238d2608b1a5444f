"""Time until a page of a run of ten minutes, two million rows, is written, can be read, and can be used."""

from __future__ import annotations

import time

import pytest
from browsing import launched, opened
from gossamer_orchestrator.results.report import write_report
from long_run import long_run

TARGET = 2.0  # [s] until what the window shows is drawn
ROUNDS = 5
TIMES = """() => Object.fromEntries([...performance.getEntriesByType("paint"), ...performance.getEntriesByType("mark")]
    .map((each) => [each.name, each.startTime / 1000]))"""


@pytest.mark.parametrize(("width", "height"), [(1400, 900), (400, 800)])
def test_a_page_of_ten_minutes_opens(tmp_path, measured, width, height):
    """Each round starts a browser; the least counts, for others may use the machine. 3-D is drawn by software."""
    begin = time.perf_counter()
    page = write_report(long_run() if measured else long_run(2000), tmp_path)
    written, found = time.perf_counter() - begin, []
    for _ in range(ROUNDS if measured else 1):
        with launched() as browser:
            found.append(opened(browser, page.as_uri(), [], viewport={"width": width, "height": height}).evaluate(TIMES))
    words, window, rest = (min(each[name] for each in found) for name in ("first-contentful-paint", "window", "all"))
    size = page.stat().st_size / 1e6
    print(f"\na page of 2e6 rows: made and written in {written:.1f} s, {size:.1f} MB; {width} pixels wide:")
    print(f"words after {words:.2f} s, the window after {window:.2f} s (target {TARGET:g} s), all after {rest:.2f} s")

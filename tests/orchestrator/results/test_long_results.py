"""Results that are longer than memory are read in pieces, and their files are closed."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from gossamer_orchestrator import load_results
from gossamer_orchestrator.results.dataset import SCHEMA, VERSION, RecordedScalar
from gossamer_orchestrator.results.netcdf import GrowingFile, make_file
from gossamer_orchestrator.results.readers import Times
from gossamer_orchestrator.results.report.page import run_page

ROWS, STEP = 1_500_000, 1e-3


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    """Folder with a results file of 36 MB, which stays on the disk: time, a signal and a constant."""
    folder = tmp_path_factory.mktemp("long")
    header, layout = make_file(
        [RecordedScalar("a.x", "m", "a place"), RecordedScalar("a.c", "1", "a constant")],
        {"schema": SCHEMA, "version": VERSION, "fmus": "{}", "connections": "[]"},
    )
    (folder / "results.nc").write_bytes(header)
    file = GrowingFile(folder / "results.nc", layout)
    time = STEP * np.arange(ROWS)
    file.append(np.column_stack([time, np.sin(time), np.full(ROWS, 3.0)]))
    file.end("complete", 1.0)
    return folder


ROWS_OF = {
    "all": slice(None),
    "every seventh": slice(3, 1_400_000, 7),
    "backwards": slice(None, None, -1),
    "backwards, some": slice(900_000, 100, -13),
    "none": slice(5, 5),
    "one": 5,
    "the last": -1,
    "a few": np.array([3, ROWS - 1, 7, 7]),
    "spread": np.arange(0, ROWS, 50_000),
    "an empty list": np.array([], dtype=int),
}


@pytest.mark.parametrize("rows", ROWS_OF)
def test_any_rows_are_those_that_were_written(long, rows):
    data, rows = load_results(long), ROWS_OF[rows]
    time = STEP * np.arange(ROWS)
    assert np.array_equal(data["time"][rows].to_numpy(), time[rows])
    assert np.array_equal(data["a.x"][rows].to_numpy(), np.sin(time)[rows])


@pytest.fixture(scope="module")
def matrices(tmp_path_factory):
    """Results of 22 MB, which stay on the disk: 3 x 3 values a row; and those values."""
    path = tmp_path_factory.mktemp("matrices") / "results.nc"
    columns = [RecordedScalar(f"a.w[{i},{j}]", "m", "a matrix") for i in (1, 2, 3) for j in (1, 2, 3)]
    header, layout = make_file(columns, {"schema": SCHEMA, "version": VERSION, "fmus": "{}", "connections": "[]"})
    path.write_bytes(header)
    file, values = GrowingFile(path, layout), np.arange(9.0 * 280_000).reshape(-1, 9)
    file.append(np.column_stack([STEP * np.arange(len(values)), values]))
    file.end("complete", 1.0)
    return load_results(path)["a.w"], xr.DataArray(values.reshape(-1, 3, 3))


PLACES_OF = {
    "one row, some columns": (5, slice(None), [2, 0]),
    "one row, some of both": (-1, [0, 2], [2, 0]),
    "some rows, one place": ([7, 3], 1, [2, 0]),
    "rows, and one place of the last": (slice(2, 9), [2, 0], 1),
    "one value": (5, 1, 2),
}


@pytest.mark.parametrize("which", PLACES_OF)
def test_axes_keep_their_order_whatever_is_taken_of_each(matrices, which):
    data, in_memory = matrices
    assert data[PLACES_OF[which]].to_numpy().tolist() == in_memory[PLACES_OF[which]].to_numpy().tolist()


def test_times_that_stay_on_the_disk_answer_as_those_in_memory_do(long):
    times, time = Times(load_results(long)), STEP * np.arange(ROWS)
    asked = [-1.0, 0.0, 20.0, 20.0005, 777.0, 1e9]
    assert times.first_from(asked).tolist() == np.searchsorted(time, asked).tolist()
    assert int(times.first_from(1.0)) == 1000
    assert len(times) == ROWS
    assert times[-1] == time[-1]
    assert times.are_even()


def test_a_page_needs_memory_for_a_part_of_the_rows_only(long):
    data = load_results(long)
    tracemalloc.start()
    try:
        page = run_page(data, long)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 8 * ROWS  # less than one column
    assert any("3" in fact and "a.c" in fact for fact in page.facts)


def count_open():
    return len(list(Path("/proc/self/fd").iterdir()))


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="counts the open files of the process on Linux")
def test_files_are_closed_when_their_results_are_gone_or_closed(long):
    before = count_open()
    for _ in range(5):
        assert load_results(long)["a.x"][0] == 0.0
    assert count_open() == before
    with load_results(long) as data:
        assert count_open() == before + 1
    assert count_open() == before
    del data


def test_results_that_stay_on_the_disk_can_be_copied_as_a_whole(long):
    data = load_results(long)
    other = data.copy(deep=True)
    del data
    assert other["a.x"][5].to_numpy() == np.sin(5 * STEP)

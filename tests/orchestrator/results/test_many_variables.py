"""Results of very many variables: what is done for them grows with their number, not with its square."""

from __future__ import annotations

import cProfile
import pstats
import subprocess
import sys
from contextlib import suppress

import numpy as np
import pytest
import xarray as xr
from gossamer_orchestrator.errors import ResultsError
from gossamer_orchestrator.results import files
from gossamer_orchestrator.results.dataset import RecordedScalar, arrange
from gossamer_orchestrator.results.files import load_results, save_csv
from gossamer_orchestrator.results.netcdf import GrowingFile, make_file
from gossamer_orchestrator.results.report import run_page
from scipy.io import netcdf_file


def scalars(count):
    return [RecordedScalar(f"a.y_{k}", "m", f"output {k}", "wide") for k in range(count)]


def write(folder, columns, **more):
    header, layout = make_file(columns, {"schema": "gossamer.results", "version": 1, "step": 0.1, "title": "Größe", **more})
    path = folder / "results.nc"
    path.write_bytes(header)
    file = GrowingFile(path, layout)
    file.append(np.column_stack([np.arange(3.0), *(np.arange(3.0) + k for k in range(len(columns)))]))
    file.end("complete", 1.5, (0, 2))
    return path


def calls_of(work):
    """Return how many functions a piece of work calls."""
    profile = cProfile.Profile()
    profile.runcall(work)
    return pstats.Stats(profile).total_calls


@pytest.mark.parametrize("what", ["write", "csv", "page"])
def test_twice_as_many_variables_take_twice_as_many_calls(tmp_path, what):
    def work(count):
        if what == "write":
            return lambda: write(tmp_path, scalars(count))
        data = load_results(write(tmp_path, scalars(count)))
        return (lambda: save_csv(data, tmp_path)) if what == "csv" else (lambda: run_page(data, tmp_path))

    work(10)()  # what is imported once
    few, many, most = (calls_of(work(count)) for count in (300, 600, 1200))
    assert most - many < 2.2 * (many - few)


def test_another_reader_finds_what_was_written(tmp_path):
    columns = [*scalars(2), *(RecordedScalar(f"b.w[{i},2]", "Pa", "", "grid") for i in (1, 2))]
    path = write(tmp_path, columns, scenario="")
    with netcdf_file(path, mmap=False) as file:
        assert (file.title.decode(), file.version, file.ended.rstrip(b"\0")) == ("Größe", 1, b"complete")
        assert file.variables["b.w"][:].tolist() == [[[2.0], [3.0]], [[3.0], [4.0]], [[4.0], [5.0]]]
    table = np.arange(3.0)[:, None] + np.arange(4.0)
    with xr.open_dataset(path, engine="scipy") as data:
        assert arrange(np.arange(3.0), table, columns).identical(data.load().drop_attrs(deep=False))


@pytest.mark.parametrize("word", ["ended", "effort", "not_finite", "wall_time"])
def test_a_title_that_reads_like_an_attribute_harms_no_results(tmp_path, word):
    """The places of what is written at the end are known, not searched for."""
    path = write(tmp_path, scalars(1), title=word, scenario=word)
    with xr.open_dataset(path, engine="scipy", decode_times=False) as data:
        assert (data.attrs["title"], data.attrs["scenario"], data.attrs["ended"]) == (word, word, "complete")
        assert data.attrs["divided_steps"] == 2


def test_results_that_stay_on_the_disk_are_those_that_were_opened(tmp_path, monkeypatch):
    path = write(tmp_path, [*scalars(2), *(RecordedScalar(f"b.w[{i},2]", "Pa", "", "grid") for i in (1, 2))], scenario="")
    whole = load_results(path)
    monkeypatch.setattr(files, "_LOADED", 0)
    there = load_results(path)
    path.replace(tmp_path / "moved.nc")
    path.write_bytes(b"another one")
    for rows in (slice(None), slice(2, None, -2), [0, 2], -1):
        assert there.isel(time=rows).load().identical(whole.drop_indexes([*whole.indexes]).isel(time=rows))


def test_a_damaged_file_is_refused_or_read_whatever_byte_is_wrong(tmp_path):
    """A header of any content made the reader of netCDF fail in many ways."""
    path = write(tmp_path, scalars(2), connections="[]", fmus='{"a": {}}', versions="{}")
    whole, random = path.read_bytes(), np.random.default_rng(5)
    for place in random.integers(0, len(whole), 500):
        path.write_bytes(whole[:place] + random.bytes(1) + whole[place + random.integers(1, 5) :])
        with suppress(ResultsError):
            load_results(path).close()
    path.write_bytes(whole.replace(b'{"a": {}}', b'{"a": \1}}'))
    with pytest.raises(ResultsError, match=r"cannot read results from .*results.nc: .* Run the scenario again"):
        load_results(path)


def test_a_name_with_a_line_feed_is_read_from_a_table_again(tmp_path):
    columns = [RecordedScalar("a.x\ny", "m", "", ""), RecordedScalar('a."z", w', "1", "", "")]
    save_csv(arrange(np.arange(3.0), np.ones((3, 2)), columns), tmp_path)
    found = load_results(tmp_path / "results.csv")
    assert list(found.data_vars) == ["a.x\ny", 'a."z", w']
    assert found["time"].values.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.skipif(sys.platform != "linux", reason="of /proc")
def test_results_that_stay_on_the_disk_take_memory_for_a_part_of_them_only(tmp_path):
    header, layout = make_file(scalars(6), {"schema": "gossamer.results", "version": 1, "step": 0.1})
    path = tmp_path / "results.nc"
    path.write_bytes(header)
    file = GrowingFile(path, layout)
    for first in range(0, 2_000_000, 100_000):
        file.append(np.column_stack([first + np.arange(1e5), *np.ones((6, 100_000))]))
    file.end("complete", 1.5, (0, 0))
    code = (
        "from pathlib import Path; import numpy as np, sys; from gossamer_orchestrator.results.files import load_results\n"
        "def peak(): return int(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0]) / 1e3\n"
        "load_results(Path(sys.argv[1])).close(); before = peak(); data = load_results(Path(sys.argv[1]))\n"
        "sums = [float(data['a.y_5'][k : k + 100_000].sum()) for k in range(0, 2_000_000, 100_000)]\n"
        "print(sum(sums), peak() - before)"
    )
    total, grown = map(
        float, subprocess.run([sys.executable, "-c", code, path], check=True, capture_output=True).stdout.split()
    )
    assert total == 2e6
    assert grown < 40.0  # [MB], of a file of 112

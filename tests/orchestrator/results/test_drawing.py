"""Processes that draw beside a run: the same pictures, every failure in words, and nothing left of them."""

from __future__ import annotations

import pytest
from gossamer_orchestrator import ResultsError
from gossamer_orchestrator.results.drawing import SHARES, Drawing
from gossamer_orchestrator.results.files import NETCDF, save_results
from gossamer_orchestrator.results.plots import save_pictures


@pytest.fixture
def folder(data, tmp_path):
    save_results(data.assign_attrs(schema="gossamer.results", version=1), tmp_path / "out")
    return tmp_path / "out"


def ended(drawing):
    return [process.poll() is not None for process in drawing._processes] == [True] * len(SHARES)


def test_they_draw_the_same_pictures_as_one_process(data, folder, tmp_path):
    with Drawing() as drawing:
        drawing.begin(folder, 1)
        beside = {path.name: path.read_bytes() for path in drawing.finish()}
    assert beside == {path.name: path.read_bytes() for path in save_pictures(data, tmp_path / "here")}
    assert len(beside) == 5
    assert ended(drawing)


def test_they_end_with_a_run_that_has_no_results():
    with pytest.raises(KeyboardInterrupt), Drawing() as drawing:
        raise KeyboardInterrupt
    assert ended(drawing)


def test_a_picture_that_is_missing_is_an_error(folder):
    (folder / NETCDF).write_bytes(b"CDF")
    with Drawing() as drawing:
        drawing.begin(folder, 1)
        with pytest.raises(ResultsError, match=r"^Pictures are missing: cannot read results from .*gossamer plot"):
            drawing.finish()
    with Drawing() as drawing:
        drawing._processes[0].kill()
        drawing.begin(folder, 1)
        with pytest.raises(ResultsError, match="a process that draws them ended with exit code"):
            drawing.finish()

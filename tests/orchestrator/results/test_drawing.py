"""Processes that draw beside a run: the same pictures, every failure in words, and nothing left of them."""

from __future__ import annotations

import json
import logging
import re
import subprocess
import sys

import pytest
from gossamer.runs import draw
from gossamer_orchestrator import ResultsError
from gossamer_orchestrator.results.drawing import SHARES, Drawing
from gossamer_orchestrator.results.files import NETCDF
from gossamer_orchestrator.results.report import save_pictures
from gossamer_orchestrator.results.report.pictures import PICTURES
from saving import save_results


@pytest.fixture
def folder(data, tmp_path):
    save_results(data.assign_attrs(schema="gossamer.results", version=1), tmp_path / "out")
    return tmp_path / "out"


def ended(drawing):
    return [process.poll() is not None for process in drawing._processes] == [True] * len(SHARES)


def test_they_draw_the_same_pictures_as_one_process(data, folder, tmp_path):
    with Drawing(folder) as drawing:
        drawing.begin(1)
        beside = {path.name: path.read_bytes() for path in drawing.finish()}
    assert beside == {path.name: path.read_bytes() for path in save_pictures(data, tmp_path / "here")}
    assert len(beside) == 5
    assert ended(drawing)


def test_this_process_draws_those_of_a_long_run(data, folder, monkeypatch):
    monkeypatch.setattr("gossamer_orchestrator.results.files._LOADED", (folder / NETCDF).stat().st_size - 1)
    with Drawing(folder) as drawing:
        drawing.get_ready()
        drawing.begin(1)
        assert drawing._processes == []
        assert len(drawing.finish()) == 5
        (folder / NETCDF).write_bytes(bytes(1000))
        monkeypatch.setattr("gossamer_orchestrator.results.drawing.LONG", 0.0)
        drawing.begin(1)
        assert (drawing._processes, drawing.finish()) == ([], [])


def test_this_process_draws_where_no_other_can_be_started(folder, monkeypatch):
    def refused():
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("gossamer_orchestrator.results.drawing._start", refused)
    with Drawing(folder) as drawing:
        drawing.get_ready()
        drawing.begin(1)
        assert len(drawing.finish()) == 5


def test_they_end_with_a_run_that_has_no_results(tmp_path):
    drawing = Drawing(tmp_path)
    drawing.get_ready()
    with pytest.raises(KeyboardInterrupt), drawing:
        raise KeyboardInterrupt
    assert ended(drawing)


def test_they_say_nothing_where_the_run_was_killed_while_they_draw(folder):
    """Nobody reads what they report; the pictures are whole all the same."""
    code = f"from pathlib import Path; d = Drawing(Path({str(folder)!r})); d.begin(1); os._exit(1)"
    program = f"import os\nfrom gossamer_orchestrator.results.drawing import Drawing\n{code}"
    killed = subprocess.run([sys.executable, "-c", program], stderr=subprocess.PIPE, text=True, check=False)
    assert killed.stderr == ""  # read until they have ended
    assert len(list(folder.glob("*.png"))) == 5


def test_what_goes_wrong_in_a_process_is_a_warning(folder, caplog):
    (folder / NETCDF).write_bytes(b"CDF")
    with Drawing(folder) as drawing:
        drawing.begin(1)
        assert drawing.finish() == []
    (warning,) = caplog.messages
    assert re.match(r"^pictures are missing: cannot read results from .*gossamer plot", warning)


def test_what_a_killed_process_had_not_begun_another_draws(folder, caplog, monkeypatch):
    with Drawing(folder) as drawing:
        drawing.get_ready()
        drawing._processes[1].kill()
        drawing.begin(1)
        assert len(drawing.finish()) == 5
    assert caplog.messages == []
    with Drawing(folder) as drawing:  # one that is killed by its first picture, and another in its place
        code = f"print({json.dumps(json.dumps({'begun': str(folder / 'sensors.png')}))}); raise SystemExit(9)"
        drawing.get_ready()
        with drawing._processes[1] as first:
            first.kill()
        drawing._processes[1] = subprocess.Popen(
            [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        drawing.begin(1)
        assert {path.stem for path in drawing.finish()} == {"strains", "deflection", "damage", "damage_history"}
    (warning,) = caplog.messages
    assert f"{folder / 'sensors.png'} ended the process that drew it, with exit code 9." in warning


def test_a_picture_that_fails_is_named_and_the_others_are_drawn(folder, caplog):
    (folder / "damage.png").mkdir()  # in the way
    with Drawing(folder) as drawing:
        drawing.begin(1)
        assert {path.stem for path in drawing.finish()} == {"strains", "sensors", "deflection", "damage_history"}
    (warning,) = caplog.messages
    assert warning.startswith(f"pictures are missing: cannot write {folder / 'damage.png'}: ")


def test_gossamer_plot_draws_the_others_and_then_says_which_picture_failed(data, tmp_path, monkeypatch):
    monkeypatch.setitem(PICTURES, "deflection", lambda _: 1 / 0)
    with pytest.raises(ResultsError, match=r"deflection.png was not drawn: ZeroDivisionError: division by zero\.$"):
        save_pictures(data, tmp_path)
    assert {path.stem for path in tmp_path.iterdir()} == {"strains", "sensors", "damage", "damage_history"}


def test_a_page_that_fails_is_a_warning_too_and_keeps_no_picture_from_being_drawn(data, folder, caplog):
    (folder / "report.html").mkdir()  # in the way
    with Drawing(folder) as drawing:
        assert len(draw(drawing, data, folder)) == 5
    ((_, level, text),) = caplog.record_tuples
    assert level == logging.WARNING
    assert text.startswith(f"{folder / 'report.html'} was not written: ResultsError: cannot write")

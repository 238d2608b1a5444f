"""Pictures of fits name what they show, and no label covers another."""

from __future__ import annotations

import numpy as np
import pytest
from gossamer_files.plots import draw, save_charts
from gossamer_models.fitting import Columns, read_record
from gossamer_models.plots import ModelledRecord, quantity, record_files
from gossamer_models.replay import Recovered
from gossamer_models.sensor import SensorArtifact, default_artifact
from gossamer_models.sensor.plots import constant_eta, sensor_files
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


def record(folder, heading, columns=None):
    path = folder / "record.csv"
    path.write_text(f"time [s],strain [1],{heading}\n" + "".join(f"{k},{0.01 * k},{100 + k}\n" for k in range(9)))
    return read_record(path, columns)


@pytest.mark.parametrize(
    ("heading", "unit", "label"),
    [
        ("R [kohm]", None, "resistance [ohm]"),
        ("R", None, "resistance [unit not stated]"),
        ("R", "1", "signal [1]"),
        ("r [%]", None, "signal [1]"),
    ],
)
def test_only_a_stated_ratio_is_a_signal_and_a_unit_that_is_not_stated_is_not_made_up(tmp_path, heading, unit, label):
    assert quantity(record(tmp_path, heading, Columns(resistance_unit=unit))) == label


def test_a_fit_is_drawn_in_any_form_and_with_the_same_bytes_again(tmp_path):
    measured = record(tmp_path, "R [ohm]")
    rows = measured.time < 5.0
    found = {"inverse": Recovered(strain=measured.strain, present=measured.strain)}
    own = ModelledRecord(record=measured, predicted=measured.resistance, recovered=found, first=rows)
    pictures = record_files(own)
    assert list(pictures) == [f"record_{name}" for name in ("loop", "history", "residual", "strain", "strain_residual")]
    some = {"loop": pictures["record_loop"]}
    for form, beginning in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")):
        (once,) = save_charts(some, tmp_path / "once", form)
        (again,) = save_charts(some, tmp_path / "again", form)
        assert once.name == f"loop.{form}"
        assert once.read_bytes().startswith(beginning)
        assert once.read_bytes() == again.read_bytes()


def test_a_constant_eta_is_a_number_and_another_one_a_picture():
    constant = default_artifact()
    assert constant_eta(constant) == pytest.approx(0.9966, abs=1e-4)
    pictures = sensor_files(constant)
    assert list(pictures) == ["mu", "everett"]
    assert "eta = 0.997 all over the plane" in pictures["mu"].result
    N = constant.n_lines
    changing = np.array(constant.mu) * np.linspace(0.9, 1.0, N)
    pictures = sensor_files(SensorArtifact(mu=constant.mu, nu=tuple(map(tuple, changing))))
    assert list(pictures) == ["mu", "eta", "everett", "everett_cycle"]
    assert "eta" not in pictures["mu"].result


def test_a_scale_of_colours_covers_no_number_of_the_axes():
    figure = Figure(figsize=(7.0, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    ax = draw(sensor_files(default_artifact())["everett"], figure.subplots())
    figure.canvas.draw()
    _, scale = figure.axes
    boxes = [label.get_window_extent() for label in (*ax.get_xticklabels(), *ax.get_yticklabels())]
    assert not any(scale.get_tightbbox().overlaps(box) for box in boxes)

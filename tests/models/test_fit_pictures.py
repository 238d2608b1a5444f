"""Pictures of fits name what they show, and no label covers another."""

from __future__ import annotations

import numpy as np
import pytest
from gossamer_models.fitting import Columns, read_record
from gossamer_models.fitting.plots import quantity, record_pictures, save_figures
from gossamer_models.sensor import SensorArtifact, default_artifact
from gossamer_models.sensor.plots import constant_eta, sensor_pictures
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


def drawn(draw):
    figure = Figure(figsize=(7.0, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    draw(figure)
    figure.canvas.draw()
    return figure


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
    pictures = record_pictures(measured, measured.resistance, {"inverse": measured.strain}, rows)
    assert list(pictures) == [f"record_{name}" for name in ("loop", "history", "residual", "strain", "strain_residual")]
    some = {"loop": pictures["record_loop"]}
    for form, beginning in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")):
        (once,) = save_figures(some, tmp_path / "once", form)
        (again,) = save_figures(some, tmp_path / "again", form)
        assert once.name == f"loop.{form}"
        assert once.read_bytes().startswith(beginning)
        assert once.read_bytes() == again.read_bytes()


def test_a_constant_eta_is_a_number_and_another_one_a_picture():
    constant = default_artifact()
    assert constant_eta(constant) == pytest.approx(0.9966, abs=1e-4)
    pictures = sensor_pictures(constant)
    assert list(pictures) == ["mu", "everett"]
    assert "eta = 0.997 all over the plane" in drawn(pictures["mu"]).axes[0].get_title()
    N = constant.n_lines
    changing = np.array(constant.mu) * np.linspace(0.9, 1.0, N)
    pictures = sensor_pictures(SensorArtifact(mu=constant.mu, nu=tuple(map(tuple, changing))))
    assert list(pictures) == ["mu", "eta", "everett"]
    assert "eta" not in drawn(pictures["mu"]).axes[0].get_title()


def test_the_label_of_the_everett_surfaces_covers_none_of_their_numbers():
    (ax,) = drawn(sensor_pictures(default_artifact())["everett"]).axes
    label = ax.zaxis.label.get_window_extent()
    numbers = [tick.label1.get_window_extent() for tick in ax.zaxis.get_major_ticks()]
    assert not any(label.overlaps(number) for number in numbers)

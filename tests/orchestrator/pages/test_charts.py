"""Charts that Python describes: what is left of long curves."""

import numpy as np
from gossamer_files.charts import curve


def test_a_long_loop_keeps_its_turning_points():
    phase = np.linspace(0.0, 40.0 * np.pi, 100_001)
    x, y = phase * np.sin(phase), np.cos(3.0 * phase)  # no point twice
    x[50_000], y[70_001], y[9] = 700.0, -9.0, np.nan
    loop = curve("loop", x, y)
    assert len(loop["x"]) == len(loop["y"]) <= 5200
    assert (np.nanmax(loop["x"]), np.nanmin(loop["y"])) == (700.0, -9.0)
    places = [np.flatnonzero((x == a) & (y == b))[0] for a, b in zip(loop["x"], loop["y"], strict=True)]
    assert (np.diff(places) > 0).all()


def test_a_short_loop_is_drawn_as_it_is():
    x = np.array([0.0, 1.0, 0.0, np.nan])
    loop = curve("loop", x, 2.0 * x)
    np.testing.assert_array_equal(loop["x"], x)

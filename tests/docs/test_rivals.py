"""The regressions that measured records are compared with: they learn what they are able to."""

import numpy as np
from oracles.records import record, zigzag
from studies import rivals


def test_every_regression_learns_a_low_pass_and_the_test_stretch_plays_no_part(monkeypatch):
    """The output is a low-pass of four samples: a static curve leaves more of it."""
    monkeypatch.setattr(rivals, "STEPS", 160)
    monkeypatch.setattr(rivals, "WINDOW", 40)
    u = zigzag(turns=30, per=12)
    y, level = np.empty_like(u), 0.0
    for k, value in enumerate(u):
        y[k] = level = 0.75 * level + 0.25 * value
    train = np.arange(u.size) < 240
    found = rivals.rivals(record(u, y), train, u, y)
    static = np.polyval(np.polyfit(u[train], y[train], 3), u)
    left = {name: np.std((values - y)[~train]) / np.std((static - y)[~train]) for name, values in found.items()}
    assert max(left.values()) < 0.9, left
    changed = rivals.rivals(record(u, y), train, u, np.where(train, y, 0.0))
    assert all((changed[name] == values).all() for name, values in found.items())

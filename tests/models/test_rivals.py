"""The networks that a compensator is compared with: they learn what they are able to."""

import numpy as np
from gossamer_models.automatic import rivals
from gossamer_models.automatic.compare import networks, regression
from oracles.records import record, zigzag


def test_every_rival_learns_a_low_pass_and_the_test_stretch_plays_no_part(monkeypatch):
    """The output is a low-pass of four samples: a static curve leaves more of it."""
    monkeypatch.setattr(rivals, "STEPS", 160)
    monkeypatch.setattr(rivals, "WINDOW", 40)
    u = zigzag(turns=30, per=12)
    y, level = np.empty_like(u), 0.0
    for k, value in enumerate(u):
        y[k] = level = 0.75 * level + 0.25 * value
    train = np.arange(u.size) < 240
    static = np.polyval(np.polyfit(u[train], y[train], 3), u)

    def answers(y, late):
        of = (record(u, y),), (u,), (y,), (train,), late
        return [regression(*of)[0], *(each[0] for each in networks(*of))]

    for late in (0, 3):
        found = answers(y, late)
        left = [np.std((values - y)[~train]) / np.std((static - y)[~train]) for values in found]
        assert max(left) < 0.9, left
        changed = answers(np.where(train, y, 0.0), late)
        assert all((other == values).all() for other, values in zip(changed, found, strict=True))


def test_a_rival_that_may_be_late_knows_what_follows():
    """The output is the input two samples later: nobody knows it who may not wait."""
    u = np.random.default_rng(0).uniform(size=400)
    y, train = np.roll(u, -2), np.arange(400) < 240
    errors = [np.std((regression((record(u, y),), (u,), (y,), (train,), late)[0] - y)[250:-5]) for late in (0, 2)]
    assert errors[1] < 0.01 < 0.2 < errors[0]

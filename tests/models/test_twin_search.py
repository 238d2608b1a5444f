"""The search of the twin: what its starts find where little is recorded, and what no fit of a right model shows."""

import os
import signal
from dataclasses import replace
from threading import Event, Timer

import numpy as np
import pytest
from gossamer_models.membrane import square_structure
from gossamer_models.twin import MembraneForward, ResponseRecord, Twin
from gossamer_models.twin.forward import side_by_side

pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")

STEP = 3e-4


@pytest.mark.parametrize(("zone", "sensor"), [(6, 3), (7, 2), (11, 3)])
def test_one_sensor_is_enough_for_one_damaged_zone(zone, sensor):
    """All zones together wander to damages of 55 to 95 % that explain next to nothing; one by one they do not."""
    square, noise = square_structure(4, 2), 5.8e-3
    damage = np.where(np.arange(16) == zone, 0.45, 0.0)
    values = MembraneForward(square).strain(damage[None], {}, {}, 400, STEP)[0]
    values += noise * np.random.default_rng(1).standard_normal(values.shape)
    values[np.arange(4) != sensor] = np.nan
    answer = Twin(square, discrepancy=None).fit(ResponseRecord(step=STEP, values=values, noise=noise))
    assert answer.valid
    assert np.abs(answer.damage - damage).max() < 0.04


def test_a_damage_as_large_as_the_twin_goes_is_no_answer():
    square, damage = square_structure(4, 1), np.where(np.arange(16) == 3, 0.6, 0.0)
    values = MembraneForward(square).strain(damage[None], {}, {}, 400, STEP)[0]
    fit, _ = Twin(square)._searched(ResponseRecord(step=STEP, values=values, noise=1e-4), lambda *_: None)
    assert fit.passes
    torn = replace(fit, point=replace(fit.point, x=np.where(np.arange(fit.kept.size) == 3, 0.945, fit.point.x)))
    assert not torn.passes
    assert torn.oddity == "damage of zone_4 is as large as the twin goes, 95 %, as in a false minimum"


def test_a_fit_that_passes_is_taken_before_a_likelier_one_that_does_not():
    """All zones together end at 95 % of one, with a smaller chi2 than the damaged zone alone."""
    square, damage, noise = square_structure(4, 1), np.where(np.arange(16) == 0, 0.6, 0.0), 0.012
    values = MembraneForward(square).strain(damage[None], {}, {}, 250, STEP)[0]
    values += noise * np.random.default_rng(4).standard_normal(values.shape)
    values[1:] = np.nan
    answer = Twin(square).fit(ResponseRecord(step=STEP, values=values, noise=noise))
    assert answer.valid
    assert abs(answer.damage[0] - 0.6) < 2.0 * answer.deviation[0]


def test_a_sensor_that_dies_early_is_left_out():
    square, damage = square_structure(4, 1), np.where(np.arange(16) == 5, 0.3, 0.0)
    values = MembraneForward(square).strain(damage[None], {}, {}, 300, STEP)[0]
    values += 1e-3 * np.random.default_rng(4).standard_normal(values.shape)
    values[2, 34:] = values[2, 33]
    answer = Twin(square).fit(ResponseRecord(step=STEP, values=values))
    assert answer.valid
    assert answer.left_out == (3,)
    assert abs(answer.damage[5] - 0.3) < 3.0 * answer.deviation[5]


def test_an_interrupt_does_not_wait_for_fits_that_run_side_by_side():
    """They waited for the end of every search that had begun: minutes, in which a command seemed not to end."""
    goes_on, handler = Event(), signal.getsignal(signal.SIGINT)
    timers = Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)), Timer(30.0, goes_on.set)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background of a shell ignores it
    try:
        for timer in timers:
            timer.start()
        with pytest.raises(KeyboardInterrupt):
            side_by_side(lambda _: goes_on.wait(), [1, 2])
        assert not goes_on.is_set()
    finally:
        timers[1].cancel()
        goes_on.set()
        signal.signal(signal.SIGINT, handler)


def test_an_error_of_one_search_ends_those_beside_it():
    """They went on in threads that nobody waited for."""
    square, asked, ended = MembraneForward(square_structure(4, 2)), [], Event()

    def search(number):
        if number == 0:
            msg = "one fails"
            raise ValueError(msg)
        try:
            while True:
                asked.append(number)
                square.states(np.zeros((1, len(square.zones))), {}, {"pressure": np.zeros((1, 1))})
        finally:
            ended.set()

    with pytest.raises(ValueError, match="one fails"):
        side_by_side(search, [1, 0])
    assert ended.wait(60.0)
    assert set(asked) <= {1}

"""A year of ageing sensors, in short: its first half in three records, and their page."""

import numpy as np
import pytest
from studies.ageing import DRIFT, LOST, describe, year

pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")


def test_a_sensor_that_was_identified_before_a_flight_recovers_what_it_no_longer_does_as_it_was_built():
    """Sensor 1 has lost a tenth of its gain and drifted by 1 ohm; gain and offset are those of the truth."""
    found = year((0, 3, 6), samples=600)
    last = found[-1]
    assert not any(each.refused for each in found)
    assert np.isnan(found[0].again).all()
    assert last.as_built[0] > 0.02
    assert (last.again[:3] < 0.6 * last.as_built[:3]).all()
    lost = np.column_stack([1.0 - LOST / 2, DRIFT / 2])
    for k in (0, 1, 3):
        assert last.true[k] == pytest.approx(lost[k], abs=1e-9)
        assert last.gain[k, 0] == pytest.approx(lost[k, 0], abs=max(3.0 * last.gain[k, 1], 2e-3))
        assert last.offset[k, 0] == pytest.approx(lost[k, 1], abs=max(3.0 * last.offset[k, 1], 0.05))
    page = describe(found)
    assert len(page.charts) == 12
    assert len(page.facts[0].rows) == 12
    assert page.sentence.startswith("As they were built, sensors recover strain to within")

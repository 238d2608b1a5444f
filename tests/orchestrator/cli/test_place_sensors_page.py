"""The page of a placement: which sensors are better, zones that are not found, a check that does not agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gossamer import SensorPlacement
from gossamer_models.membrane import square_structure
from gossamer_models.placement import Placement, Placing
from gossamer_models.placement.check import MonteCarloCheck
from gossamer_models.placement.information import FACTOR


@pytest.fixture(scope="module")
def found() -> Placing:
    """The chosen sensors halve a90, which is 10 % in zone 1 and rises to 25 % in zone 16."""
    structure = square_structure()
    sensors, a90 = structure.setup.sensors, np.linspace(0.1, 0.25, 16)
    own, chosen = (Placement(sensors=sensors, deviation=factor * a90 / FACTOR) for factor in (1.0, 0.5))
    return Placing(
        structure=structure, own=own, chosen=chosen, candidates=9, noise=1e-3, samples=100, step=3e-4, simulations=5
    )


def page_of(found):
    return SensorPlacement(files=[], result=found).describe()


def test_the_worst_zones_are_compared(found):
    page = page_of(found)
    assert page.sentence == (
        "With 4 chosen sensors the worst zone has a90 = 12.5 % damage; with the membrane's own 4 it has 25 %."
    )
    assert SensorPlacement(files=[], result=found).tables()[0].rows[-1][2:] == ("25.00", "12.50")
    own, chosen = page.charts[2].traces
    assert own["y"] == pytest.approx(100.0 * np.linspace(0.1, 0.25, 16))
    assert chosen["y"] == pytest.approx(own["y"] / 2.0)


def test_a_choice_that_is_no_better_is_said_first(found):
    page = page_of(replace(found, chosen=found.own))
    assert page.sentence.startswith("No placement of 4 sensors was found that is better than the membrane's own.")


def test_zones_that_are_not_found_and_a_check_that_fails_are_stated(found):
    deviation = np.where(np.arange(16) == 4, 1.0, 0.01)
    parts = np.full(16, 0.01)
    check = MonteCarloCheck(
        records=9, predicted=parts, observed=2.0 * parts, spread=4.0, spread_error=0.1, false_alarms=0.2, found=0.5
    )
    page = page_of(replace(found, chosen=replace(found.chosen, deviation=deviation, check=check)))
    assert "The chosen sensors do not find zones 5." in page.more
    assert page.kind == "invalid"
    assert any("does NOT agree with 1 ± 0.100; 20.0 % false alarms (5)" in sentence for sentence in page.more)


def test_every_zone_is_drawn_in_the_colour_of_its_a90(found):
    """Zone 16 of the own sensors has the largest a90 of both placements: the darkest end of the colours."""
    areas = {each["name"].partition(":")[0]: each for each in page_of(found).charts[0].traces if "fill" in each}
    assert len(areas) == 16
    assert areas["zone 16"]["fillcolor"] == "#440154"
    assert areas["zone 1"]["fillcolor"] != areas["zone 16"]["fillcolor"]

"""Units at both ends of a connection agree or are converted."""

from __future__ import annotations

import pytest
from gossamer_orchestrator import ScenarioError, make_plan, parse_scenario
from simulated import simulate


def test_units_of_another_dimension_are_refused(fmus, two_gains):
    message = (
        r"scenario:8: units of 'a.y' and 'b.u': 'Pa' \(kg m-1 s-2\) is not 'm' \(m\). Connect variables of one unit."
    )
    for extra in ("", "gain = 2.0"):
        with pytest.raises(ScenarioError, match=message):
            make_plan(parse_scenario(two_gains("pascal", "metre", extra)), fmus)


def test_units_of_another_scale_are_refused_with_the_conversion_that_is_then_accepted(fmus, two_gains):
    message = r"'Pa' \(kg m-1 s-2\) is not 'kPa' \(1000 kg m-1 s-2\). Convert with gain = 0.001."
    with pytest.raises(ScenarioError, match=message):
        make_plan(parse_scenario(two_gains("pascal", "kilo")), fmus)
    data = simulate(parse_scenario(two_gains("pascal", "kilo", "gain = 0.001")), fmus)
    assert data["b.y"].values[-1] == pytest.approx(1.5)
    assert data["a.y"].attrs == {"units": "Pa", "long_name": "what comes out"}


def test_a_variable_without_a_unit_fits_any(fmus, two_gains):
    make_plan(parse_scenario(two_gains("pascal", "gain")), fmus)


@pytest.mark.parametrize("factor", ["0", "INF", "NaN"])
def test_units_that_no_number_converts_are_refused(other_unit, tmp_path, factor, two_gains):
    other_unit("a", "y", "m", 'm="1"')
    other_unit("b", "u", "z", f'm="1" factor="{factor}"')
    for extra in ("", "gain = 2.0"):
        with pytest.raises(ScenarioError, match=r"units of 'a.y' and 'b.u': .* Connect variables of one unit."):
            make_plan(parse_scenario(two_gains("a", "b", extra)), tmp_path)

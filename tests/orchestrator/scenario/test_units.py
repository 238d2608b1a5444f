"""Units at both ends of a connection agree or are converted."""

from __future__ import annotations

import pytest
from gossamer_orchestrator import ScenarioError, make_plan, parse_scenario
from simulated import simulate

from ..conftest import rewrite


def test_units_of_another_dimension_are_refused(fmus, two_gains):
    message = r"scenario:8: units of 'a.y' and 'b.u': 'Pa' \(kg m-1 s-2\) is not 'm' \(m\). Connect variables of one unit."
    for extra in ("", "gain = 2.0"):
        with pytest.raises(ScenarioError, match=message):
            make_plan(parse_scenario(two_gains("pascal", "metre", extra)), fmus)


def test_units_of_another_scale_are_converted_unless_the_scenario_does_it(fmus, two_gains):
    data = simulate(parse_scenario(two_gains("pascal", "kilo")), fmus)
    stated = simulate(parse_scenario(two_gains("pascal", "kilo", "gain = 0.001")), fmus)
    assert data["b.y"].values[-1] == stated["b.y"].values[-1] == pytest.approx(1.5)
    assert data["a.y"].attrs == {"units": "Pa", "long_name": "what comes out"}


def test_units_with_an_offset_are_converted(other_unit, tmp_path, two_gains):
    """1500 degrees Fahrenheit, (F + 459.67) / 1.8 K, in degrees Celsius."""
    other_unit("a", "y", "degF", f'K="1" factor="{1 / 1.8!r}" offset="{459.67 / 1.8!r}"')
    other_unit("b", "u", "degC", 'K="1" offset="273.15"')
    data = simulate(parse_scenario(two_gains("a", "b")), tmp_path)
    assert data["b.y"].values[-1] == pytest.approx((1500.0 - 32.0) / 1.8)


def test_of_differences_the_offset_is_left_out(other_unit, tmp_path, two_gains):
    """A difference of 1500 degrees Fahrenheit is one of 1500 / 1.8 K."""

    def declare(xml):
        kind = '<TypeDefinitions><SimpleType name="D"><Real relativeQuantity="true"/></SimpleType></TypeDefinitions>'
        return xml.replace("</UnitDefinitions>", f"</UnitDefinitions>{kind}").replace(
            "<Real unit", '<Real declaredType="D" unit'
        )

    other_unit("a", "y", "degF", f'K="1" factor="{1 / 1.8!r}" offset="{459.67 / 1.8!r}"')
    other_unit("b", "u", "K", 'K="1"')
    for name in "ab":
        rewrite(tmp_path / f"{name}.fmu", tmp_path / f"{name}_difference.fmu", declare)
    data = simulate(parse_scenario(two_gains("a_difference", "b_difference")), tmp_path)
    assert data["b.y"].values[-1] == pytest.approx(1500.0 / 1.8)


def test_a_variable_without_a_unit_fits_any(fmus, two_gains):
    make_plan(parse_scenario(two_gains("pascal", "gain")), fmus)


@pytest.mark.parametrize("factor", ["0", "INF", "NaN"])
def test_units_that_no_number_converts_are_refused(other_unit, tmp_path, factor, two_gains):
    other_unit("a", "y", "m", 'm="1"')
    other_unit("b", "u", "z", f'm="1" factor="{factor}"')
    for extra in ("", "gain = 2.0"):
        with pytest.raises(ScenarioError, match=r"units of 'a.y' and 'b.u': .* Connect variables of one unit."):
            make_plan(parse_scenario(two_gains("a", "b", extra)), tmp_path)

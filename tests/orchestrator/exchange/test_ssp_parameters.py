"""Parameter sets of an SSP reach the FMUs, through mappings and units."""

from __future__ import annotations

import pytest
from gossamer_orchestrator import ScenarioError, open_ssp
from ssp_structures import GAIN, SSV, bindings, component, last, real, system


def test_a_value_in_another_unit_is_converted(make):
    path = make(system(component("m", "metre", GAIN, bindings(SSV.format(real("u", 2.0, ' unit="km"'))))))
    assert last(path, "m.y") == 2000.0


def test_a_mapping_renames_and_transforms_and_leaves_the_rest(make):
    mapping = """<ParameterMapping><m:ParameterMapping version="1.0">
      <m:MappingEntry source="gain.k" target="gain.factor"><c:LinearTransformation factor="2" offset="1"/></m:MappingEntry>
      </m:ParameterMapping></ParameterMapping>"""
    values = bindings(SSV.format(real("k", 4.0) + real("u", 2.0)), ' prefix="gain."', mapping)
    assert last(make(system(component("gain", "gain", GAIN), more=values)), "gain.y") == 18.0


@pytest.mark.parametrize(("more", "expected"), [("", 4001.0), (' suppressUnitConversion="true"', 5.0)])
def test_a_mapping_converts_units_before_it_transforms(make, more, expected):
    mapping = f"""<ParameterMapping><m:ParameterMapping version="1.0"><m:MappingEntry source="k" target="u"{more}>
      <c:LinearTransformation factor="2" offset="1"/></m:MappingEntry></m:ParameterMapping></ParameterMapping>"""
    given = bindings(SSV.format(real("k", 2.0, ' unit="km"')), "", mapping)
    assert last(make(system(component("m", "metre", GAIN, given))), "m.y") == expected


def test_a_mapping_may_be_a_file(make):
    mapping = """<ssm:ParameterMapping version="1.0" xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping">
      <ssm:MappingEntry source="k" target="u"/></ssm:ParameterMapping>"""
    given = bindings("", ' source="k.ssv"', '<ParameterMapping source="k.ssm"/>')
    path = make(
        system(component("gain", "gain", GAIN, given)), files={"k.ssv": SSV.format(real("k", 4.0)), "k.ssm": mapping}
    )
    assert last(path, "gain.y") == 4.0


def test_names_that_match_nothing_are_ignored_as_ssp_says_but_told(make, caplog):
    path = make(system(component("gain", "gain", GAIN, bindings(SSV.format(real("facter", 2.0) + real("u", 1.0))))))
    assert last(path, "gain.y") == 1.0
    assert "a value is given to 'gain.facter', which is not there; it is ignored" in caplog.text


def test_a_mapping_of_a_value_that_is_not_given_is_told(make, caplog):
    mapping = """<ParameterMapping><m:ParameterMapping version="1.0"><m:MappingEntry source="l" target="u"/>
      </m:ParameterMapping></ParameterMapping>"""
    last(make(system(component("m", "metre", GAIN, bindings(SSV.format(real("k", 4.0)), "", mapping)))), "m.y")
    assert "gives 'l' to 'u', but no such value is given; it is ignored" in caplog.text


@pytest.mark.parametrize("factor", ["0", "INF", "NaN"])
def test_a_unit_that_converts_nothing_is_refused(make, factor):
    given = SSV.format(real("u", 2.0, ' unit="km"')).replace('factor="1000"', f'factor="{factor}"')
    path = make(system(component("m", "metre", GAIN, bindings("", ' source="s.ssv"'))), files={"s.ssv": given})
    with pytest.raises(ScenarioError, match=r"unit 'km' has the factor"), open_ssp(path, step=0.1):
        pass

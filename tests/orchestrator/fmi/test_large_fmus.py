"""FMUs of thousands of variables: a plan takes a time that grows with their number, not with its square; and odd types."""

from __future__ import annotations

import time
import zipfile

import pytest
from gossamer_orchestrator import FmuFile, ScenarioError, make_plan, parse_scenario
from gossamer_orchestrator.words import brief

COUNT = 4000
XML = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="large" guid="large">
  <CoSimulation modelIdentifier="large"/>
  <ModelVariables>{variables}</ModelVariables>
  <ModelStructure><Outputs>{outputs}</Outputs><InitialUnknowns>{outputs}</InitialUnknowns></ModelStructure>
</fmiModelDescription>
"""
ONE = '<ScalarVariable name="{name}" valueReference="{k}" causality="{causality}"{more}><Real{start}/></ScalarVariable>'
START = ' start="0"'


GAPS = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="gaps" guid="gaps">
  <CoSimulation modelIdentifier="gaps"/>
  <TypeDefinitions><SimpleType name="E"><Enumeration>
    <Item name="off" value="-5"/><Item name="low" value="1"/><Item name="high" value="1000000"/>
  </Enumeration></SimpleType></TypeDefinitions>
  <ModelVariables><ScalarVariable name="e" valueReference="0" causality="parameter" variability="tunable">
    <Enumeration declaredType="E" start="1"/>
  </ScalarVariable></ModelVariables>
  <ModelStructure/>
</fmiModelDescription>
"""


def large(path, **names):
    """Write an FMU without a binary, with variables of some causalities named by a pattern."""
    listed = [(name.format(k), causality) for causality, name in names.items() for k in range(1, COUNT + 1)]
    more = {"parameter": ' variability="tunable"'}
    variables = [
        ONE.format(name=name, k=k, causality=c, more=more.get(c, ""), start="" if c == "output" else START)
        for k, (name, c) in enumerate(listed)
    ]
    outputs = "".join(f'<Unknown index="{k}"/>' for k, (_, c) in enumerate(listed, start=1) if c == "output")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", XML.format(variables="".join(variables), outputs=outputs))


def test_a_plan_of_thousands_of_connections_values_and_columns_takes_seconds(tmp_path):
    """Every input of the second FMU reaches each of its outputs, as far as its model description says."""
    large(tmp_path / "first.fmu", parameter="p{}", input="u[{}]", output="a.y{}")
    large(tmp_path / "second.fmu", input="u{}", output="y[{}]")
    numbers = range(1, COUNT + 1)
    text = (
        '[components.a]\nfmu = "first"\n[components.a.inputs]\nu = ['
        + ", ".join("0.5" for _ in numbers)
        + "]\n[components.a.parameters]\n"
        + "".join(f"p{k} = {k}\n" for k in numbers)
        + '[components.b]\nfmu = "second"\n'
        + "".join(f'[[connections]]\nfrom = "a.a.y{k}"\nto = "b.u{k}"\n' for k in numbers)
        + "[record]\nvariables = ["
        + ", ".join(f'"a.a.y{k}"' for k in numbers)
        + ', "b.y"]\n'
    )
    scenario = parse_scenario(f"step = 0.1\nstop = 1.0\n{text}")
    begun = time.process_time()
    plan = make_plan(scenario, tmp_path)
    taken = time.process_time() - begun
    assert (len(plan.connections), len(plan.columns)) == (COUNT, 2 * COUNT)
    assert plan.component("a").start == {f"u[{k}]": 0.5 for k in numbers} | {f"p{k}": float(k) for k in numbers}
    assert taken < 6.0  # [s]; before, more than 20


def test_a_loop_through_all_inputs_and_outputs_is_still_named(tmp_path, caplog):
    large(tmp_path / "large.fmu", input="u{}", output="y{}")
    rest = "".join(f"u{k} = 0.0\n" for k in range(1, COUNT))
    text = f'step = 0.1\nstop = 1.0\n[components.a]\nfmu = "large"\n[components.a.inputs]\n{rest}'
    make_plan(parse_scenario(f'{text}[[connections]]\nfrom = "a.y7"\nto = "a.u{COUNT}"\n'), tmp_path)
    assert f"algebraic loop a.y7 -> a.u{COUNT} -> a.y7: the connection" in caplog.text


def test_elements_are_found_by_the_name_of_their_array(tmp_path):
    large(tmp_path / "large.fmu", output="y[{}]", input="a.u[1,{}]")
    fmu = FmuFile(tmp_path / "large.fmu")
    assert fmu.elements("y") == [f"y[{k}]" for k in range(1, COUNT + 1)]
    assert fmu.elements("a.u")[-1] == f"a.u[1,{COUNT}]"
    assert fmu.elements("a") == fmu.elements("y[1]") == []


def test_an_enumeration_with_gaps_takes_its_own_values_only(tmp_path):
    with zipfile.ZipFile(tmp_path / "gaps.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", GAPS)
    text = 'step = 0.1\nstop = 1.0\n[components.a]\nfmu = "gaps"\nparameters = { e = %d }\n'
    assert make_plan(parse_scenario(text % 1000000), tmp_path).component("a").start == {"e": 1000000}
    with pytest.raises(
        ScenarioError, match=r"'e' of FMU 'gaps' is none of -5 \(off\), 1 \(low\), 1000000 \(high\), but 3\."
    ):
        make_plan(parse_scenario(text % 3), tmp_path)


def test_a_message_holds_the_ends_of_a_long_text_only():
    assert brief("a name") == "'a name'"
    assert brief(b"x" * 10_000_000) == f"b'{'x' * 98}...{'x' * 49}'"

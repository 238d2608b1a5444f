"""SSP archives that strangers write run: their structure, connections, units and times."""

from __future__ import annotations

import re
import zipfile

import pytest
from gossamer_orchestrator import ScenarioError, open_ssp
from ssp_structures import GAIN, NESTED, SSD, SSV, SUM, bindings, component, connection, connector, last, real, system


def test_a_strangers_ssp_runs_without_annotations_and_with_an_external_parameter_set(make):
    path = make(
        system(
            component("sum-1", "integrator", SUM + connector("limit", "parameter"))
            + component("gain", "gain", GAIN, bindings("", ' source="resources/gain%20values.ssv"')),
            connection("sum-1.u", "gain.y"),  # written backwards, which SSP allows
        ),
        files={"resources/gain values.ssv": SSV.format(real("factor", 3.0) + real("u", 2.0))},
    )
    assert last(path, "sum_1.y") == pytest.approx(6.0, rel=1e-14)


@pytest.mark.parametrize("prefix", ["xmlns:c", "xmlns:v", "xmlns:ssv", "xmlns:ssc"])
def test_prefixes_that_are_used_and_not_declared_are_taken_as_those_of_ssp(make, caplog, prefix):
    """As in examples that many have copied."""
    ssd, ssv = (re.sub(rf'{prefix}="[^"]*"', "", text) for text in (SSD, SSV.format(real("factor", 3.0) + real("u", 2.0))))
    values = bindings("", ' source="resources/values.ssv"')
    path = make(
        system(component("sum", "integrator", SUM) + component("gain", "gain", GAIN, values), connection("gain.y", "sum.u")),
        files={"resources/values.ssv": ssv},
        ssd=ssd,
    )
    assert last(path, "sum.y") == pytest.approx(6.0, rel=1e-14)
    name = prefix.removeprefix("xmlns:")
    file = "values.ssv" if len(name) > 1 else "SystemStructure.ssd"
    undeclared = {"c", "ssv", "ssc"}
    said = f"other.ssp: {file} does not declare the prefixes {name}; they are taken as those of SSP"
    assert (said in caplog.text) == (name in undeclared)


def test_step_and_stop_come_from_the_command_if_it_names_them(make):
    path = make(system(component("a", "gain")))
    with open_ssp(path, step=0.25, stop=2.0) as scenario:
        assert (scenario.step, scenario.start, scenario.stop, scenario.title) == (0.25, 0.0, 2.0, "Not ours")


def test_without_times_those_of_the_fmus_are_taken_and_said(make, fmus, caplog):
    path = make(system(component("a", "a") + component("b", "b")), rest="")
    message = r"other.ssp: neither it nor its FMUs state a step. Name one with step="
    with zipfile.ZipFile(fmus / "gain.fmu") as old, zipfile.ZipFile(path, "a") as new:
        for name, step in (("a", 0.25), ("b", 0.5)):
            experiment = f'<DefaultExperiment stepSize="{step}" stopTime="{8 * step}"/><ModelVariables>'
            with zipfile.ZipFile(path.with_name("x"), "w") as fmu:
                for member in old.namelist():
                    text = old.read(member)
                    if member == "modelDescription.xml":
                        text = text.replace(b"<ModelVariables>", experiment.encode())
                    fmu.writestr(member, text)
            new.write(path.with_name("x"), f"resources/{name}.fmu")
    with open_ssp(path) as scenario:
        assert (scenario.step, scenario.stop) == (0.25, 4.0)
    assert "states no step: 0.25 s is taken, the smallest of its FMUs" in caplog.text
    assert "states no stop time: 4 s is taken, the largest of its FMUs" in caplog.text
    with pytest.raises(ScenarioError, match=message), open_ssp(make(system(component("a", "gain")))):
        pass


def test_a_linear_transformation_becomes_gain_and_bias(make):
    wire = connection("gain.y", "sum.u", '<c:LinearTransformation factor="2.0" offset="1.0"/>')
    values = bindings(SSV.format(real("u", 3.0)))
    path = make(system(component("gain", "gain", GAIN, values) + component("sum", "integrator", SUM), wire))
    assert last(path, "sum.y") == pytest.approx(7.0, rel=1e-14)


@pytest.mark.parametrize(
    ("more", "content", "expected"),
    [
        ("", "", 0.002),
        ("", '<c:LinearTransformation factor="10" offset="1"/>', 1.02),  # after the conversion
        (' suppressUnitConversion="true"', "", 2.0),
        (' suppressUnitConversion="true"', '<c:LinearTransformation factor="10"/>', 20.0),
    ],
)
def test_units_are_converted_unless_the_connection_says_no(make, more, content, expected):
    values = bindings(SSV.format(real("u", 2.0)))
    elements = component("pascal", "pascal", GAIN, values) + component("kilo", "kilo", GAIN)
    path = make(system(elements, connection("pascal.y", "kilo.u", content, more)))
    assert last(path, "kilo.y") == pytest.approx(expected, rel=1e-14)


def test_units_that_cannot_be_converted_are_refused(make):
    elements = component("pascal", "pascal", GAIN) + component("metre", "metre", GAIN)
    path = make(system(elements, connection("pascal.y", "metre.u")))
    with pytest.raises(ScenarioError, match=r"other.ssp: units of 'pascal.y' and 'metre.u'"):
        last(path, "metre.y")


def test_nested_systems_are_flattened_and_higher_levels_override_lower_ones(make):
    assert last(make(NESTED), "sum.y") == pytest.approx(7.0 * 3.0 + 1.0, rel=1e-14)


@pytest.mark.parametrize("element", ['FixedStepAlgorithm baseStepSize="0.2"', 'FixedStepMaster stepSize="0.2"'])
def test_the_step_may_stand_in_an_annotation_of_libcosim_or_omsimulator(make, element):
    annotation = f'<Annotations><c:Annotation type="any"><x:{element} xmlns:x="any"/></c:Annotation></Annotations>'
    path = make(system(component("a", "gain")), rest=f'<DefaultExperiment stopTime="1">{annotation}</DefaultExperiment>')
    with open_ssp(path) as scenario:
        assert scenario.step == 0.2


def test_a_circle_without_an_order_gets_one(make, caplog):
    elements = component("delay", "delay", connector("last_u", "output") + SUM) + component("gain", "gain", GAIN)
    path = make(system(elements, connection("delay.last_u", "gain.u") + connection("gain.y", "delay.u")))
    last(path, "gain.y")
    assert "they step in the order delay, gain" in caplog.text

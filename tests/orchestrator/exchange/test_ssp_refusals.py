"""System structures that cannot run or cannot be trusted are refused by name."""

from __future__ import annotations

import copy
import random

import pytest
from gossamer_orchestrator import FmuError, ScenarioError, open_ssp
from lxml import etree
from ssp_structures import EXPERIMENT, GAIN, NESTED, SSD, SSV, bindings, component, connection, connector, last, real, system


def test_an_annotation_nested_too_deeply_is_refused(make):
    text = f'<Annotations><c:Annotation type="gossamer.scenario">{100_000 * "["}</c:Annotation></Annotations>'
    with pytest.raises(ScenarioError, match=r"its annotation 'gossamer.scenario' cannot be read: RecursionError"):
        last(make(system(component("a", "gain")) + text), "a.y")


@pytest.mark.parametrize(
    ("times", "step", "message"),
    [
        ('startTime="-1e308"', "0.1", "more steps than can be counted"),
        ('startTime="1e308"', "0.1", r"'stop' \(1 s\) must lie after 'start' \(1e\+308 s\)"),
        ("", "1e-300", r"'step' = 1e-300 s makes 1e\+300 steps"),
        ("", "1e-9", r"'step' = 1e-09 s makes 1e\+09 steps"),
        ("", "inf", r"'step': input should be a finite number"),
    ],
)
def test_absurd_times_are_refused_on_one_line(make, times, step, message):
    annotation = f'<c:Annotation type="x"><x:FixedStepAlgorithm baseStepSize="{step}" xmlns:x="any"/></c:Annotation>'
    experiment = f'<DefaultExperiment {times} stopTime="1"><Annotations>{annotation}</Annotations></DefaultExperiment>'
    path = make(system(component("a", "gain")), rest=experiment)
    with pytest.raises(ScenarioError, match=f"^other.ssp: [^\n]*{message}[^\n]*$"), open_ssp(path):
        pass


TWO = component("a", "gain", GAIN) + component("b", "gain", GAIN)


REFUSALS = {
    "no FMU inside": (system(component("a", "nowhere")), "source of component 'a' is 'resources/nowhere.fmu', which is not"),
    "a path that leaves": (system(component("a", "../../gain")), "which is not in the archive"),
    "no FMU at all": (system(""), "it holds no FMU"),
    "another kind": (
        system('<Component name="a" source="x.ssp" type="application/x-ssp-package"/>'),
        "component 'a' is not an FMU but 'application/x-ssp-package'",
    ),
    "a signal dictionary": (
        system(TWO + '<SignalDictionaryReference name="bus" dictionary="d"/>'),
        "it has a SignalDictionaryReference 'bus'",
    ),
    "an unknown connector": (system(TWO, connection("a.y", "b.v")), "'b.v' is not there. Connect"),
    "two outputs": (system(TWO, connection("a.y", "b.y")), "'a.y' to 'b.y' joins two outputs"),
    "two sources": (
        system(TWO, connection("a.y", "b.u") + connection("b.y", "b.u")),
        "'b.u' is connected twice",
    ),
    "a connected parameter": (
        system(component("a", "gain", GAIN + connector("factor", "parameter")), connection("a.y", "a.factor")),
        "connection 'a.y' to 'a.factor' sets a parameter",
    ),
    "another transformation": (
        system(TWO, connection("a.y", "b.u", '<c:BooleanMappingTransformation><c:MapEntry source="1" target="0"/>'
                               "</c:BooleanMappingTransformation>")),
        "'a.y' to 'b.u' has a BooleanMappingTransformation",
    ),
    "a value for an output": (
        system(component("a", "gain", GAIN, bindings(SSV.format(real("y", 2.0))))),
        "a value is given to 'a.y', which is of kind 'output'",
    ),
    "no number": (
        system(component("a", "gain", GAIN, bindings(SSV.format(real("u", "x"))))),
        "component 'a': 'u' is 'x', which is no Real",
    ),
    "a missing set": (
        system(component("a", "gain", GAIN, bindings("", ' source="s.ssv"'))),
        "source of a parameter binding of component 'a' is 's.ssv', which is not in the archive",
    ),
    "an empty binding": (system(component("a", "gain", GAIN, bindings(""))), "has neither a source nor values"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSALS)
def test_what_cannot_run_is_refused_by_name(make, case):
    content, message = REFUSALS[case]
    with pytest.raises(ScenarioError, match=r"other.ssp: ") as error, open_ssp(make(content), step=0.1):
        pass
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (' startConnector="y"', "", r"missing required attribute 'startConnector' \(at /ssd:SystemStructureDescription/"),
        ('<Component name="a" ', "<Component ", "missing required attribute"),
        ('factor="2"', 'factor="two"', r"attribute factor='two': .*/ssd:Connection/ssc:LinearTransformation\)"),
        ('value="1.0"', "", "parameter binding of component 'a': 'u' is None, which is no Real"),
    ],
)
def test_what_the_schema_forbids_is_refused_with_its_place(make, old, new, reason):
    wire = connection("a.y", "b.u", '<c:LinearTransformation factor="2"/>')
    content = system(component("a", "gain", GAIN, bindings(SSV.format(real("u", 1.0)))) + component("b", "gain", GAIN), wire)
    assert old in content
    with pytest.raises(ScenarioError, match=reason), open_ssp(make(content.replace(old, new, 1)), step=0.1):
        pass


@pytest.mark.parametrize(
    "declaration", ['<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">', '<!ENTITY b SYSTEM "file:///etc/hostname">', ""]
)
@pytest.mark.parametrize("where", ["SystemStructure.ssd", "set.ssv"])
def test_a_document_type_definition_is_refused_in_every_file(make, declaration, where):
    doctype = f"<!DOCTYPE x [{declaration}]>"
    ssd, ssv = SSD, SSV.format(real("u", 1.0))
    if where == "set.ssv":
        ssv = doctype + ssv
    else:
        ssd = ssd.replace("<SystemStructureD", doctype + "<SystemStructureD", 1)
    path = make(system(component("a", "gain", GAIN, bindings("", ' source="set.ssv"'))), files={"set.ssv": ssv}, ssd=ssd)
    with pytest.raises(ScenarioError, match=rf"{where} has a document type definition"), open_ssp(path, step=0.1):
        pass


def test_however_a_structure_is_damaged_the_answer_is_a_scenario_or_a_scenario_error(make):
    root = etree.fromstring(SSD.format(content=NESTED, rest=EXPERIMENT).encode())
    outcomes = set()
    for seed in range(60):
        rng, damaged = random.Random(seed), copy.deepcopy(root)
        elements = [e for e in damaged.iter() if isinstance(e.tag, str)]
        victim, other = rng.choice(elements[1:]), rng.choice(elements[1:])
        if seed % 3 == 0:
            victim.getparent().remove(victim)
        elif seed % 3 == 1:
            other.append(copy.deepcopy(victim))
        else:
            key = rng.choice(sorted(victim.attrib) or ["name"])
            victim.set(key, rng.choice(["", "-1", "nan", "1e999", "..", "true", "gain", "u"]))
        try:
            with open_ssp(make(NESTED, ssd=etree.tostring(damaged).decode()), step=0.1):
                outcomes.add("scenario")
        except ScenarioError:
            outcomes.add("refused")
    assert outcomes == {"scenario", "refused"}


MAPPING = (
    '<ssm:ParameterMapping xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" version="1.0">'
    "{}</ssm:ParameterMapping>"
)


@pytest.mark.parametrize(("values", "mapping", "message"), [
    (SSV.format(real("k", 2.0)), MAPPING.format('<ssm:MappingEntry source="k"/>'),
     "values.ssm cannot be understood: missing required attribute 'target'"),
    (SSV.format(real("k", 2.0)), "<nothing/>", "values.ssm is a 'nothing', not a 'ParameterMapping'"),
    (SSV.format("<ssv:Parameter/>"), MAPPING.format(""), "values.ssv cannot be understood: "),
    ("<nothing/>", MAPPING.format(""), "values.ssv is a 'nothing', not a 'ParameterSet'"),
])  # fmt: skip
def test_the_file_that_departs_from_its_schema_is_named(make, values, mapping, message):
    bound = (
        '<ParameterBindings><ParameterBinding source="resources/values.ssv">'
        '<ParameterMapping source="resources/values.ssm"/></ParameterBinding></ParameterBindings>'
    )
    files = {"resources/values.ssv": values, "resources/values.ssm": mapping}
    with pytest.raises(ScenarioError) as refused:
        last(make(system(component("a", "gain", GAIN, bound)), files=files), "a.y")
    assert str(refused.value).startswith(f"other.ssp: {message}")
    assert "Error" not in str(refused.value)


def test_a_broken_fmu_is_named_by_its_place_in_the_archive(make):
    with pytest.raises(FmuError) as refused:
        last(make(system(component("a", "notes")), files={"resources/notes.fmu": "notes"}), "a.y")
    assert str(refused.value).endswith("other.ssp/resources/notes.fmu is not an FMU. It is text.")

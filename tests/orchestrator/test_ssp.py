"""SSP archives: what is written comes back, what strangers write runs, what cannot be said or trusted is refused."""

from __future__ import annotations

import copy
import random
import stat
import zipfile
from pathlib import Path

import pytest
from gossamer_orchestrator import (
    OrchestratorError,
    ScenarioError,
    export_ssp,
    make_plan,
    open_ssp,
    parse_scenario,
    run_scenario,
)
from gossamer_orchestrator.cli import app
from gossamer_orchestrator.fmi import archive
from gossamer_orchestrator.scenario.shipped import find_scenario
from lxml import etree
from typer.testing import CliRunner

CHAIN = """
title = "A chain"
step = 0.1
start = 0.5
stop = 1.5
order = ["source", "sink"]
[components]
sink = { fmu = "integrator", parameters = { limit = 5.0 } }
source = { fmu = "gain", parameters = { factor = -0.1 }, inputs = { u = 2.0, "offset[*]" = 1e-3, "offset[2]" = 0.3 } }
[[connections]]
from = "source.y"
to = "sink.u"
gain = 3.0
bias = 1.0
[record]
variables = ["s*.y"]
every = 2
"""

SSD = """<?xml version="1.0" encoding="UTF-8"?>
<SystemStructureDescription xmlns="http://ssp-standard.org/SSP1/SystemStructureDescription"
  xmlns:c="http://ssp-standard.org/SSP1/SystemStructureCommon"
  xmlns:v="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
  xmlns:m="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"
  version="1.0" name="other" description="Not ours">
  <!-- a comment -->
  <System name="root">{content}</System>
  {rest}
</SystemStructureDescription>
"""
SSV = """<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
  xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="any">
  <ssv:Parameters>{}</ssv:Parameters>
  <ssv:Units><ssc:Unit name="km"><ssc:BaseUnit m="1" factor="1000"/></ssc:Unit></ssv:Units></ssv:ParameterSet>"""
EXPERIMENT = '<DefaultExperiment stopTime="1.0"/>'


def connector(name: str, kind: str, unit: str = "") -> str:
    return f'<Connector name="{name}" kind="{kind}"><c:Real{unit}/></Connector>'


def component(name: str, fmu: str, connectors: str = "", more: str = "") -> str:
    connectors = f"<Connectors>{connectors}</Connectors>" if connectors else ""
    return f'<Component name="{name}" source="resources/{fmu}.fmu">{connectors}{more}</Component>'


def real(name: str, value: float, unit: str = "") -> str:
    return f'<ssv:Parameter name="{name}"><ssv:Real value="{value}"{unit}/></ssv:Parameter>'


def bindings(content: str, source: str = "", inside: str = "") -> str:
    content = (
        f"<ParameterValues>{content.replace('ssv:', 'v:').replace(':ssv', ':v')}</ParameterValues>" if content else ""
    )
    return f"<ParameterBindings><ParameterBinding{source}>{content}{inside}</ParameterBinding></ParameterBindings>"


def connection(start: str, end: str, content: str = "", more: str = "") -> str:
    a, _, b = start.rpartition(".")
    c, _, d = end.rpartition(".")
    a, c = (f' startElement="{a}"' if a else ""), (f' endElement="{c}"' if c else "")
    return f'<Connection{a} startConnector="{b}"{c} endConnector="{d}"{more}>{content}</Connection>'


def system(elements: str, connections: str = "", connectors: str = "", more: str = "") -> str:
    connectors = f"<Connectors>{connectors}</Connectors>" if connectors else ""
    return f"{connectors}{more}<Elements>{elements}</Elements><Connections>{connections}</Connections>"


GAIN = connector("y", "output") + connector("u", "input")
SUM = connector("u", "input")


@pytest.fixture
def make(fmus, tmp_path):
    """Write an archive as a stranger might."""

    def write(content: str, rest: str = EXPERIMENT, files: dict[str, str] | None = None, ssd: str = SSD) -> Path:
        path = tmp_path / "other.ssp"
        with zipfile.ZipFile(path, "w") as file:
            for name, text in (files or {}).items():
                file.writestr(name, text)
            for fmu in ("gain", "integrator", "pascal", "kilo", "metre", "delay", "clock"):
                if f"/{fmu}.fmu" in content:
                    file.write(fmus / f"{fmu}.fmu", f"resources/{fmu}.fmu")
            file.writestr("SystemStructure.ssd", ssd.format(content=content, rest=rest))
        return path

    return write


def last(path: Path, name: str, **options: float) -> float:
    return float(run_scenario(path, "nowhere", step=0.1, **options)[name][-1])


# what we write


def test_a_scenario_comes_back_from_its_ssp_as_the_same_plan(fmus, tmp_path):
    scenario = parse_scenario(CHAIN, name="chain.toml")
    before = make_plan(scenario, fmus)
    with open_ssp(export_ssp(scenario, fmus, tmp_path / "chain.ssp")) as again:
        after = make_plan(again, fmus)
        assert again.name == "chain"
        for key in ("title", "step", "start", "stop", "master", "order", "record", "connections"):
            assert getattr(again, key) == getattr(scenario, key)
        assert list(again.components) == list(scenario.components)
        for key in ("name", "start", "connections", "sent", "recorded"):
            assert [getattr(c, key) for c in after.components] == [getattr(c, key) for c in before.components]
        assert after.columns == before.columns


def test_the_same_scenario_gives_the_same_bytes(fmus, tmp_path):
    scenario = parse_scenario(CHAIN)
    first, second = (export_ssp(scenario, fmus, tmp_path / name).read_bytes() for name in ("a.ssp", "b.ssp"))
    assert first == second


def test_what_is_written_fits_the_schema_and_the_subset_that_other_tools_read(fmus, tmp_path):
    from pyssp_standard import ssd

    with zipfile.ZipFile(export_ssp(parse_scenario(CHAIN), fmus, tmp_path / "c.ssp")) as file:
        assert file.namelist()[0] == "SystemStructure.ssd"
        file.extractall(tmp_path)
    structure = ssd.SSD(tmp_path / "SystemStructure.ssd")
    structure.__check_compliance__()
    assert structure.system.connectors == []
    assert [b.ssv.name for e in structure.system.elements for b in e.parameter_bindings] == ["initialValues"] * 2
    root = (tmp_path / "SystemStructure.ssd").read_text().partition("<ssd:System ")[0]
    assert all(f"xmlns:{prefix}=" in root for prefix in ("ssd", "ssc", "ssv", "osp"))  # libcosim wants them at the top


def test_fmus_of_one_name_in_two_folders_stay_apart(fmus, tmp_path):
    for folder, fmu in (("a", "gain"), ("b", "kilo")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "gain.fmu").write_bytes((fmus / f"{fmu}.fmu").read_bytes())
    given = 'inputs = { u = 1.0, "offset[*]" = 0.0 }'
    text = "step = 0.1\nstop = 1.0\n[components]\n" + "".join(
        f'{c} = {{ fmu = "{c}/gain.fmu", {given} }}\n' for c in "ab"
    )
    with open_ssp(export_ssp(parse_scenario(text, folder=tmp_path), fmus, tmp_path / "ab.ssp")) as scenario:
        plan = make_plan(scenario, fmus)
        assert [c.fmu.unit("u") for c in plan.components] == [None, "kPa"]


def test_what_ssp_cannot_say_is_refused_all_at_once(chain, fmus, tmp_path):
    more = """noise = { kind = "normal", amplitude = 0.1 }
dropout = { probability = 0.5 }
[[events]]
time = 0.5
component = "source"
set = { u = 1.0 }
"""
    with pytest.raises(ScenarioError) as error:
        export_ssp(chain(more=more), fmus, tmp_path / "no.ssp")
    lines = str(error.value).splitlines()
    assert [line.split(":")[1] for line in lines] == ["18", "16", "17"]
    assert [word in line for word, line in zip(("events", "noise", "dropout"), lines, strict=True)] == [True] * 3
    assert not (tmp_path / "no.ssp").exists()


def test_values_that_are_no_reals_must_be_the_fmus_own(fmus, tmp_path):
    more = "".join(
        f'<ScalarVariable name="{name}" valueReference="{90 + i}" causality="{causality}" variability="{variability}">'
        f"<{kind}/></ScalarVariable>"
        for i, (name, causality, variability, kind) in enumerate(
            (("on", "input", "discrete", 'Boolean start="true"'), ("file", "parameter", "fixed", 'String start="a"'))
        )
    )
    with zipfile.ZipFile(fmus / "gain.fmu") as old, zipfile.ZipFile(tmp_path / "typed.fmu", "w") as new:
        for member in old.namelist():
            new.writestr(member, old.read(member).replace(b"</ModelVariables>", f"{more}</ModelVariables>".encode()))
    text = """step = 0.1
stop = 1.0
[components.c]
fmu = "typed"
parameters = {{ file = "{}" }}
inputs = {{ u = 1.0, "offset[*]" = 0.0, on = {} }}
"""
    with open_ssp(export_ssp(parse_scenario(text.format("a", "true")), tmp_path, tmp_path / "ok.ssp")) as scenario:
        assert scenario.components["c"].inputs["on"] is True
    with pytest.raises(ScenarioError) as error:
        export_ssp(parse_scenario(text.format("b", "false")), tmp_path, tmp_path / "no.ssp")
    assert "c.file = 'b' is a String, and only Reals can be given" in str(error.value)
    assert "c.on = False is a Boolean" in str(error.value)
    assert "Leave it at the FMU's start value, 'true'." in str(error.value)


def test_the_command_writes_what_run_reads(fmus, tmp_path):
    (tmp_path / "chain.toml").write_text(CHAIN)
    call = lambda *arguments: CliRunner().invoke(app, [str(a) for a in arguments])  # noqa: E731
    written = call("export-ssp", tmp_path / "chain.toml", "--fmus", fmus, "--out", tmp_path / "chain.ssp")
    assert (written.exit_code, written.stdout) == (0, f"{tmp_path / 'chain.ssp'}\n"), written.stderr
    assert written.stderr.startswith("packed: integrator, gain (runs in Python, for ")
    for source in ("toml", "ssp"):
        out = ("--fmus", fmus, "--out", tmp_path / source, "--no-pictures", "--step", 0.25)
        result = call("run", tmp_path / f"chain.{source}", *out)
        assert result.exit_code == 0, result.stderr
    assert (tmp_path / "ssp/results.csv").read_bytes() == (tmp_path / "toml/results.csv").read_bytes()


def test_an_ssp_is_not_written_over_its_scenario_nor_under_another_ending_nor_over_a_folder(fmus, tmp_path):
    (tmp_path / "folder.ssp").mkdir()
    path = export_ssp(parse_scenario(CHAIN), fmus, tmp_path / "chain.ssp")
    before = path.read_bytes()
    for out, message in (
        ("chain.ssp", "chain.ssp is the scenario itself. Name another file with --out."),
        ("chain.toml", "its name must end in .ssp"),
        ("folder.ssp", "it is a folder. Name a file in it with --out."),
    ):
        command = ("export-ssp", path, "--fmus", fmus, "--out", tmp_path / out)
        result = CliRunner().invoke(app, [str(a) for a in command])
        assert (result.exit_code, result.stdout) == (1, "")
        assert message in result.stderr
        assert "Errno" not in result.stderr
    assert path.read_bytes() == before


def test_an_archive_that_cannot_be_finished_leaves_nothing(tmp_path):
    with pytest.raises(TypeError):
        archive.write_archive(tmp_path / "a.ssp", {"one": b"1", "two": None})
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(OrchestratorError, match=r"cannot write [^\[]* Name another place with --out."):
        archive.write_archive(tmp_path / "file/a.ssp", {})


# what others write


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


def test_step_and_stop_come_from_the_command_if_it_names_them(make):
    path = make(system(component("a", "gain")))
    with open_ssp(path, step=0.25, stop=2.0) as scenario:
        assert (scenario.step, scenario.start, scenario.stop, scenario.title) == (0.25, 0.0, 2.0, "Not ours")


def test_without_times_those_of_the_fmus_are_taken_and_said(make, fmus, caplog):
    path = make(system(component("a", "a") + component("b", "b")), rest="")
    message = r"other.ssp: neither it nor its FMUs state a step. Name one with --step"
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
    assert "states no step: 0.25 s, the smallest of its FMUs" in caplog.text
    assert "states no stop time: 4 s, from its FMUs" in caplog.text
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


def test_a_value_in_another_unit_is_converted(make):
    path = make(system(component("m", "metre", GAIN, bindings(SSV.format(real("u", 2.0, ' unit="km"'))))))
    assert last(path, "m.y") == 2000.0


INNER = f"""<System name="inner">{
    system(
        component("gain", "gain", GAIN, bindings(SSV.format(real("factor", 2.0) + real("offset[1]", 1.0)))),
        connection("in", "gain.u") + connection("gain.y", "out"),
        connector("in", "input") + connector("out", "output"),
        bindings(SSV.format(real("gain.factor", 5.0))),
    )
}</System>"""
NESTED = system(
    INNER + component("sum", "integrator", SUM),
    connection("drive", "inner.in") + connection("inner.out", "sum.u", '<c:LinearTransformation factor="1"/>'),
    connector("drive", "input"),
    bindings(SSV.format(real("drive", 3.0) + real("inner.gain.factor", 7.0))),
)


def test_nested_systems_are_flattened_and_higher_levels_override_lower_ones(make):
    assert last(make(NESTED), "sum.y") == pytest.approx(7.0 * 3.0 + 1.0, rel=1e-14)


def test_a_mapping_renames_and_transforms_and_leaves_the_rest(make):
    mapping = """<ParameterMapping><m:ParameterMapping version="1.0">
      <m:MappingEntry source="gain.k" target="gain.factor"><c:LinearTransformation factor="2" offset="1"/></m:MappingEntry>
      </m:ParameterMapping></ParameterMapping>"""
    values = bindings(SSV.format(real("k", 4.0) + real("u", 2.0)), ' prefix="gain."', mapping)
    assert last(make(system(component("gain", "gain", GAIN), more=values)), "gain.y") == 18.0


@pytest.mark.parametrize("element", ['FixedStepAlgorithm baseStepSize="0.2"', 'FixedStepMaster stepSize="0.2"'])
def test_the_step_may_stand_in_an_annotation_of_libcosim_or_omsimulator(make, element):
    annotation = f'<Annotations><c:Annotation type="any"><x:{element} xmlns:x="any"/></c:Annotation></Annotations>'
    path = make(
        system(component("a", "gain")), rest=f'<DefaultExperiment stopTime="1">{annotation}</DefaultExperiment>'
    )
    with open_ssp(path) as scenario:
        assert scenario.step == 0.2


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
    assert "there is no 'gain.facter' to give a value to" in caplog.text


def test_a_mapping_of_a_value_that_is_not_given_is_told(make, caplog):
    mapping = """<ParameterMapping><m:ParameterMapping version="1.0"><m:MappingEntry source="l" target="u"/>
      </m:ParameterMapping></ParameterMapping>"""
    last(make(system(component("m", "metre", GAIN, bindings(SSV.format(real("k", 4.0)), "", mapping)))), "m.y")
    assert "has no 'l' to give to 'u'; it is ignored" in caplog.text


@pytest.mark.parametrize("factor", ["0", "INF", "NaN"])
def test_a_unit_that_converts_nothing_is_refused(make, factor):
    given = SSV.format(real("u", 2.0, ' unit="km"')).replace('factor="1000"', f'factor="{factor}"')
    path = make(system(component("m", "metre", GAIN, bindings("", ' source="s.ssv"'))), files={"s.ssv": given})
    with pytest.raises(ScenarioError, match=r"unit 'km' has the factor"), open_ssp(path, step=0.1):
        pass


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


def test_a_circle_without_an_order_gets_one(make, caplog):
    elements = component("delay", "delay", connector("last_u", "output") + SUM) + component("gain", "gain", GAIN)
    path = make(system(elements, connection("delay.last_u", "gain.u") + connection("gain.y", "delay.u")))
    last(path, "gain.y")
    assert "they step in the order delay, gain" in caplog.text


# what is refused

TWO = component("a", "gain", GAIN) + component("b", "gain", GAIN)
REFUSALS = {
    "no FMU inside": (system(component("a", "nowhere")), "source of component 'a' is 'resources/nowhere.fmu', which is not"),
    "a path that leaves": (system(component("a", "../../gain")), "which is not in the archive"),
    "no FMU at all": (system(""), "it holds no FMU"),
    "another kind": (
        system('<Component name="a" source="x.ssp" type="application/x-ssp-package"/>'),
        "component 'a' is no FMU but 'application/x-ssp-package'",
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
        (
            ' startConnector="y"',
            "",
            r"missing required attribute 'startConnector' \(at /ssd:SystemStructureDescription/",
        ),
        ('<Component name="a" ', "<Component ", "missing required attribute"),
        ('factor="2"', 'factor="two"', r"attribute factor='two': .*/ssd:Connection/ssc:LinearTransformation\)"),
        ('value="1.0"', "", "parameter binding of component 'a': 'u' is None, which is no Real"),
    ],
)
def test_what_the_schema_forbids_is_refused_with_its_place(make, old, new, reason):
    wire = connection("a.y", "b.u", '<c:LinearTransformation factor="2"/>')
    content = system(
        component("a", "gain", GAIN, bindings(SSV.format(real("u", 1.0)))) + component("b", "gain", GAIN), wire
    )
    assert old in content
    with pytest.raises(ScenarioError, match=reason), open_ssp(make(content.replace(old, new, 1)), step=0.1):
        pass


@pytest.mark.parametrize(
    "declaration",
    ['<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">', '<!ENTITY b SYSTEM "file:///etc/hostname">', ""],
)
@pytest.mark.parametrize("where", ["SystemStructure.ssd", "set.ssv"])
def test_a_document_type_definition_is_refused_in_every_file(make, declaration, where):
    doctype = f"<!DOCTYPE x [{declaration}]>"
    ssd, ssv = SSD, SSV.format(real("u", 1.0))
    if where == "set.ssv":
        ssv = doctype + ssv
    else:
        ssd = ssd.replace("<SystemStructureD", doctype + "<SystemStructureD", 1)
    path = make(
        system(component("a", "gain", GAIN, bindings("", ' source="set.ssv"'))), files={"set.ssv": ssv}, ssd=ssd
    )
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


def raw(path: Path, *names: str, mode: int = 0o644) -> Path:
    with zipfile.ZipFile(path, "w") as file:
        for name in names:
            member = zipfile.ZipInfo(name)
            member.external_attr = mode << 16
            file.writestr(member, "x" * 100)
    return path


@pytest.mark.parametrize("name", ["../evil", "/etc/evil", "a\\b", "C:evil"])
def test_an_archive_that_leaves_its_folder_is_refused(tmp_path, name):
    with (
        pytest.raises(ScenarioError, match="would be written outside its folder"),
        open_ssp(raw(tmp_path / "a.ssp", name)),
    ):
        pass


def test_a_link_is_refused(tmp_path):
    path = raw(tmp_path / "a.ssp", "SystemStructure.ssd", mode=stat.S_IFLNK | 0o777)
    with pytest.raises(ScenarioError, match=r"'SystemStructure.ssd' is a link"), open_ssp(path):
        pass


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("second", ["a/b", "a//b", "./a/b"])
def test_a_member_that_is_there_twice_is_refused(tmp_path, second):
    path = raw(tmp_path / "a.ssp", "SystemStructure.ssd", "a/b", second)
    with pytest.raises(ScenarioError, match=f"{second!r} is there twice"), open_ssp(path):
        pass


def test_an_encrypted_member_is_refused(tmp_path):
    path = raw(tmp_path / "a.ssp", "SystemStructure.ssd")
    data = bytearray(path.read_bytes())
    data[data.index(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(data)
    with pytest.raises(ScenarioError, match=r"'SystemStructure.ssd' is encrypted"), open_ssp(path):
        pass


def test_a_member_larger_than_it_says_is_refused(tmp_path):
    path = raw(tmp_path / "a.ssp", "SystemStructure.ssd")
    data = bytearray(path.read_bytes())
    at = data.index(b"PK\x01\x02") + 24
    data[at : at + 4] = (10).to_bytes(4, "little")
    path.write_bytes(data)
    with pytest.raises(ScenarioError, match=r"a.ssp cannot be unpacked: Bad CRC-32"), open_ssp(path):
        pass


def test_a_bomb_is_refused_by_what_it_says_and_by_what_comes_out(tmp_path, monkeypatch):
    path = raw(tmp_path / "a.ssp", "SystemStructure.ssd", "b")
    monkeypatch.setattr(archive, "MAX_BYTES", 150)
    with pytest.raises(ScenarioError, match="It is not unpacked"), open_ssp(path):
        pass
    with pytest.raises(ScenarioError, match="come out of it"):
        archive.unpack(path, tmp_path / "x", failure=ScenarioError)


def test_a_file_that_is_no_ssp_is_refused(tmp_path):
    (tmp_path / "a.ssp").write_text("no archive")
    with pytest.raises(ScenarioError, match=r"a.ssp is no SSP. It is text."), open_ssp(tmp_path / "a.ssp"):
        pass
    with pytest.raises(ScenarioError, match=r"it holds no SystemStructure.ssd"), open_ssp(raw(tmp_path / "b.ssp", "x")):
        pass
    with pytest.raises(ScenarioError, match="there is no scenario file"):
        find_scenario("nowhere.ssp")

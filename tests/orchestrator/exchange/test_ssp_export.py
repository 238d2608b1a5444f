"""A scenario written as an SSP archive comes back as it was; what SSP cannot express is refused."""

from __future__ import annotations

import zipfile

import gossamer
import pytest
from command_line import invoke
from gossamer_orchestrator import ScenarioError, export_ssp, make_plan, open_ssp, parse_scenario, run_scenario
from gossamer_orchestrator.scenario.source import shipped_scenarios
from state_spaces import state_spaces

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


@pytest.mark.parametrize(("inputs", "origin", "target"), [
    ("", "a.y", "b.u"),
    ('"u[1]" = 5.0, "u[3]" = 6.0', "a.y[3]", "b.u[2]"),
])  # fmt: skip
def test_arrays_of_fmi_3_come_back_with_the_same_results(reference_fmus, tmp_path, caplog, inputs, origin, target):
    text = state_spaces(inputs, stop=0.5) + f'[[connections]]\nfrom = "{origin}"\nto = "{target}"\n'
    scenario = parse_scenario(text, name="arrays.toml")
    path = export_ssp(scenario, reference_fmus, tmp_path / "arrays.ssp")
    assert "StateSpace3: SSP 1.0 has no arrays, so those of FMI 3.0 are written element by element" in caplog.text
    assert run_scenario(path, tmp_path).equals(run_scenario(scenario, reference_fmus))


def test_sizes_of_arrays_of_fmi_3_must_be_the_fmus_own(reference_fmus, tmp_path):
    text = state_spaces("u = [0, 0, 0]", more=", r = 2", stop=0.5).replace(
        "[[0, 0, 0], [0, 0, 0], [0, 0, 0]]", "[[0, 0, 0], [0, 0, 0]]"
    )
    with pytest.raises(
        ScenarioError, match=r"a.r = 2 is a UInt64, but other tools read only Reals from an SSP. Leave it at"
    ):
        export_ssp(parse_scenario(text), reference_fmus, tmp_path / "no.ssp")


def test_a_group_comes_back(fmus, tmp_path):
    text = CHAIN.replace('order = ["source", "sink"]\n', "") + '[[groups]]\ncomponents = ["source", "sink"]\nsweeps = 7\n'
    scenario = parse_scenario(text, name="chain.toml")
    with open_ssp(export_ssp(scenario, fmus, tmp_path / "chain.ssp")) as again:
        assert again.groups == scenario.groups


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
    text = "step = 0.1\nstop = 1.0\n[components]\n" + "".join(f'{c} = {{ fmu = "{c}/gain.fmu", {given} }}\n' for c in "ab")
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
    assert "c.file = 'b' is a String, but other tools read only Reals" in str(error.value)
    assert "c.on = False is a Boolean" in str(error.value)
    assert "Leave it at the FMU's start value, 'true'." in str(error.value)


def test_the_command_writes_what_run_reads(fmus, tmp_path):
    (tmp_path / "chain.toml").write_text(CHAIN)
    call = lambda *arguments: invoke([str(a) for a in arguments])  # noqa: E731
    written = call("export-ssp", tmp_path / "chain.toml", "--fmus", fmus, "--out", tmp_path / "chain.ssp")
    assert (written.exit_code, written.stdout) == (0, f"{tmp_path / 'chain.ssp'}\n"), written.stderr
    assert written.stderr.startswith("packed: integrator, gain (in Python, on ")
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
        ("chain.ssp", "chain.ssp, which is an input. Name another place with --out."),
        ("chain.toml", "its name must end in .ssp"),
        ("folder.ssp", "it is a folder. Name a file in it with --out."),
    ):
        command = ("export-ssp", path, "--fmus", fmus, "--out", tmp_path / out)
        result = invoke([str(a) for a in command])
        assert (result.exit_code, result.stdout) == (1, "")
        assert message in result.stderr
        assert "Errno" not in result.stderr
    assert path.read_bytes() == before


def test_an_ssp_is_not_run_over_the_results_of_the_scenario_that_it_was_made_of(fmus, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "chain.toml").write_text(CHAIN)
    export_ssp(parse_scenario(CHAIN, name="chain.toml"), fmus, tmp_path / "chain.ssp")
    for name in ("chain.toml", "chain.ssp"):
        result = invoke(["run", name, "--fmus", str(fmus), "--no-pictures"])
        assert result.exit_code == 0, result.stderr
    assert sorted(path.parent.name for path in (tmp_path / "out").glob("*/results.nc")) == ["chain", "chain_ssp"]


def test_a_shipped_scenario_that_ssp_cannot_hold_is_to_be_copied(built):
    folder = str(built("python")["sensor"].parent)
    refused = invoke(["export-ssp", "damage_begins", "--fmus", folder])
    assert refused.exit_code == 1
    assert ": SSP has no events." in refused.stderr
    assert f"ships with Gossamer as {shipped_scenarios()['damage_begins']}." in refused.stderr


def test_what_ssp_does_not_have_can_be_left_behind_and_is_named(fmus, tmp_path, caplog):
    noise = 'bias = 1.0\nnoise = { kind = "normal", amplitude = 0.1 }\ndropout = { probability = 0.1 }\n'
    event = '[[events]]\ntime = 1.0\ncomponent = "source"\nset = { u = 3.0 }\n'
    (tmp_path / "noisy.toml").write_text(CHAIN.replace("bias = 1.0\n", noise) + event)
    given = {"scenario": tmp_path / "noisy.toml", "fmus": fmus, "out": tmp_path / "a.ssp"}
    with pytest.raises(ScenarioError, match=r"SSP has no noise in its connections") as refused:
        gossamer.export_ssp(**given)
    assert refused.value.__notes__ == ["without='noise,dropout,events' writes the rest."]
    with pytest.raises(ScenarioError, match=r"'gain' cannot be left behind. Name some of noise, dropout, events."):
        gossamer.export_ssp(**given, without="gain")
    written = gossamer.export_ssp(**given, without=["noise", "dropout", "events"])
    ends = "source.y -> sink.u"
    assert f"this stays behind: noise of {ends}, dropout of {ends}, event at 1 s" in caplog.text
    with open_ssp(written) as scenario:
        left = run_scenario(scenario, fmus)
    assert left["sink.y"].equals(run_scenario(parse_scenario(CHAIN), fmus)["sink.y"])

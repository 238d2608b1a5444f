"""The whole chain as one FMU: its trajectories in other hosts are the orchestrator's, bit for bit."""

from __future__ import annotations

import json
import platform
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
from command_line import invoke
from fmpy.validation import validate_fmu
from gossamer_orchestrator import OrchestratorError, ScenarioError, build_container, load_scenario, parse_scenario
from gossamer_orchestrator.names import split_indices
from gossamer_orchestrator.scenario.source import find_scenario
from simulated import simulate as simulate_here

HOST = Path(__file__).with_name("container_host.py")
SCENARIO = find_scenario("damaged")
WATCHED = [
    "membrane.strain[2]",
    "membrane.deflection",
    "sensor1.resistance",
    "compensator4.strain",
    *(f"detector.damage[{i}]" for i in range(1, 17)),
    "detector.valid",
]
RING = """
step = 0.5
stop = 4.0
{master}
[components]
Early = {{ fmu = "delay" }}
gain = {{ fmu = "gain", inputs = {{ "offset[*]" = 0.25 }}, parameters = {{ factor = -1.5 }} }}
[[connections]]
from = "gain.y"
to = "Early.u"
[[connections]]
from = "Early.last_u"
to = "gain.u"
"""
REFUSED = """noise = { kind = "normal", amplitude = 0.1 }
gain = 2.0
[[events]]
time = 0.5
component = "source"
set = { u = 1.0 }
"""


@pytest.fixture(scope="module")
def chain_fmus(built):
    return built("native")["sensor"].parent


@pytest.fixture(scope="module", params=[2, 3], ids=["FMI 2", "FMI 3"])
def container(request, chain_fmus):
    return build_container(load_scenario(SCENARIO), chain_fmus, chain_fmus / f"all{request.param}.fmu", fmi=request.param)


@pytest.fixture
def simulate(tmp_path):
    def run(host, fmu, scenario, watched=WATCHED, every=1, **start):
        if host == "libcosim" and (platform.system() not in ("Linux", "Windows") or platform.machine() == "aarch64"):
            pytest.skip("libcosimpy has no binaries for this machine")
        steps = {"step": every * scenario.step, "ticks": scenario.ticks // every}
        job = {"host": host, "fmu": str(fmu), "watched": watched, **steps}
        (tmp_path / "job.json").write_text(json.dumps(job | {"start": start}))
        command = [sys.executable, HOST, tmp_path / "job.json", tmp_path / "table.npy"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
        assert (tmp_path / "table.npy").exists(), done.stdout + done.stderr
        return np.load(tmp_path / "table.npy")

    return run


def own(scenario, fmus, watched=WATCHED):
    """The orchestrator's trajectories."""
    data = simulate_here(scenario, fmus)
    columns = []
    for name in watched:
        base, index = split_indices(name)
        columns.append(data[base].isel({data[base].dims[1]: index[0] - 1}) if index else data[base])
    return np.column_stack(columns)


def short(damage=0.4):
    """The first 150 steps of the scenario, with another damage in zone 1."""
    text = SCENARIO.read_text()
    for old, new in (('"damage[1]" = 0.4', f'"damage[1]" = {damage}'), ("stop = 0.2532", "stop = 0.045")):
        assert old in text
        text = text.replace(old, new)
    return parse_scenario(text, name="damaged.toml")


def test_fmpy_gives_the_trajectories_of_the_orchestrator_to_the_last_bit(container, chain_fmus, simulate):
    scenario = load_scenario(SCENARIO)
    expected = own(scenario, chain_fmus)
    assert expected[-1, 4] == pytest.approx(0.4, abs=0.01)  # the detector has judged
    assert np.array_equal(simulate("fmpy", container, scenario), expected)


def test_libcosim_gives_the_trajectories_of_the_orchestrator_to_the_last_bit(chain_fmus, simulate):
    scenario = short()
    fmu = build_container(scenario, chain_fmus, chain_fmus / "cosim.fmu")
    assert np.array_equal(simulate("libcosim", fmu, scenario), own(scenario, chain_fmus))


def test_a_host_may_take_longer_steps(chain_fmus, simulate):
    scenario = short()
    fmu = build_container(scenario, chain_fmus, chain_fmus / "long.fmu")
    assert np.array_equal(simulate("fmpy", fmu, scenario, every=3), own(scenario, chain_fmus)[::3])


def test_a_container_runs_under_the_orchestrator_too(chain_fmus):
    scenario = short()
    build_container(scenario, chain_fmus, chain_fmus / "again.fmu")
    text = f"""
    step = {scenario.step}
    stop = {scenario.stop}
    [components.all]
    fmu = "again"
    inputs = {{ "membrane.*" = 0.0, "membrane.damage[1]" = 0.4 }}
    """
    outer = own(parse_scenario(text), chain_fmus, [f"all.{name}" for name in WATCHED])
    assert np.array_equal(outer, own(scenario, chain_fmus))


@pytest.mark.parametrize("host", ["fmpy", "libcosim"])
@pytest.mark.parametrize("before", [0.0, 0.4])
def test_a_value_that_the_host_sets_replaces_that_of_the_scenario(chain_fmus, simulate, host, before):
    fmu = build_container(short(before), chain_fmus, chain_fmus / "set.fmu")
    expected = own(short(0.2), chain_fmus)
    assert np.array_equal(simulate(host, fmu, short(0.2), **{"membrane.damage[1]": 0.2}), expected)


def test_a_host_of_fmi_3_can_replace_values_that_are_the_fmus_own(chain_fmus, simulate):
    fmu = build_container(short(0.0), chain_fmus, chain_fmus / "set3.fmu", fmi=3)
    expected = own(short(0.2), chain_fmus)
    assert np.array_equal(simulate("fmpy", fmu, short(0.2), **{"membrane.damage[1]": 0.2}), expected)


def test_a_container_is_a_valid_fmu_with_units_ranges_and_start_values(container):
    assert validate_fmu(str(container)) == []
    description = fmpy.read_model_description(str(container))
    variables = {v.name: v for v in description.modelVariables}
    inputs = {v.name: float(v.start) for v in variables.values() if v.causality == "input"}
    optional = {name for name, v in variables.items() if v.declaredType is not None and v.declaredType.name == "optional"}
    assert optional == {
        *(f"compensator{k}.{name}" for k in range(1, 5) for name in ("known", "known_strain", "temperature")),
        *(f"sensor{k}.temperature" for k in range(1, 5)),
    }
    assert {name: start for name, start in inputs.items() if name not in optional} == {
        "membrane.pressure": 0.0,
        "membrane.base_acceleration": 0.0,
        **{f"membrane.damage[{i}]": 0.4 if i == 1 else 0.0 for i in range(1, 17)},
    }
    assert not [v for v in variables.values() if v.causality == "parameter"]
    outputs = {v.name for v in variables.values() if v.causality == "output"}
    assert set(WATCHED) <= outputs
    assert outputs == {unknown.variable.name for unknown in description.outputs}
    assert variables["membrane.pressure"].unit == "Pa"
    assert (float(variables["membrane.damage[1]"].min), variables["sensor1.resistance"].unit) == (0.0, "ohm")
    pascal = next(unit.baseUnit for unit in description.unitDefinitions if unit.name == "Pa")
    assert (pascal.kg, pascal.m, pascal.s) == (1, -1, -2)
    assert (float(description.defaultExperiment.stepSize), description.license) == (3e-4, "BSD-3-Clause")
    assert description.description.startswith("40 % damage in zone 1: membrane (membrane), sensor1 (sensor)")


def test_the_same_scenario_gives_the_same_bytes_and_another_another_identifier(fmus, chain, tmp_path):
    first, second = (build_container(chain(), fmus, tmp_path / f / "c.fmu").read_bytes() for f in "ab")
    assert first == second
    build_container(chain(("u = 2.0", "u = 3.0")), fmus, tmp_path / "d/c.fmu")
    guids = {fmpy.read_model_description(str(tmp_path / f / "c.fmu")).guid for f in "ad"}
    assert len(guids) == 2


def test_what_nobody_receives_is_an_output_and_what_is_received_and_not_recorded_is_not(fmus, chain, tmp_path):
    fmu = build_container(chain(more='[record]\nvariables = ["integral.y"]\n'), fmus, tmp_path / "c.fmu")
    causalities = {v.name: v.causality for v in fmpy.read_model_description(str(fmu)).modelVariables}
    assert (causalities["integral.y"], causalities["source.y"]) == ("output", "local")


@pytest.mark.parametrize("master", ['order = ["Early", "gain"]', 'order = ["gain", "Early"]', 'master = "jacobi"'])
def test_a_feedback_runs_in_the_order_of_the_scenario(fmus, tmp_path, simulate, master):
    scenario = parse_scenario(RING.format(master=master))
    watched = ["Early.last_u", "gain.y"]
    expected = own(scenario, fmus, watched)
    assert len(set(expected[:, 1])) > 3
    fmu = build_container(scenario, fmus, tmp_path / "ring.fmu")
    assert np.array_equal(simulate("fmpy", fmu, scenario, watched), expected)


def test_what_a_container_cannot_do_is_refused_all_at_once(fmus, chain, tmp_path):
    with pytest.raises(ScenarioError) as error:
        build_container(chain(more=REFUSED), fmus, tmp_path / "no.fmu")
    lines = str(error.value).splitlines()
    assert [line.split(":")[1] for line in lines] == ["18", "17", "16"]
    assert [word in line for word, line in zip(("events", "gain", "noise"), lines, strict=True)] == [True] * 3
    assert not (tmp_path / "no.fmu").exists()


def test_a_group_is_refused(fmus, chain, tmp_path):
    group = '[[groups]]\ncomponents = ["source", "integral"]\n'
    with pytest.raises(ScenarioError, match=r"a container steps each FMU once, and has no groups. Remove the group."):
        build_container(chain(more=group), fmus, tmp_path / "no.fmu")


@pytest.mark.parametrize("name", ["my chain.fmu", "1st.fmu", "größe.fmu"])
def test_a_name_that_no_binary_can_have_is_refused(fmus, chain, tmp_path, name):
    with pytest.raises(ScenarioError, match=r"cannot be the name of an FMU's binary. Use letters"):
        build_container(chain(), fmus, tmp_path / name)


def test_gain_and_bias_that_change_nothing_are_accepted(fmus, chain, tmp_path):
    fmu = build_container(chain(more="gain = 1.0\nbias = 0.0\n"), fmus, tmp_path / "c.fmu")
    assert fmu.is_file()


def test_another_ending_or_one_of_its_own_fmus_is_refused(fmus, chain, tmp_path):
    with pytest.raises(OrchestratorError, match=r"c.toml: its name must end in .fmu"):
        build_container(chain(), fmus, tmp_path / "c.toml")
    before = (fmus / "gain.fmu").read_bytes()
    with pytest.raises(ScenarioError, match=r"gain.fmu is one of the scenario's FMUs. Name another file"):
        build_container(chain(), fmus, fmus / "gain.fmu")
    assert (fmus / "gain.fmu").read_bytes() == before


def test_another_fmi_is_refused(fmus, chain, tmp_path):
    with pytest.raises(ScenarioError, match=r"FMI 2 or 3 outside, not 4"):
        build_container(chain(), fmus, tmp_path / "c.fmu", fmi=4)


def test_the_command_prints_the_path(fmus, tmp_path):
    (tmp_path / "ring.toml").write_text(RING.format(master='order = ["gain", "Early"]'))
    arguments = ["container", tmp_path / "ring.toml", "--fmus", fmus, "--out", tmp_path / "ring.fmu", "--fmi", 3]
    result = invoke([str(a) for a in arguments])
    assert (result.exit_code, result.stdout) == (0, f"{tmp_path / 'ring.fmu'}\n"), result.stderr
    assert result.stderr.startswith("packed: delay, gain (in Python, on ")
    assert fmpy.read_model_description(str(tmp_path / "ring.fmu")).fmiVersion == "3.0"


def test_noise_and_events_can_be_left_behind_and_the_rest_is_the_container_of_a_scenario_without_them(fmus, tmp_path):
    ring = RING.format(master='order = ["gain", "Early"]')
    noise = 'noise = { kind = "normal", amplitude = 0.1 }\n'
    first = ring.index("[[connections]]") + len("[[connections]]\n")
    (tmp_path / "noisy.toml").write_text(ring[:first] + noise + ring[first:])
    (tmp_path / "calm.toml").write_text(ring)
    arguments = ["container", tmp_path / "noisy.toml", "--fmus", fmus, "--out", tmp_path / "out/noisy.fmu"]
    refused = invoke(arguments)
    assert (refused.exit_code, (tmp_path / "out/noisy.fmu").exists()) == (1, False)
    assert "--without noise writes the rest." in refused.stderr
    done = invoke([*arguments, "--without", "noise,events", "--json"])
    assert (done.exit_code, json.loads(done.stdout)) == (0, {"file": str(tmp_path / "out/noisy.fmu")})
    assert "this stays behind: noise of" in done.stderr
    assert invoke(["container", tmp_path / "calm.toml", "--fmus", fmus, "--out", tmp_path / "calm.fmu"]).exit_code == 0
    written, calm = (fmpy.read_model_description(str(tmp_path / name)) for name in ("out/noisy.fmu", "calm.fmu"))
    assert [(v.name, v.start) for v in written.modelVariables] == [(v.name, v.start) for v in calm.modelVariables]


def test_nothing_is_printed(fmus, chain, tmp_path, capfd, caplog):
    build_container(chain(), fmus, tmp_path / "c.fmu")
    assert capfd.readouterr() == ("", "")
    assert [record for record in caplog.records if record.levelname != "INFO"] == []

"""Time-based clocks of FMI 3.0 tick at their times, whatever the steps are; others are refused by name.

``Ticking`` is strict: what belongs to a clock can be read and set only while that is active. See its header for its clocks.
"""

from __future__ import annotations

import zipfile

import pytest
from gossamer_orchestrator import (
    ScenarioError,
    Simulation,
    SimulationError,
    build_container,
    export_ssp,
    make_plan,
    open_ssp,
    parse_scenario,
    run_scenario,
)

LAST = {"sampled": (3.0, 10), "fixed": (0.875, 4), "tuned": (1.0, 7), "changed": (1.0, 4), "counted": (0.53, 1)}


def alone(fmu="Ticking3", step=0.01, more=""):
    return parse_scenario(f'step = {step}\nstop = 1.0\n{more}[components.c]\nfmu = "{fmu}"\ninputs = {{ u = 3.0 }}\n')


def ends(data, name="c"):
    return {clock: (data[f"{name}.{clock}"].values[-1], data[f"{name}.n_{clock}"].values[-1]) for clock in LAST}


@pytest.fixture
def rewritten(reference_fmus, tmp_path):
    """Give the folder of a copy of an FMU with another model description."""

    def rewrite(name, old, new):
        with zipfile.ZipFile(reference_fmus / f"{name}.fmu") as source, zipfile.ZipFile(tmp_path / "c.fmu", "w") as copy:
            for member in source.namelist():
                data = source.read(member)
                copy.writestr(member, data.replace(old, new) if member.endswith(".xml") else data)
        return tmp_path

    return rewrite


@pytest.mark.parametrize("step", [0.01, 0.1, 0.25])
@pytest.mark.parametrize("kind", ["reference_fmus", "exchange_fmus"])
def test_every_clock_ticks_at_its_times_whatever_the_step(request, kind, step):
    found = ends(run_scenario(alone(step=step), request.getfixturevalue(kind)))
    assert found == {clock: (pytest.approx(time, abs=1e-9), n) for clock, (time, n) in LAST.items()}


def test_what_belongs_to_a_clock_keeps_its_value_between_ticks(reference_fmus):
    """The fixed one ticks every p from p / 2 on; its output is the time of the tick, and 0 before the first."""
    data = run_scenario(alone(), reference_fmus)
    t = data.time.values
    assert data["c.fixed"].values == pytest.approx([max(0.0, ((x + 1e-9 - 0.125) // 0.25) * 0.25 + 0.125) for x in t])


def test_a_tick_at_a_communication_point_takes_what_has_arrived_there(reference_fmus):
    more = '[components]\na = { fmu = "Ticking3", inputs = { u = 0 } }\nb = { fmu = "Ticking3" }\n'
    wire = '[[connections]]\nfrom = "a.v"\nto = "b.u"\n'
    for master, late in (("gauss-seidel", 0.0), ("jacobi", 0.01)):
        text = f'step = 0.01\nstop = 0.5\nmaster = "{master}"\n{more}{wire}'
        assert run_scenario(parse_scenario(text), reference_fmus)["b.sampled"].values[-1] == pytest.approx(0.45 - late)


def test_an_event_of_the_scenario_waits_for_the_tick(reference_fmus):
    event = '[[events]]\ntime = 0.51\ncomponent = "c"\nset = { u = 7.0 }\n'
    data = run_scenario(parse_scenario(alone().source.text + event), reference_fmus)
    assert data["c.sampled"].sel(time=[0.54, 0.55], method="nearest").values.tolist() == [3.0, 7.0]


def test_steps_that_are_taken_back_take_the_ticks_back(reference_fmus):
    """Step control does every step twice."""
    found = run_scenario(alone(step=0.1, more="step_control = { tolerance = 1e-6 }\n"), reference_fmus)
    assert ends(found) == ends(run_scenario(alone(step=0.1), reference_fmus))


def test_a_text_of_a_clock_lasts_until_its_next_tick(reference_fmus):
    with Simulation(make_plan(alone(), reference_fmus)) as simulation:
        port = simulation.member("c").instance.port(["text"], "String")
        seen = []
        for _ in range(12):
            simulation.step()
            simulation.member("c").instance.read(port)
            seen += port.get()
    assert seen == ["none"] * 9 + ["tick 4"] * 3


@pytest.mark.parametrize(("old", "new", "says"), [
    (b'"countdown"', b'"triggered"', "scenario:4: FMU 'c' has clocks that are triggered: clock_counted. Clocks"),
    (b'hasEventMode="true"', b"", "clocks that tick in event mode only, which it has not .*: clock_sampled, .* and 1 more"),
])  # fmt: skip
def test_other_clocks_are_refused_by_name(rewritten, old, new, says):
    with pytest.raises(ScenarioError, match=says):
        make_plan(alone("c"), rewritten("Ticking3", old, new))


def test_an_fmu_that_cannot_vary_its_step_is_stepped_to_the_ticks_only(rewritten):
    folder = rewritten("Ticking3", b'canHandleVariableCommunicationStepSize="true"', b"")
    assert ends(run_scenario(alone("c", step=0.005), folder))["tuned"][1] == 7
    with pytest.raises(SimulationError, match=r"clock 'clock_sampled' ticks at t = 0.05 s, inside the step to 0.1 s"):
        run_scenario(alone("c", step=0.1), folder)


def test_an_interval_that_is_none_is_refused_by_name(reference_fmus):
    scenario = parse_scenario(alone().source.text + "parameters = { p = -1.0 }\n")
    with pytest.raises(SimulationError, match=r"component 'c' gives its clock 'clock_fixed' the interval -1 s at t = 0 s"):
        run_scenario(scenario, reference_fmus)


@pytest.mark.parametrize(("what", "wrong"), [
    ("shiftDecimal", "-0.05"), ("shiftDecimal", "nan"), ("shiftDecimal", "soon"), ("shiftDecimal", "1/0"),
    ("intervalDecimal", "0.0"), ("intervalDecimal", "-0.1"), ("intervalDecimal", "inf"), ("intervalDecimal", ""),
])  # fmt: skip
def test_a_shift_or_an_interval_that_makes_no_sense_is_refused_by_the_name_of_its_clock(rewritten, what, wrong):
    right = {"shiftDecimal": "0.05", "intervalDecimal": "0.1"}[what]
    folder = rewritten("Ticking3", f'{what}="{right}"'.encode(), f'{what}="{wrong}"'.encode())
    with pytest.raises(SimulationError, match=r"clock 'clock_sampled' no interval above 0 s and no shift of 0 s or more"):
        run_scenario(alone("c"), folder)


def test_a_container_refuses_clocks_by_name_and_an_ssp_keeps_them(reference_fmus, tmp_path, caplog):
    with pytest.raises(ScenarioError, match=r"'Ticking3' has clocks, which a container does not tick: clock_sampled"):
        build_container(alone(), reference_fmus, tmp_path / "c.fmu")
    with open_ssp(export_ssp(alone(), reference_fmus, tmp_path / "c.ssp")) as again:
        assert ends(run_scenario(again, reference_fmus)) == ends(run_scenario(alone(), reference_fmus))
    assert "SSP keeps the clocks inside their FMUs, and not every tool ticks them: c.clock_sampled" in caplog.text

"""``gossamer watch``: alarms, onset and zones from a record; what it refuses."""

from __future__ import annotations

import json
import os
import pickle
import sys
from dataclasses import replace
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from command_line import invoke
from gossamer import LiveWatch
from gossamer.records import find_in_results
from gossamer.watched import Watching
from gossamer_models.batch import Batch
from gossamer_models.membrane import membrane_model, square_structure
from gossamer_models.twin import DamageOnset, Window
from gossamer_orchestrator import Recorder, Simulation, load_scenario, make_plan
from gossamer_orchestrator.results.dataset import make_dataset
from gossamer_orchestrator.results.files import unexplained
from gossamer_orchestrator.scenario.schema import Recording
from gossamer_orchestrator.scenario.source import shipped_scenarios
from reading_pages import read_page
from rich.console import Console

STEP, ONSET = 3e-4, 0.2104
ONE = np.ones(1)
# coarse, so that a window costs little; twin and truth have the same
MESH = ["--elements-per-side", "4", "--order", "1"]


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nine windows of noisy strain; zone 6 loses 30 % of its stiffness in the fifth."""
    batch = Batch(membrane_model(square_structure(4, 1)), [f"strain[{k}]" for k in range(1, 5)], ["damage[6]"])
    time = STEP * np.arange(1, 1504)
    strain = batch.run(time.size, STEP, inputs={"damage[6]": 0.3 * (time > ONSET)}).results[0]
    strain += np.random.default_rng(1).normal(0.0, 5e-4, strain.shape)
    path = tmp_path_factory.mktemp("watch") / "record.csv"
    head = ",".join(["time [ms]", *(f"strain[{k}] [%]" for k in range(1, 5))])
    np.savetxt(path, np.column_stack([1e3 * time, 100.0 * strain.T]), delimiter=",", header=head, comments="")
    return path


def test_a_run_that_is_resumed_is_watched_afterwards():
    result = invoke(["run", "damaged", "--watch", "--resume"])
    assert result.exit_code == 1
    assert result.stderr.startswith("--watch must see a run from its start.")


def test_an_alarm_is_printed_and_the_finding_written(record):
    for name in ("results.nc", "report.html"):  # as beside the record of a run
        record.with_name(name).touch()
    result = invoke(["watch", str(record), *MESH])
    _, charts = read_page(record.parent / "watch" / "report.html")
    assert {"Damage", "Evidence of new damage", "What the twin leaves unexplained", "Damage that is seen"} <= set(charts)
    assert result.exit_code == 0, result.output
    assert "ALARM" in result.stderr
    assert f"The page shows it: type 'gossamer view {record.parent}'." in " ".join(result.stderr.split())
    found = json.loads(Path(result.stdout.splitlines()[0]).read_text(encoding="utf-8"))
    assert "too few for a window: not judged." in result.stderr
    assert len(found["alarms"]) == 1
    assert 0.0 < found["alarms"][0] - ONSET < 0.1
    assert found["without"] == [[]] * len(found["time"])
    (finding,) = found["findings"]
    assert finding["onset"] == pytest.approx(ONSET, abs=5e-4)
    assert finding["damage"] == pytest.approx(0.3 * np.eye(16)[5], abs=0.03)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no named pipes in folders")
def test_lines_that_arrive_give_the_alarms_of_the_finished_file(record, tmp_path):
    noise = ["--noise", "5e-4"]
    assert invoke(["watch", str(record), *MESH, *noise, "--out", str(tmp_path / "whole.json")]).exit_code == 0
    os.mkfifo(tmp_path / "pipe")
    writer = Thread(target=lambda: (tmp_path / "pipe").write_text(record.read_text()))
    writer.start()
    result = invoke(["watch", str(tmp_path / "pipe"), *MESH, *noise, "--out", str(tmp_path / "live.json")])
    writer.join()
    assert result.exit_code == 0, result.output
    whole, live = (json.loads((tmp_path / f"{name}.json").read_text()) for name in ("whole", "live"))
    assert live["alarms"] == whole["alarms"] != []
    np.testing.assert_allclose(live["score"], whole["score"], rtol=1e-6)


def test_a_watch_that_is_blind_to_what_it_has_to_see_says_so(record, tmp_path):
    result = invoke(["watch", str(record), *MESH, "--see", "0.004", "--out", str(tmp_path / "watch.json")])
    assert result.exit_code == 3, result.output
    assert "The watch is blind to some damage: up to " in " ".join(result.stderr.split())
    found = json.loads((tmp_path / "watch.json").read_text(encoding="utf-8"))
    assert found["see"] == 0.004
    assert 0.004 < max(found["sees"]) < 0.1
    assert np.shape(found["score"]) == (len(found["time"]), 16)


def test_what_no_new_damage_explains_has_an_alarm_and_no_zones(record, tmp_path):
    """The twin's film contracts across its strain by less than that of the record: no unknown of the watch says so."""
    result = invoke(["watch", str(record), *MESH, "--set", "poisson_ratio=0.2", "--out", str(tmp_path / "watch.json")])
    assert result.exit_code == 3, result.output
    assert "Zones are withheld." in result.stderr
    found = json.loads((tmp_path / "watch.json").read_text(encoding="utf-8"))
    assert found["alarms"]
    assert found["findings"] == []


def judged_window(misfit=1.0, **known):
    return Window(sees=0.01 * ONE, misfit=misfit, mesh=0.0, left=np.ones(4), **known)


def onset(damage, chi2_per_sample=1.0, mesh=0.0):
    found = {"damage": damage * ONE, "deviation": 0.01 * ONE, "chi2_per_sample": chi2_per_sample, "mesh": mesh}
    return DamageOnset(zones=("rim",), onset=0.5, onset_deviation=0.1, chi2_bound=1.5, **found)


def test_a_window_between_others_that_the_twin_does_not_explain_is_not_passed_over(tmp_path):
    def after(*misfits, alarm=None):
        seen = Watching(files=[tmp_path / "watch.json"], zones=("rim",))
        for k, misfit in enumerate(misfits):
            seen.take(judged_window(time=k + 1.0, evidence=ONE, alarm=k == alarm, misfit=misfit), {}, Console(quiet=True))
        return seen

    assert after(1.0, 1.0, 1.0).exit_code() == after(1.0, 9.0, 3.0, 1.0, alarm=1).exit_code() == 0
    assert after(1.0, 1.0, 9.0, alarm=2).exit_code() == 3  # no fit has followed
    lost = after(1.0, 5.0, 9.0, 1.0)
    assert lost.exit_code() == 3
    assert (
        "The twin does not explain 2 of 4 windows, worst the one that ended at t = 3 s: chi2 per sample is 9."
        in lost.more()[1]
    )


def test_an_alarm_that_is_taken_back_is_said_to_be(tmp_path, capsys):
    seen, console = Watching(files=[tmp_path / "watch.json"], zones=("rim",)), Console(width=120)
    judged = judged_window(time=1.0, evidence=2.0 * ONE, alarm=True)
    seen.take(judged, {}, console)
    seen.take(replace(judged, time=2.0, alarm=False, finding=onset(0.0)), {}, console)
    assert "The alarm at t = 1.0000 s is taken back: by t = 2.0000 s no zone has more damage." in capsys.readouterr().out
    assert seen.exit_code() == 0


def test_a_finding_that_explains_the_readings_stands_in_place_of_one_that_did_not(tmp_path, capsys):
    seen, console = Watching(files=[tmp_path / "watch.json"], zones=("rim",)), Console(width=120)
    judged = judged_window(time=1.0, evidence=2.0 * ONE, alarm=True)
    seen.take(judged, {}, console)
    for time, chi2 in ((2.0, 3.0), (3.0, 2.0)):
        seen.take(replace(judged, time=time, alarm=False, finding=onset(0.3, chi2_per_sample=chi2)), {}, console)
    assert len(seen.withheld) == 1
    assert seen.exit_code() == 3
    seen.take(replace(judged, time=4.0, alarm=False, finding=onset(0.2)), {}, console)
    assert (seen.agreed, len(seen.findings), seen.withheld) == ([4.0], 1, [])
    assert seen.exit_code() == 0
    seen.take(replace(judged, time=5.0), {}, console)
    seen.take(replace(judged, time=6.0, alarm=False, finding=onset(0.3, mesh=0.3)), {}, console)
    assert "finer elements add 30 % of the change of the readings" in " ".join(capsys.readouterr().out.split())
    assert "Zones were withheld after an alarm" in seen.more()[1]
    assert seen.exit_code() == 3


def test_an_alarm_that_one_sensor_makes_is_no_damage(tmp_path, capsys):
    seen, console = Watching(files=[tmp_path / "watch.json"], zones=("rim",)), Console(width=200)
    judged = judged_window(time=1.0, evidence=2.0 * ONE, alarm=True)
    seen.take(judged, {}, console)
    seen.take(replace(judged, time=2.0, alarm=False, finding=onset(0.3, chi2_per_sample=9.0)), {}, console)
    seen.take(replace(judged, time=3.0, alarm=False, blamed=(3,), without=(3,)), {}, console)
    assert "no damage explains what sensor 3 reads, and the others show none" in " ".join(capsys.readouterr().out.split())
    assert (seen.alarms, seen.withheld, seen.faults) == ([], [], [{"sensor": 3, "alarm": 1.0, "time": 3.0}])
    assert "repeats" not in capsys.readouterr().out
    assert seen.content["faults"] == seen.faults


def test_windows_from_an_alarm_to_its_finding_or_its_sensor_are_explained():
    watched = {"time": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "misfit": [1.0, 9.0, 9.0, 9.0, 1.0, 9.0]}
    assert unexplained(watched | {"alarms": [2.0], "agreed": [4.0]}) == [5]
    assert unexplained(watched | {"alarms": [], "faults": [{"sensor": 1, "alarm": 2.0, "time": 4.0}]}) == [5]
    assert unexplained(watched | {"alarms": [2.0], "agreed": []}) == [3, 5]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--window", "0.001"], "needs 20 or more"),
        (["--window", "nan"], "--window is nan. Write a positive number."),
        (["--window", "0.4"], "less than two windows"),
        (["--see", "10"], "--see is 10. Write a damage between 0 and 1"),
        (["--set", "stiffness=1"], "no parameter 'stiffness'"),
    ],
)
def test_options_that_make_no_sense_are_refused(record, options, message):
    result = invoke(["watch", str(record), *MESH, *options])
    assert result.exit_code == 1
    assert message in result.stderr


def test_the_observer_of_a_run_can_be_sent_to_the_process_of_the_run(tmp_path):
    assert pickle.loads(pickle.dumps(LiveWatch(tmp_path / "watch.json")))._out == tmp_path / "watch.json"


@pytest.mark.parametrize("every", [1, 2])
def test_the_observer_hands_every_sample_to_the_twin_once(built, monkeypatch, tmp_path, every):
    scenario = load_scenario(shipped_scenarios()["damaged"], stop=0.18)
    variables = ["membrane.*", "sensor?.resistance", "detector.*"]
    scenario = scenario.model_copy(update={"record": Recording(variables=variables, every=every)})
    plan = make_plan(scenario, built("native")["sensor"].parent)
    taken, said = [], []

    class Twin:
        zones = tuple(f"zone_{k}" for k in range(1, 17))

        def advance(self, values, loads):
            taken.append(values)
            none = np.zeros(len(self.zones))
            return judged_window(time=float(len(taken)), evidence=none, alarm=len(taken) == 2)

    monkeypatch.setattr(sys.modules[LiveWatch.__module__], "_begin", lambda *_: Twin())
    recorder = Recorder(plan)
    with Simulation(plan) as simulation:
        simulation.say = said.append
        simulation.run([recorder, LiveWatch(tmp_path / "watch.json")])
    data = make_dataset(plan, recorder.time, recorder.table, master=scenario.master)
    whole = find_in_results(data).record.values
    seen = np.hstack(taken)
    assert len(taken) == 3
    assert [text for text in said if text] == ["compiling the twin (once)", "fitting onset and damage"]
    assert said[-1] == ""
    assert np.array_equal(seen, whole[:, : seen.shape[1]])

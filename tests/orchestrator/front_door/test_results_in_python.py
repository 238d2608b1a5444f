"""What the functions return: data with coordinates, files where the command leaves them, a display for notebooks."""

from __future__ import annotations

import json
import re
from pathlib import Path

import gossamer
import numpy as np
import pytest
from command_line import invoke
from gossamer_models.sensor import SensorArtifact
from gossamer_orchestrator.results.places import with_places
from saving import save_results

GAIN = 'step = 0.1\nstop = 1.0\n[components.g]\nfmu = "gain"\ninputs = { u = 1.0, "offset[*]" = 0.0 }\n'


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "g.toml"
    path.write_text(GAIN)
    return path


def words(html):
    return " ".join(re.sub("<[^>]*>", " ", html).split())


def test_a_run_gives_the_data_that_the_command_writes(scenario, fmus, tmp_path, capsys):
    run = gossamer.run(scenario, fmus=fmus, out=tmp_path / "python", set={"g.u": 3.0})
    assert capsys.readouterr().out == ""
    arguments = ["run", str(scenario), "--fmus", str(fmus), "--out", str(tmp_path / "command"), "--set", "g.u=3.0"]
    assert invoke(arguments).exit_code == 0
    assert run.data.equals(gossamer.load(tmp_path / "command").data)
    assert {path.name for path in run.folder.iterdir()} == {path.name for path in (tmp_path / "command").iterdir()}
    assert run["time"].attrs["units"] == "s"
    assert run["g.y"].to_numpy() == pytest.approx(np.full(11, 3.0))  # factor 1 by default
    assert gossamer.load(run).data.identical(run.data)
    assert repr(run).startswith(f"Run('{tmp_path / 'python'}': No judgement")
    assert "No judgement" in run._repr_html_()


def test_an_error_is_that_of_the_command(scenario, fmus, tmp_path):
    with pytest.raises(gossamer.ScenarioError, match="there is no component 'h'"):
        gossamer.run(scenario, fmus=fmus, out=tmp_path / "out", set={"h.u": 3.0})
    with pytest.raises(gossamer.OrchestratorError, match="would overwrite"):
        gossamer.identify(scenario, out=scenario)
    with pytest.raises(gossamer.ResultsError, match="there are no results"):
        gossamer.load(tmp_path / "nowhere")


def test_a_run_is_displayed_as_verdict_table_and_picture(data, tmp_path):
    (tmp_path / "damage.png").write_bytes(b"picture")
    run = gossamer.Run(folder=tmp_path, data=with_places(data))
    assert run.verdict.kind == "damage"
    html = run._repr_html_()
    assert words(html).startswith("Damaged: zone 2 lost 20.0 % of its stiffness")
    assert "True then: 30 % in zone 2" in words(html)
    assert "30 -&gt; 20.0" in html
    assert 'src="data:image/png;base64,cGljdHVyZQ=="' in html
    assert "<script" not in html


def test_titles_and_names_are_escaped_in_a_display(data, tmp_path):
    run = gossamer.Run(folder=tmp_path / "<script>", data=with_places(data))
    assert "<script>" not in run._repr_html_()


def test_a_sweep_gives_all_cases_along_a_dimension(scenario, fmus, tmp_path):
    pytest.importorskip("zarr", reason="a sweep is gathered by zarr")
    sweep = gossamer.sweep(scenario, set={"g.u": [1.0, 2.0]}, fmus=fmus, out=tmp_path / "out", workers=2)
    assert sweep.ended == ["complete", "complete"]
    assert sweep.data is not None
    assert sweep.data["g.y"].isel(time=-1).to_numpy() == pytest.approx([1.0, 2.0])
    assert sweep.data["g.u"].dims == ("case",)
    assert words(sweep._repr_html_()).startswith("2 of 2 cases are finished.")


def test_a_scenario_is_checked_without_a_run(scenario, fmus, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    there = sorted(tmp_path.iterdir())
    checked = gossamer.validate(scenario, fmus=fmus, set={"g.u": 3.0})
    assert [each["component"] for each in checked.outline.components] == ["g"]
    assert words(checked._repr_html_()).startswith("The scenario can run: 1 component, 0 connections, steps of 0.1 s")
    with pytest.raises(gossamer.ScenarioError, match="there is no component 'h'"):
        gossamer.validate(scenario, fmus=fmus, set={"h.u": 3.0})
    assert sorted(tmp_path.iterdir()) == there


def test_one_text_is_one_setting_and_warnings_name_arguments_of_python(scenario, fmus, tmp_path):
    later = tmp_path / "later.toml"
    later.write_text(f'{scenario.read_text()}\n[[events]]\ntime = 1e6\ncomponent = "g"\nset = {{ u = 2.0 }}\n')
    (warning,) = gossamer.validate(later, fmus=fmus, set="g.u=3.0", stop=0.5).outline.warnings
    assert warning == "warning: stop=: the run ends before the events at 1e+06 s, which are left out"


def test_an_fmu_shows_its_variables(fmus):
    about = gossamer.info(fmus / "gain.fmu")
    assert about.variables["u"]["causality"] == "input"
    assert Path(about) == fmus / "gain.fmu"
    assert "gain" in words(about._repr_html_())
    everything = gossamer.info(fmus / "gain.fmu", locals=True)
    assert set(about.variables) <= set(everything.variables)


def test_files_for_people_and_other_programs_are_written(data, scenario, fmus, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert gossamer.new("mine") == Path("mine.toml")
    run = gossamer.run(scenario, fmus=fmus, out="out", pictures=False)
    assert gossamer.report(run) == Path("out/report.html")
    judged = data[[name for name in data if name.startswith(("detector", "membrane.damage"))]]
    save_results(judged.assign_attrs(schema="gossamer.results", version=1), tmp_path / "damage")
    drawn = gossamer.plot("damage", format="svg", out="svg")
    assert Path("svg/damage.svg") in drawn
    assert all(path.is_file() for path in drawn)
    assert gossamer.export_ssp(scenario, fmus=fmus) == Path("out/g.ssp")
    with pytest.raises(gossamer.ResultsError):
        gossamer.export_vtk(run)


def test_findings_of_an_fmu_are_displayed(fmus, tmp_path):
    (tmp_path / "not.fmu").write_bytes(b"no archive")
    checked = gossamer.verify([tmp_path / "not.fmu", fmus / "gain.fmu"])
    assert list(checked.findings) == [str(tmp_path / "not.fmu"), str(fmus / "gain.fmu")]
    assert not checked.passed
    assert all(each.startswith((str(tmp_path), str(fmus))) for each in checked.failed)
    assert any("not.fmu" in each for each in checked.failed)
    assert words(checked._repr_html_()).startswith(f"{len(checked.failed)} checks failed.")
    assert "gain.fmu" in words(checked._repr_html_())


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """An elastic sensor with a play of 10 %."""
    time = 0.5 * np.arange(240)
    strain = 0.04 * (1.0 - np.cos(0.25 * time)) * (0.5 + time / 240.0)
    play = np.zeros_like(strain)
    for k in range(1, strain.size):
        play[k] = max(strain[k] - 0.004, min(strain[k] + 0.004, play[k - 1]))
    path = tmp_path_factory.mktemp("records") / "measured.csv"
    rows = zip(time, 100.0 * strain, 100.0 + 400.0 * strain + 600.0 * play, strict=True)
    path.write_text("time_s,strain [%],R_ohm\n" + "".join(f"{t},{s},{r}\n" for t, s, r in rows))
    return path


@pytest.fixture(scope="module")
def sensor(measured):
    options = {"modes": 2, "relaxations": 1, "starts": 1, "ridge": 0.01, "tau": [40.0]}
    return gossamer.identify(measured, train="0:80", out=measured.parent / "sensor.json", **options)


def test_an_identified_sensor_has_its_records_and_is_a_path(sensor, measured):
    command = SensorArtifact.read(Path(sensor)).provenance["command"]
    assert command.startswith("gossamer.identify(files='measured.csv', out='sensor.json', train='0:80', ")
    assert {"modes=2", "tau=[40.0]"} <= set(re.findall(r"\w+=[^ ,)]+", command))
    (record,) = sensor.records.values()
    assert record.sizes == {"time": 240}
    assert record["time"].attrs["units"] == "s"
    assert record["resistance"].attrs["units"] == "ohm"
    assert int(record["fitted"].sum()) == 161  # 0 to 80 s every 0.5 s
    wrong = record["predicted"] - record["resistance"]
    size = float(record["resistance"].max() - record["resistance"].min())
    test = 100.0 * float(np.sqrt((wrong[~record["fitted"]] ** 2).mean())) / size
    assert test == pytest.approx(next(each.nrmse for each in sensor.result.errors if each.stretch == "test"))
    assert "The resistance is predicted with an error" in words(sensor._repr_html_())
    assert "data:image/png" in sensor._repr_html_()
    assert sensor.page == measured.parent / "sensor" / "report.html"
    assert sensor.page.is_file()


def test_a_sensor_is_judged_on_other_records(sensor, measured, tmp_path):
    judged = gossamer.assess(sensor, measured, compensator=["exact", "inverse"], out=tmp_path / "judged")
    (record,) = judged.records.values()
    assert record["compensator"].to_numpy().tolist() == ["exact", "inverse"]
    assert record["recovered"].sel(compensator="exact").sizes == {"time": 240}
    assert "record that the sensor was fitted to" in words(judged._repr_html_())
    assert judged.page == tmp_path / "judged" / "report.html"


def test_a_sensor_is_built_from_what_identify_returns(sensor, tmp_path):
    built = gossamer.build("sensor", artifact=sensor, out=tmp_path)
    assert built == {"sensor": tmp_path / "sensor.fmu"}
    checked = gossamer.verify(built["sensor"])
    assert checked.passed, checked.failed
    assert repr(checked) == f"Verification({tmp_path / 'sensor.fmu'}: No check failed.)"


def test_the_twin_gives_damage_by_zone(tmp_path):
    pytest.importorskip("ziglang", reason="the twin needs the compiler for its speed")
    from gossamer_models.membrane import square_structure
    from gossamer_models.twin import MembraneForward

    true, step = np.zeros(16), 3e-4
    true[5] = 0.3
    strain = MembraneForward(square_structure(4, 1)).strain(true[None], {}, {}, 300, step)[0]
    rows = [f"{step * (k + 1)!r}," + ",".join(map(repr, row)) for k, row in enumerate(strain.T.tolist())]
    (tmp_path / "strain.csv").write_text("\n".join(["time [s],strain[1],strain[2],strain[3],strain[4]", *rows]))
    found = gossamer.twin(tmp_path / "strain.csv", known="all", elements_per_side=4, order=1)
    assert found.data["damage"].sel(zone=6).item() == pytest.approx(0.3, abs=1e-6)
    assert found.data["damage"].where((found.data["row"] == 2) & (found.data["column"] == 2), drop=True).zone == [6]
    assert json.loads(Path(found).read_text())["damage"] == found.data["damage"].to_numpy().tolist()
    assert words(found._repr_html_()).startswith("Valid: chi2 per sample")
    assert "data:image/png" in found._repr_html_()

"""A campaign is run, killed, resumed and refused; its numbers never differ by a bit."""

import json
import multiprocessing
import os
import pickle
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib.metadata import version

import numpy as np
import pytest
from gossamer_models import DataError, Stepper, simulate
from gossamer_models import campaign as campaigns
from gossamer_models.campaign.chunk import build_kernels, run_chunk
from gossamer_models.campaign.run import ChunkTask, write_chunk
from gossamer_models.campaign.store import SCHEMA, VERSION
from gossamer_models.compensator import compensator_model
from gossamer_models.membrane import membrane_model, square_structure
from gossamer_models.mistakes import DescriptionError
from gossamer_models.sensor import sensor_model

zarr = pytest.importorskip("zarr", reason="campaigns need the extra 'campaign'")

SINGLE = 2.0**-23  # rounding of stored histories, relative
TINY = campaigns.CampaignPlan(
    cases=160,
    seed=5,
    stop=0.03,
    chunk=4,
    membrane=campaigns.Mesh(elements_per_side=4, order=1),
    vary={"pressure_amplitude": campaigns.Vary(factor=(0.9, 1.1)), "sensor_gain": campaigns.Vary(range=(0.98, 1.02))},
    noise=campaigns.MeasurementNoise(strain=campaigns.Distribution(uniform=(0.0, 0.02))),
)
SCRIPT = """
import functools
import signal
import sys
import time
from pathlib import Path
from campaign_under_test import TINY
from gossamer_models.campaign import run

write_chunk = run.write_chunk

@functools.wraps(write_chunk)
def slowed(task, chunk):  # in every worker: the second half takes ten seconds, so that there is time to interrupt it
    if chunk >= TINY.chunks // 2:
        time.sleep(1.0)
    return write_chunk(task, chunk)

run.write_chunk = slowed

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background of a shell ignores it
    run.run_campaign(TINY, Path(sys.argv[1]), workers=2)
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Folder of the tiny campaign, run without a disturbance by one worker."""
    path = tmp_path_factory.mktemp("whole") / "tiny.zarr"
    campaigns.run_campaign(TINY, path, workers=1)
    return path


@pytest.fixture
def script(tmp_path):
    """Start a script that runs the tiny campaign; it is ended with the test."""
    (tmp_path / "run_tiny.py").write_text(SCRIPT)
    (tmp_path / "campaign_under_test.py").write_text(f"from gossamer_models.campaign import *\n\nTINY = {TINY!r}\n")
    started = []

    def start(*arguments):
        command = [sys.executable, str(tmp_path / "run_tiny.py"), *map(str, arguments)]
        started.append(subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


def finished(path):
    """Count the finished chunks in a store."""
    folder = path / "finished" / "c"
    return len([f for f in folder.iterdir() if not f.name.endswith(".partial")]) if folder.is_dir() else 0


def wait_for(condition, seconds=60.0):
    patience = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < patience, "nothing happened for too long"
        time.sleep(0.002)


def content(path):
    """All files that hold numbers, by their place."""
    files = {file.relative_to(path): file.read_bytes() for file in path.rglob("*") if file.is_file()}
    return {place: data for place, data in files.items() if place.name != "zarr.json"}


def test_a_stored_history_is_that_of_the_stepper(whole):
    data = campaigns.read_campaign(whole).isel(case=[0, 17, 159])
    assert data["case"].to_numpy().tolist() == [0, 17, 159]
    model = membrane_model(square_structure(4, 1))
    names = [f"strain[{i}]" for i in range(1, 5)]
    for number in data["case"]:
        case = data.sel(case=number)
        stepper = Stepper(model, pressure_amplitude=float(case["pressure_amplitude"]))
        for zone in case["zone"].to_numpy():
            stepper.set(f"damage[{zone}]", float(case["damage"].sel(zone=zone)))
        stepper.initialize()
        history = simulate(stepper, np.full(100, TINY.step), {}, names)
        assert case["strain"].to_numpy() == pytest.approx(np.array(list(history.values())), rel=SINGLE)
    assert data["time"].to_numpy() == pytest.approx(TINY.step * np.arange(1, 101), rel=1e-15)


def test_what_is_stored_says_what_it_is(whole):
    data = campaigns.read_campaign(whole)
    assert dict(data.sizes) == {"case": 160, "sensor": 4, "time": 100, "zone": 16}
    assert data["pressure_amplitude"].attrs["units"] == "Pa"
    assert data["strain"].dtype == np.float32
    assert json.loads(data.attrs["campaign"])["seed"] == 5
    assert not data["failed"].any()


def test_workers_chunks_and_their_order_leave_no_trace(whole, tmp_path):
    campaigns.run_campaign(TINY, tmp_path / "a.zarr", workers=2)
    assert content(tmp_path / "a.zarr") == content(whole)
    campaigns.run_campaign(replace(TINY, chunk=37, cases=100), tmp_path / "b.zarr", workers=1)
    some = campaigns.read_campaign(tmp_path / "b.zarr")
    assert some.equals(campaigns.read_campaign(whole).isel(case=slice(100)))


def test_a_campaign_killed_half_way_goes_on_to_the_same_bits(whole, script, tmp_path):
    path = tmp_path / "killed.zarr"
    process = script(path)
    wait_for(lambda: finished(path) >= 5)
    process.kill()  # its workers end with it
    process.wait()
    begun = finished(path)
    assert begun < TINY.chunks
    part = campaigns.read_campaign(path)
    assert 0 < part.sizes["case"] < 160
    assert part.equals(campaigns.read_campaign(whole).sel(case=part["case"]))
    summary = campaigns.run_campaign(TINY, path, workers=2)
    assert 0 < summary.simulated <= 160 - 4 * begun
    assert content(path) == content(whole)


def test_a_half_written_chunk_is_run_again(whole, tmp_path):
    path = shutil.copytree(whole, tmp_path / "half.zarr")
    for name in ("finished/c/3", "strain/c/3/0/0"):
        (path / name).unlink()
    (path / "strain/c/3/0/0.0123.partial").write_bytes(b"half")
    assert 12 not in campaigns.read_campaign(path)["case"].to_numpy()
    assert campaigns.run_campaign(TINY, path, workers=1).simulated == 4
    assert content(path) == content(whole)


def test_a_worker_that_dies_is_replaced(whole, tmp_path):
    path = tmp_path / "worker.zarr"

    def kill_once(done, total):
        if done >= 20 and not killed:
            killed.append(multiprocessing.active_children()[0])
            killed[0].kill()

    killed = []
    campaigns.run_campaign(TINY, path, workers=2, progress=kill_once)
    assert killed
    assert content(path) == content(whole)


@pytest.mark.parametrize("chunks", [1, 3])  # after one the second worker is still being started
def test_ctrl_c_keeps_what_is_finished(whole, script, tmp_path, chunks):
    path = tmp_path / "interrupted.zarr"
    process = script(path)
    wait_for(lambda: finished(path) >= chunks)
    os.killpg(process.pid, signal.SIGINT)
    errors = process.communicate(timeout=30)[1]
    assert process.returncode != 0
    assert errors.count("Traceback") == 1  # that of the script, none of a worker
    part = campaigns.read_campaign(path)
    assert part.equals(campaigns.read_campaign(whole).sel(case=part["case"]))


def test_the_store_of_another_campaign_is_refused_with_the_difference(whole):
    other = replace(TINY, seed=6, vary={**TINY.vary, "pressure_amplitude": campaigns.Vary(factor=(0.8, 1.1))})
    with pytest.raises(DataError, match="holds another campaign") as refused:
        campaigns.run_campaign(other, whole)
    for difference in ("seed: 5 there, 6 here", "vary.pressure_amplitude.factor: [0.9, 1.1] there, [0.8, 1.1] here"):
        assert difference in str(refused.value)
    assert "Name another folder with out=" in str(refused.value)


def test_a_title_makes_no_other_campaign(whole):
    assert campaigns.run_campaign(replace(TINY, title="the same"), whole).simulated == 0


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [("version", 1, "holds 'gossamer.campaign' version 1"), ("schema", "images", "holds 'images' version 2")],
)
def test_a_store_of_another_version_is_refused(whole, tmp_path, key, value, message):
    path = shutil.copytree(whole, tmp_path / "old.zarr")
    card = json.loads((path / "zarr.json").read_text())
    card["attributes"][key] = value
    (path / "zarr.json").write_text(json.dumps(card))
    with pytest.raises(DataError, match=message):
        campaigns.read_campaign(path)
    with pytest.raises(DataError, match=message):
        campaigns.run_campaign(TINY, path)


def test_numbers_of_another_version_of_gossamer_are_not_continued(whole, tmp_path):
    path = shutil.copytree(whole, tmp_path / "old.zarr")
    card = json.loads((path / "zarr.json").read_text())
    card["attributes"]["identity"]["gossamer"] = "0.0.1"
    (path / "zarr.json").write_text(json.dumps(card))
    with pytest.raises(DataError, match=r"gossamer: 0\.0\.1 there"):
        campaigns.run_campaign(TINY, path)


def test_what_is_no_store_is_refused(tmp_path):
    (tmp_path / "file").write_text("text")
    old = zarr.create_group(tmp_path / "zarr_2", zarr_format=2, attributes={"schema": SCHEMA, "version": VERSION})
    old.create_array("finished", shape=(4,), dtype="bool")
    for path in (tmp_path, tmp_path / "file", tmp_path / "zarr_2"):
        with pytest.raises(DataError, match="is not the store of a campaign"):
            campaigns.run_campaign(TINY, path)
    for name in ("nowhere", "zarr_2"):
        with pytest.raises(DataError, match="is not the store of a campaign"):
            campaigns.read_campaign(tmp_path / name)


def test_a_folder_that_cannot_be_made_is_said(tmp_path):
    (tmp_path / "file").write_text("text")
    with pytest.raises(OSError, match="File exists"):
        campaigns.run_campaign(TINY, tmp_path / "file" / "tiny.zarr")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_said(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(PermissionError):
        campaigns.run_campaign(TINY, tmp_path / "tiny.zarr")


def test_a_full_disk_is_said_and_finished_chunks_stay(whole, tmp_path, monkeypatch):
    resource = pytest.importorskip("resource", reason="limits of a process are a matter of Unix")
    path, most = tmp_path / "full.zarr", 2 * max(len(data) for data in content(whole).values())
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    long = replace(TINY, stop=0.3, cases=8)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, limits[1]))  # a history does not fit, all else does
    try:
        with pytest.raises(campaigns.CampaignStoppedError, match=r"full\.zarr: File too large\. Finished chunks are kept"):
            campaigns.run_campaign(long, path, workers=1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert finished(path) == 0
    assert campaigns.read_campaign(path).sizes["case"] == 0
    assert campaigns.run_campaign(long, path, workers=1).simulated == 8


def test_a_case_that_breaks_is_marked_and_harms_no_other(tmp_path):
    """A sensor that rests beyond full scale, a strain of 0.5, has no state."""
    prestrain = {"edge_displacement": campaigns.Vary(range=(0.1, 0.2))}
    summary = campaigns.run_campaign(
        replace(TINY, cases=8, chain=campaigns.Chain(), vary=prestrain), tmp_path / "wild.zarr", workers=1
    )
    data = campaigns.read_campaign(tmp_path / "wild.zarr")
    assert (data["failed"] == (data["edge_displacement"] / 0.294 > 0.5)).all()
    assert 0 < summary.failed == int(data["failed"].sum()) < 8
    for history in ("strain", "resistance", "compensated_strain"):
        assert (data[history].isnull().any(("sensor", "time")) == data["failed"]).all()


def test_a_worker_of_another_version_refuses(whole):
    task = ChunkTask(TINY, pickle.dumps(build_kernels(TINY)), whole, "0.0.1")
    with pytest.raises(campaigns.CampaignStoppedError, match=r"this is 0\.0\.1\. Install one version everywhere"):
        write_chunk(task, 0)


def test_a_worker_of_another_machine_compiles_for_itself(whole, tmp_path, monkeypatch):
    path = shutil.copytree(whole, tmp_path / "far.zarr")
    task = ChunkTask(TINY, pickle.dumps(build_kernels(TINY)), path, version("gossamer"))
    for file in ("finished/c/3", "strain/c/3/0/0"):
        (path / file).unlink()
    monkeypatch.setattr("gossamer_models.batch.kernel.processor", lambda: "another")
    write_chunk(task, 3)
    assert content(path) == content(whole)


def test_damage_that_begins_leaves_the_history_before_as_it_was():
    """0.0151 s lies in step 51, the first one that damage can change."""
    sudden = campaigns.Damage(cases=({6: 0.4},), onset=(0.0151, 0.0151))
    begun, healthy = (
        run_chunk(asked, build_kernels(asked), 0)["strain"][0]
        for asked in (replace(TINY, cases=1, damage=damage) for damage in (sudden, campaigns.Damage(cases=({},))))
    )
    assert (begun[:, :50] == healthy[:, :50]).all()
    assert (begun[:, 60:] != healthy[:, 60:]).mean() > 0.9


def test_noise_is_a_function_of_seed_case_and_draw(whole):
    data = campaigns.read_campaign(whole)
    once, fresh = campaigns.measured_strain(data), campaigns.measured_strain(data, draw=1)
    assert once.equals(campaigns.measured_strain(data))
    assert once.isel(case=[7, 3]).equals(campaigns.measured_strain(data.isel(case=[7, 3])))
    noise = (once - data["sensor_gain"] * data["strain"]).to_numpy()
    assert -1e-7 < noise.min() < 1e-5
    assert 0.02 - 1e-5 < noise.max() < 0.02 + 1e-7
    assert noise.mean() == pytest.approx(0.01, abs=4 * 0.02 / np.sqrt(12 * noise.size))
    other = (fresh - data["sensor_gain"] * data["strain"]).to_numpy()
    assert abs(np.corrcoef(noise.ravel(), other.ravel())[0, 1]) < 4 / np.sqrt(noise.size)


def test_a_campaign_without_chain_has_no_resistance(whole):
    with pytest.raises(DataError, match=r"has no resistance. Add \[chain\]"):
        campaigns.measured_resistance(campaigns.read_campaign(whole))


def test_the_chain_is_that_of_the_steppers(tmp_path):
    asked = replace(
        TINY,
        cases=3,
        stop=0.015,
        chain=campaigns.Chain(),
        damage=campaigns.Damage(zones=(1, 1)),
        noise=campaigns.MeasurementNoise(resistance=campaigns.Distribution(normal=1e-3)),
        vary={"sensor_gain": campaigns.Vary(range=(0.9, 1.1)), "edge_displacement": campaigns.Vary(factor=(0.9, 1.1))},
    )
    campaigns.run_campaign(asked, tmp_path / "chain.zarr", workers=1)
    data = campaigns.read_campaign(tmp_path / "chain.zarr")
    case, steps, change = data.isel(case=1, sensor=2), np.full(50, TINY.step), 100.0
    own, assumed = float(case["edge_displacement"]) / 0.294, 0.006 / 0.294
    sensor = Stepper(sensor_model(), rest_strain=own)
    sensor.set("full_scale_resistance_change", change * float(case["sensor_gain"]))
    sensor.initialize()
    resistance = simulate(sensor, steps, {"strain": case["strain"].to_numpy()}, ["resistance"])["resistance"]
    assert case["resistance"].to_numpy() == pytest.approx(resistance, rel=1e-5)
    compensator = Stepper(compensator_model(), rest_strain=assumed)
    compensator.initialize()
    measured = campaigns.measured_resistance(data).isel(case=1, sensor=2).to_numpy()
    strain = simulate(compensator, steps, {"resistance": measured}, ["strain"])["strain"]
    assert case["compensated_strain"].to_numpy() == pytest.approx(strain, abs=1e-5)
    assert data["compensated_strain"].attrs["delay"] == 0.0
    noise = (campaigns.measured_resistance(data) - data["resistance"]).to_numpy()
    assert noise.std() == pytest.approx(0.001 * change, rel=4 / np.sqrt(2 * noise.size))


def test_a_share_of_the_cases_runs_on_finer_elements(tmp_path):
    """The same cases, and one chunk of four of them as on a square of twice the elements."""
    mixed = replace(TINY, cases=16, membrane=replace(TINY.membrane, finer=0.25))
    campaigns.run_campaign(mixed, tmp_path / "mixed.zarr", workers=1)
    data = campaigns.read_campaign(tmp_path / "mixed.zarr")
    assert data["finer"].to_numpy().tolist() == [False] * 12 + [True] * 4
    own, finer = (replace(mixed, membrane=campaigns.Mesh(elements_per_side=sides, order=1)) for sides in (4, 8))
    for asked, chunk in ((own, 2), (finer, 3)):
        alone = run_chunk(asked, build_kernels(asked), chunk)
        found = data.isel(case=slice(4 * chunk, 4 * chunk + 4))
        np.testing.assert_allclose(found["strain"], alone["strain"], rtol=0, atol=1e-6)
        np.testing.assert_array_equal(found["damage"], alone["damage"])


def test_a_share_of_finer_cases_that_is_none_is_refused():
    with pytest.raises(DescriptionError, match=r"'finer' is 2\. Write a share of the cases from 0 to 1\."):
        replace(TINY.membrane, finer=2.0)

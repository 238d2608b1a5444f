"""A campaign on a real Dask scheduler and worker processes: whoever is killed, nothing is lost, doubled or changed."""

import json
import os
import subprocess
import sys
import time

import pytest
from gossamer_models.campaign import CampaignPlan, CampaignStoppedError, Mesh, Vary, read_campaign, run_campaign

pytest.importorskip("distributed", reason="clusters need the extra 'campaign'")

TINY = CampaignPlan(
    cases=200,
    seed=8,
    stop=0.06,
    chunk=4,
    membrane=Mesh(elements_per_side=4, order=1),
    vary={"mass_damping": Vary(factor=(0.5, 2.0))},
)
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Folder of the tiny campaign, run without a cluster."""
    path = tmp_path_factory.mktemp("whole") / "tiny.zarr"
    run_campaign(TINY, path, workers=1)
    return path


class Cluster:
    """A scheduler and two workers, each a process."""

    def __init__(self, folder):
        self._log = (folder / "dask.log").open("w")
        file = folder / "scheduler.json"
        self.scheduler = self._start("scheduler", "--port", "0", "--scheduler-file", file, "--host", "127.0.0.1")
        patience = time.monotonic() + 60.0
        while not file.exists() or not file.read_text().endswith("}"):
            assert time.monotonic() < patience, "the scheduler does not start"
            time.sleep(0.02)
        self.address = json.loads(file.read_text())["address"]
        self.workers = [self._start("worker", self.address, "--nthreads", "1", "--no-nanny") for _ in range(2)]

    def _start(self, what, *arguments):
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", *map(str, arguments), "--no-dashboard"]
        quick = {**os.environ, "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "5s"}
        return subprocess.Popen(command, stdout=self._log, stderr=self._log, env=quick)

    def end(self):
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()
        self._log.close()


@pytest.fixture
def cluster(tmp_path):
    started = []

    def start(name):
        folder = tmp_path / name
        folder.mkdir()
        started.append(Cluster(folder))
        return started[-1]

    yield start
    for running in started:
        running.end()


def content(path):
    """All files that hold numbers, by their place."""
    files = {file.relative_to(path): file.read_bytes() for file in path.rglob("*") if file.is_file()}
    return {place: data for place, data in files.items() if place.name != "zarr.json"}


def kill_half_way(process):
    """Return an observer of the progress that kills a process once."""

    def observe(done, total):
        if done >= 60:
            process.kill()

    return observe


def test_a_worker_and_then_the_scheduler_are_killed_and_nothing_is_lost(whole, cluster, tmp_path):
    path = tmp_path / "tiny.zarr"
    first = cluster("first")
    with pytest.raises(CampaignStoppedError, match=r"scheduler at tcp:.* is gone\. What is finished is kept"):
        run_campaign(TINY, path, scheduler=first.address, progress=kill_half_way(first.scheduler))
    part = read_campaign(path)
    assert 60 <= part.sizes["case"] < 200
    assert part.equals(read_campaign(whole).sel(case=part["case"]))
    second = cluster("second")
    half_way = []

    def kill_one_worker(done, total):
        if done >= (200 + part.sizes["case"]) // 2 and not half_way:
            half_way.append(done)
            second.workers[0].kill()

    summary = run_campaign(TINY, path, scheduler=second.address, progress=kill_one_worker)
    assert half_way
    assert summary.simulated <= 140  # what the first run finished is not run again
    assert content(path) == content(whole)


def test_no_scheduler_there_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr("gossamer_models.campaign.run.SCHEDULER_PATIENCE", 1.0)
    with pytest.raises(
        CampaignStoppedError, match=r"no Dask scheduler at tcp://127.0.0.1:9.*Start one with 'dask scheduler'"
    ):
        run_campaign(TINY, tmp_path / "tiny.zarr", scheduler="tcp://127.0.0.1:9")

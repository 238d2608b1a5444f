"""A spacecraft in Basilisk drives the chain, where Basilisk is installed (270 MB, so no dev dependency)."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest
from gossamer_orchestrator import parse_scenario, run_scenario
from gossamer_orchestrator.exchange.container import build_container

ROOT = Path(__file__).parents[2]
RUN = "import json, runpy, sys; print(json.dumps(runpy.run_path(sys.argv[1])['main'](sys.argv[2])))"


@pytest.mark.skipif(not importlib.util.find_spec("Basilisk"), reason="Basilisk is not installed: pip install bsk")
@pytest.mark.parametrize("kind", ["native"], indirect=True, scope="session")
def test_the_chain_feels_the_motion_of_the_spacecraft(fmus, tmp_path):
    text = (ROOT / "orchestrator/scenarios/damaged.toml").read_text(encoding="utf-8")
    container = build_container(parse_scenario(text, name="damaged.toml"), fmus, tmp_path / "chain.fmu")
    command = [sys.executable, "-c", RUN, ROOT / "docs/examples/ex01_basilisk.py", container]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    damage, accelerations = json.loads(done.stdout.splitlines()[-1])

    # rigid body: thrust over mass, less the angular acceleration (0.2 N m over 80 kg m2) times the arm of 1.5 m
    expected = 1.0 / 120.0 - 0.2 / 80.0 * 1.5
    assert accelerations == pytest.approx([expected] * 844, rel=1e-9)
    moved = parse_scenario(
        text.replace("base_acceleration = 0.0", f"base_acceleration = {expected!r}"), name="moved.toml"
    )
    own = run_scenario(moved, fmus)["detector.damage"].isel(time=-1)
    assert damage == pytest.approx(own.to_numpy().tolist(), abs=1e-9)
    still = run_scenario(parse_scenario(text, name="damaged.toml"), fmus)["detector.damage"].isel(time=-1)
    assert abs(float(still[0]) - damage[0]) > 1e-6

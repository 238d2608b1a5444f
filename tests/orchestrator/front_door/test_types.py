"""A type checker knows the functions: what they take, what they return, and that they are whole."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
USED = """
from pathlib import Path
import gossamer

fmus: dict[str, Path] = gossamer.build(["sensor"], scales=[1000.0, 150.0, 0.2])
run: gossamer.Run = gossamer.run(Path("a.toml"), set={"membrane.damage[1]": 0.3}, stop=1.0)
sentence: str = run.verdict.sentence
damage: gossamer.TwinAnswer = gossamer.twin(run, known=["offset", "gain"])
sensor = gossamer.identify(["a.csv", "b.csv"], tau=(3.0, 100.0), ridge="auto")
judged: gossamer.Assessment = gossamer.assess(sensor, Path("c.csv"))
swept: gossamer.Sweep = gossamer.sweep("damaged", set={"seed": range(3)})
passed: bool = gossamer.verify(fmus["sensor"]).passed
page: Path = gossamer.view(gossamer.load("out/damaged"))
warnings: list[str] = gossamer.validate("mine.toml", set={"seed": 2}).outline.warnings
seen: gossamer.Watching = gossamer.watch(run, window=0.1)
campaign: gossamer.Campaign = gossamer.campaign("training", workers=2)
detector: gossamer.TrainedDetector = gossamer.train(campaign, kind="posterior", steps=3)
judged_detector: gossamer.DetectorAssessment = gossamer.assess_detector(artifact=[detector, "wide"], twin=True)
placed: gossamer.SensorPlacement = gossamer.place_sensors(setup=Path("sail.toml"), set={"pressure_amplitude": 2.0})
unit: object = gossamer.info(fmus["sensor"], locals=True).variables["strain"]["unit"]
files: list[Path] = [gossamer.container("damaged", fmi=3), *gossamer.plot(run, format="svg"), *gossamer.export_vtk(run)]
"""
WRONG = """
import gossamer

gossamer.run("damaged", stp=1.0)
gossamer.run("damaged", threads="many")
gossamer.sweep("damaged")
gossamer.fly()
"""


def check(folder, text):
    """Return what mypy says of a script."""
    script = folder / "script.py"
    script.write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"), "--no-pretty", str(script)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout


def test_right_calls_pass_and_wrong_ones_are_named(tmp_path):
    assert "Success" in check(tmp_path, USED)
    said = check(tmp_path, WRONG)
    assert 'Unexpected keyword argument "stp" for "run"' in said
    assert 'Argument "threads" to "run" has incompatible type "str"; expected "int"' in said
    assert 'Missing named argument "set" for "sweep"' in said
    assert 'has no attribute "fly"' in said
    assert "Found 4 errors" in said

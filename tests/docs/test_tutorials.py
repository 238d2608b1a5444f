"""Commands and snippets of the site's tutorials run as they are printed, one after another, and end where they say."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "docs" / "site"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def walk(page, folder, opened=None):
    """Do what a reader of a tutorial does; return the names that its Python blocks leave behind.

    ``gossamer view`` opens its page with a program of ours, which writes down what it opened.
    """
    text = (PAGES / "tutorials" / page).read_text(encoding="utf-8")
    variables = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    if opened:
        variables["BROWSER"] = f"{sys.executable} {opened} %s"
    names = {}
    for found in BLOCK.finditer(text):
        language, block = found.groups()
        if language == "sh":
            for line in block.splitlines():
                subprocess.run(shlex.split(line), cwd=folder, env=variables, check=True)
        elif language == "toml":
            file = re.findall(r"Write .* as `(\w+\.toml)`", text[: found.start()])[-1]
            (folder / file).write_text(block, encoding="utf-8")
        else:
            assert language == "python"
            exec(block, names)
    return names


def test_every_block_says_what_it_is():
    for page in PAGES.rglob("*.md"):
        text = page.read_text(encoding="utf-8")
        assert len(BLOCK.findall(text)) == len(re.findall("^```", text, re.MULTILINE)) / 2, page
    assert not [page for page in PAGES.glob("*.md") if BLOCK.findall(page.read_text(encoding="utf-8"))]


def test_the_first_run_finds_the_damage_and_moves_it(tmp_path, monkeypatch):
    import xarray as xr

    monkeypatch.chdir(tmp_path)
    browser = tmp_path / "browser.py"
    browser.write_text("import pathlib, sys; pathlib.Path('opened').write_text(sys.argv[1])", encoding="utf-8")
    names = walk("first_run.md", tmp_path, browser)
    assert names["found"] == pytest.approx(0.40, abs=0.01)
    assert names["deviation"] < 0.01
    assert (tmp_path / "opened").read_text(encoding="utf-8").endswith("out/damaged/report.html")
    with xr.open_dataset("out/other/results.nc", engine="scipy") as other:
        found = other["detector.damage"].isel(time=-1)
        assert float(found.sel(zone=7)) == pytest.approx(0.25, abs=0.01)
        assert float(found.sel(zone=1)) < 0.01


def test_the_own_sensor_recovers_the_strain_of_another_record(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs").symlink_to(ROOT / "docs", target_is_directory=True)
    names = walk("own_sensor.md", tmp_path)
    stated = float(re.search(r"It prints (\d\.\d) %", (PAGES / "tutorials/own_sensor.md").read_text(encoding="utf-8"))[1])
    assert 100.0 * names["in_full_scale"] == pytest.approx(stated, abs=0.1)
    assert f"{stated} % of full scale" in capsys.readouterr().out


def test_the_sail_of_another_shape_slackens_where_its_boom_slips(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = walk("own_mesh.md", tmp_path)
    page = (PAGES / "tutorials/own_mesh.md").read_text(encoding="utf-8")
    stated = re.search(r"It prints (\S+) % before and (\S+) % after", page)
    assert names["taut"] == pytest.approx(float(stated[1]), abs=6e-4)
    assert names["slipped"] == pytest.approx(float(stated[2]), abs=6e-4)
    assert "largest strain of the sensors" in capsys.readouterr().out


def test_the_strip_of_the_page_on_setups_softens_on_the_left(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    walk("../../setup.md", tmp_path)
    page = (ROOT / "docs/setup.md").read_text(encoding="utf-8")
    stated = re.search("It prints (left .* after; right .* after)", page)[1]
    printed = capsys.readouterr().out
    assert re.findall(r"[a-z]+", printed) == re.findall(r"[a-z]+", stated)
    figures = [[float(each) for each in re.findall(r"[\d.]+", text)] for text in (printed, stated)]
    assert figures[0] == pytest.approx(figures[1], abs=1e-3)


def test_the_membrane_in_python_is_judged(capsys):
    names = walk("python.md", None)
    assert names["damage"][5] == pytest.approx(0.3, abs=0.01)
    assert max(names["damage"][:5] + names["damage"][6:]) < 0.01
    assert "zone 6: 30.0 % damage, valid: True" in capsys.readouterr().out


def test_a_dish_from_nothing_to_its_damaged_zone(tmp_path, monkeypatch, capsys):
    try:
        import gmsh  # noqa: F401
    except (ImportError, OSError) as error:
        pytest.skip(f"gmsh and its X libraries are needed: {error}")
    monkeypatch.chdir(tmp_path)
    walk("own_structure.md", tmp_path)
    printed = capsys.readouterr().out
    share, deviation = map(int, re.search(r"ring 3 sector 4: (\d+) % \+- (\d+) %", printed).groups())
    assert abs(share - 30) <= max(1, 3 * deviation)
    assert "valid: True" in printed


def test_debris_is_felt_by_the_attitude_seen_by_the_watch_and_measured_by_the_twin(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = walk("debris.md", tmp_path)
    assert 2.0 < names["after"] / names["quiet"] < 6.0
    watch = json.loads((tmp_path / "out/watch.json").read_text(encoding="utf-8"))
    (alarm,) = watch["alarms"]
    assert 0.075 < alarm < 0.085
    (finding,) = watch["findings"]
    damage = dict(zip(finding["zones"], finding["damage"], strict=True))
    assert max(damage, key=damage.get) == "ring 2 sector 1"
    assert 0.22 < damage["ring 2 sector 1"] < 0.30
    assert names["answer"]["valid"]
    assert list(names["found"]) == ["ring 2 sector 1"]
    assert names["found"]["ring 2 sector 1"] == pytest.approx(25.0, abs=1.0)

"""``gossamer flight``: a kind of component in, a folder of C out."""

import json
import shutil
from pathlib import Path

import gossamer
import pytest
from command_line import invoke
from gossamer_fmus.flight_budgets import missing_tools


def test_the_folder_holds_what_a_flight_processor_needs_and_the_interface(tmp_path):
    result = invoke(["flight", "compensator", "--float", "32", "--out", str(tmp_path / "flight"), "--json"])
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert (said["kind"], said["bits"], said["budgets"]) == ("compensator", 32, {})
    files = {path.name for path in Path(said["folder"]).iterdir()}
    assert {"compensator.c", "compensator.h", "main.c", "golden.c", "Makefile", "CMakeLists.txt", "INTERFACE.md"} <= files
    page = (tmp_path / "flight/INTERFACE.md").read_text(encoding="utf-8")
    assert "| `resistance` | ohm | any finite number | 100 | Measured resistance" in page
    assert "| `strain` | 1 | 0 to any finite number |  | Recovered strain |" in page
    header = (tmp_path / "flight/compensator.h").read_text(encoding="utf-8")
    assert "typedef float compensator_real;" in header
    assert "compensator_real known; /* [1] 1 if the strain is known now; else 0; 0 to 1; starts at 0 */" in header


@pytest.mark.parametrize(
    ("framework", "files"),
    [
        ("fprime", {"Compensator.fpp", "Compensator.hpp", "Compensator.cpp"}),
        ("cfs", {"compensator_app.c", "compensator_tbl.c"}),
    ],
)
def test_a_framework_gets_a_folder_of_its_own_with_all_that_it_compiles(tmp_path, framework, files):
    result = invoke(["flight", "compensator", "--framework", framework, "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    component = {f"compensator{ending}" for ending in (".c", ".h", "_math.h", "_table.h")}
    assert {path.name for path in (tmp_path / framework).iterdir()} >= files | component | {"CMakeLists.txt"}


def test_scales_are_where_it_starts(tmp_path):
    made = gossamer.flight("estimator", out=tmp_path, scales=(1000.0, 150.0, 0.2))
    header = (Path(made) / "estimator.h").read_text(encoding="utf-8")
    assert ".rest_resistance = 1000.0," in header
    assert ".full_scale_strain = 0.2," in header


def test_a_kind_that_there_is_not_is_refused():
    result = invoke(["flight", "membrane"])
    assert result.exit_code != 0
    assert "membrane" in result.output


@pytest.mark.skipif(bool(missing_tools()), reason=f"not installed: {', '.join(missing_tools())}")
def test_budgets_are_measured_and_kept(tmp_path):
    result = invoke(["flight", "compensator", "--float", "32", "--out", str(tmp_path), "--measure"])
    assert result.exit_code == 0, result.output
    assert "instructions of a step, the most (a count, not a time)" in result.stderr
    budgets = json.loads((tmp_path / "budgets.json").read_text())
    assert 0 < budgets["mean"] <= budgets["most"] < 144_000  # a step of 0.3 ms at 480 MHz


@pytest.mark.skipif(bool(missing_tools()), reason=f"not installed: {', '.join(missing_tools())}")
def test_the_exact_inverse_alone_needs_half_the_memory_and_follows_no_ageing(tmp_path):
    result = invoke(["flight", "compensator", "--no-ageing", "--out", str(tmp_path), "--measure"])
    assert result.exit_code == 0, result.output
    budgets = json.loads((tmp_path / "budgets.json").read_text())
    assert budgets["ram"] < 2500
    assert budgets["worst"] < 1e-12
    header = (tmp_path / "compensator.h").read_text(encoding="utf-8")
    assert "known" not in header
    assert "gain_per_day" not in header


def test_without_the_tools_it_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    result = invoke(["flight", "compensator", "--out", str(tmp_path), "--measure"])
    assert result.exit_code == 1
    assert "budgets need make, gcc-arm-none-eabi and libnewlib-arm-none-eabi, qemu-system-arm" in result.output


def test_so_it_does_for_a_processor_in_the_loop(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    result = invoke(["flight", "compensator", "--out", str(tmp_path), "--hil"])
    assert result.exit_code == 1
    assert "a processor in the loop needs make, gcc-arm-none-eabi" in result.output


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("watch --artifact sensor.json", "--artifact has no meaning for a watch"),
        ("compensator --noise 0.002", "--noise has no meaning for a compensator"),
        ("watch --noise 0", "must be larger than 0"),
        ("watch --no-ageing", "--no-ageing has no meaning for a watch"),
        ("detector --no-ageing", "'detector' follows no gain and offset. Name one of those that do"),
    ],
)
def test_a_watch_and_the_others_have_options_of_their_own(words, message):
    result = invoke(["flight", *words.split()])
    assert result.exit_code == 1
    assert message in result.output

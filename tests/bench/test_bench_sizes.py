"""A run of ten thousand outputs, all processes of it, beside FMPy."""

from __future__ import annotations

import resource
import subprocess
import sys

from hostile import build

TARGET = 10.0  # [s of CPU] for 10,000 outputs at 11 instants: results, CSV, page
FMPY = """
import sys
from fmpy import simulate_fmu
from fmpy.util import write_csv
write_csv(sys.argv[2], simulate_fmu(sys.argv[1], stop_time=1.0, step_size=0.1, output_interval=0.1))
"""


def used(*command) -> float:
    """Run Python with a command; return the CPU time of all its processes [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *map(str, command)], check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def test_a_run_of_ten_thousand_outputs(tmp_path, measured):
    count, fmu = 10_000 if measured else 50, tmp_path / "wide.fmu"
    build(fmu, outputs=count)
    (tmp_path / "it.toml").write_text('step = 0.1\nstop = 1.0\n[components.a]\nfmu = "wide"\ninputs = { u = 0.0 }\n')
    run = ("-m", "gossamer", "run", tmp_path / "it.toml", "--fmus", tmp_path, "--out", tmp_path / "out")
    commands = (run, (*run, "--no-pictures"), ("-c", FMPY, fmu, tmp_path / "fmpy.csv"))
    page, files, fmpy = (min(used(*each) for _ in range(3 if measured else 1)) for each in commands)
    ours, theirs = (path.read_text().splitlines() for path in (tmp_path / "out/results.csv", tmp_path / "fmpy.csv"))
    assert len(ours) == len(theirs) == 12
    print(f"\na run of {count} outputs at 11 times: {page:.1f} s of CPU (target {TARGET:g} s), {files:.1f} s without page,")
    print(f"which is {files / fmpy:.2f} times what FMPy takes for its CSV, {fmpy:.1f} s")

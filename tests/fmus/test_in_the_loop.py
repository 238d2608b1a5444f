"""A compensator on an emulated processor in the loop: its numbers in any host, and what becomes of the emulator."""

import os
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
from command_line import invoke
from fmu_host import Instance
from gossamer_fmus.catalogue import make_model
from gossamer_fmus.flight import HEALTH, PERIOD, golden_vectors
from gossamer_fmus.flight_budgets import missing_tools

pytestmark = pytest.mark.skipif(bool(missing_tools()), reason=f"not installed: {', '.join(missing_tools())}")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    result = invoke(["flight", "compensator", "--hil", "--out", str(folder)])
    assert result.exit_code == 0, result.output
    return folder / "compensator.fmu"


@pytest.fixture
def unzipped(path, unzipped_once):
    return Path(unzipped_once(path))


@pytest.fixture
def begin(path, unzipped, tmp_path):
    """Make an instance, with another program in place of the emulator where one is given; free it in the end."""
    made = []

    def make(*program):
        folder = unzipped
        if program:
            folder = tmp_path / "with_another_program"
            shutil.copytree(unzipped, folder)
            (folder / "resources/processor.txt").write_text("\n".join(program) + "\n")
        made.append(Instance(path, folder))
        return made[-1]

    yield make
    for each in made:
        each.slave.freeInstance()


def emulators():
    """Child processes of this one by state, Z that of one whose end nobody took note of."""
    rows = subprocess.run(["ps", "-o", "ppid=,stat=,pid=,args=", "-A"], capture_output=True, text=True, check=True).stdout
    mine = [line.split(None, 3) for line in rows.splitlines()]
    return {int(pid): stat for ppid, stat, pid, args in mine if int(ppid) == os.getpid() and args.split()[0] != "ps"}


def test_sample_by_sample_it_gives_the_bits_of_the_model_and_leaves_no_process(begin):
    model = make_model("compensator")
    (parameters, inputs), results = golden_vectors(model, make_model("sensor"))
    names = [model.names[part] for part in model.slices()]
    before = emulators()
    fmu = begin()
    assert emulators() == before
    fmu.initialize(**dict(zip(names[0], parameters, strict=True)), **dict(zip(names[1], inputs[0].tolist(), strict=True)))
    assert len(emulators()) == len(before) + 1
    rows = [fmu.get(*names[2], "health")]
    for row in inputs[1:]:
        for name, value in zip(names[1], row.tolist(), strict=True):
            fmu.set(name, value)
        assert fmu.step(PERIOD) == 0
        rows.append(fmu.get(*names[2], "health"))
    assert np.array(rows)[:, :-1].tobytes() == results.tobytes()
    assert not np.any(np.array(rows)[:, -1])
    fmu.slave.reset()
    assert emulators() == before


def test_a_run_with_it_equals_the_run_with_the_native_fmu(path, built, tmp_path):
    """Membrane and sensors as FMUs, four compensators on four emulated processors."""
    found = []
    for name, in_the_loop in (("native", {}), ("in_the_loop", {"compensator": path})):
        folder = tmp_path / name
        folder.mkdir()
        for kind, fmu in (built("native") | in_the_loop).items():
            shutil.copy(fmu, folder / f"{kind}.fmu")
        out = ["--out", str(tmp_path / f"{name}_results"), "--csv", "--no-pictures"]
        result = invoke(["run", "damaged", "--fmus", str(folder), "--stop", "0.015", *out])
        assert result.exit_code == 0, result.output
        found.append((tmp_path / f"{name}_results/results.csv").read_text())
    assert len(found[0].splitlines()) > 50
    assert found[0] == found[1]


def test_it_keeps_the_rules_and_what_it_declares(path):
    result = invoke(["verify", str(path), "--json"])
    assert result.exit_code == 0, result.output
    assert '"failed"' not in result.stdout


@pytest.mark.parametrize(
    ("program", "message"),
    [
        (("5", "no-such-emulator", "-kernel"), "cannot start no-such-emulator, which model 'compensator' runs on:"),
        (("5", "false"), "ended before it answered (code 1)"),
        (("0.2", "sleep", "60"), "did not answer within 0.2 s and was ended"),
        (("5", "yes"), "sent what is no answer and was ended"),
        (("0", "true"), "processor.txt must hold seconds, a program and its arguments"),
    ],
)
def test_what_does_not_answer_ends_the_run_with_a_message(begin, program, message):
    before = emulators()
    fmu = begin(*program)
    fmu.slave.setupExperiment(startTime=0.0)
    fmu.slave.enterInitializationMode()
    with pytest.raises(Exception, match="fmi2ExitInitializationMode"):
        fmu.slave.exitInitializationMode()
    assert message in fmu.messages[-1]
    assert emulators() == before


def test_a_processor_that_dies_in_a_run_is_named_and_a_reset_begins_anew(begin):
    before = emulators()
    fmu = begin()
    fmu.initialize()
    assert fmu.step(PERIOD) == 0
    (processor,) = set(emulators()) - set(before)
    os.kill(processor, signal.SIGKILL)
    assert fmu.step(PERIOD) == 2  # fmi2Discard
    assert "the processor of model 'compensator' ended before it answered (signal 9)" in fmu.messages[-1]
    assert fmu.step(PERIOD) == 2
    assert "has ended, and its state with it" in fmu.messages[-1]
    assert emulators() == before
    fmu.slave.reset()
    fmu.initialize()
    assert fmu.step(PERIOD) == 0


BOARD = """
import struct, sys
size, results = int(sys.argv[1]), int(sys.argv[2])
while len(request := sys.stdin.buffer.read(size)) == size:
    (magic,), (number,) = struct.unpack_from("<I", request), struct.unpack_from("<I", request, size - 8)
    health = int(sys.argv[3]) if number == int(sys.argv[4]) else 0
    sys.stdout.buffer.write(struct.pack("<4I", magic, number, health, 0) + bytes(8 * results))
    sys.stdout.buffer.flush()
"""


def board(tmp_path, health, sample):
    """Write a processor that answers with zeros, and with a health at a sample; return the words that start it."""
    parameters, inputs, results = (part.stop - part.start for part in make_model("compensator").slices())
    (tmp_path / "board.py").write_text(BOARD)
    bit = 1 << [name for name, _ in HEALTH].index(health)
    numbers = (16 + 8 * (parameters + inputs) + 8, results, bit, sample)
    return "10", sys.executable, str(tmp_path / "board.py"), *map(str, numbers)


@pytest.mark.parametrize(
    ("health", "sample", "words"),
    [
        ("LOST", 0, "refused its parameters or first sample (health 0x"),
        ("LOST", 2, "says that its state is lost"),
        ("FAILED", 2, "says that its step failed"),
    ],
)
def test_a_component_that_has_no_state_or_no_results_stops_the_run(begin, tmp_path, health, sample, words):
    fmu = begin(*board(tmp_path, health, sample))
    if sample == 0:
        with pytest.raises(Exception, match="fmi2ExitInitializationMode"):
            fmu.initialize()
    else:
        fmu.initialize()
        assert fmu.step(PERIOD) == 0
        assert fmu.step(PERIOD) == 2
    assert words in fmu.messages[-1]


@pytest.mark.parametrize("health", ["LOST", "FAILED"])
def test_a_run_in_which_it_has_none_ends_with_its_words(path, built, tmp_path, health):
    for kind, fmu in built("native").items():
        shutil.copy(fmu, tmp_path / f"{kind}.fmu")
    with zipfile.ZipFile(path) as made, zipfile.ZipFile(tmp_path / "compensator.fmu", "w") as changed:
        for name in made.namelist():
            words = "\n".join(board(tmp_path, health, 7)) if name.endswith("processor.txt") else made.read(name)
            changed.writestr(name, words)
    result = invoke(["run", "damaged", "--fmus", str(tmp_path), "--stop", "0.015", "--out", str(tmp_path / "out")])
    assert result.exit_code == 1, result.output
    words = {"LOST": "says that its state is lost", "FAILED": "says that its step failed"}[health]
    assert f"{words} (health 0x{1 << [name for name, _ in HEALTH].index(health):x}) of sample 7" in " ".join(
        result.output.split()
    )


def test_instances_of_one_binary_have_resources_of_their_own(begin, path, unzipped, tmp_path):
    other = tmp_path / "other"
    shutil.copytree(unzipped, other, copy_function=os.link)  # the same library to the loader
    (other / "resources/processor.txt").unlink()
    (other / "resources/processor.txt").write_text("5\nfalse\n")
    first = begin()
    second = Instance(path, other)
    first.initialize()
    assert first.step(PERIOD) == 0
    with pytest.raises(Exception, match="fmi2ExitInitializationMode"):
        second.initialize()
    second.slave.freeInstance()


def test_the_period_is_that_of_the_first_step(begin):
    fmu = begin()
    fmu.initialize()
    assert fmu.step(1e-3) == 0
    assert fmu.step(5e-4) == 2
    assert "a step of 0.0005 s is not the period of the processor" in fmu.messages[-1]
    assert fmu.step(1e-3) == 0


def test_its_state_cannot_be_saved_and_it_says_so(begin):
    fmu = begin()
    assert not fmu.description.coSimulation.canGetAndSetFMUstate
    fmu.initialize()
    with pytest.raises(Exception, match="fmi2GetFMUstate"):
        fmu.slave.getFMUState()
    assert "is elsewhere and cannot be saved" in fmu.messages[-1]


def test_an_emulator_ends_with_its_host_however_that_ends(path, unzipped):
    code = (
        "import sys, time; from fmu_host import Instance; from pathlib import Path\n"
        "fmu = Instance(Path(sys.argv[1]), sys.argv[2]); fmu.initialize(); print('begun', flush=True); time.sleep(60)"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    host = subprocess.Popen(
        [sys.executable, "-c", code, str(path), str(unzipped)], stdout=subprocess.PIPE, text=True, env=environment
    )
    assert host.stdout.readline() == "begun\n"
    children = Path(f"/proc/{host.pid}/task/{host.pid}/children").read_text().split()
    assert len(children) == 1
    host.kill()
    host.wait()
    host.stdout.close()
    end = time.monotonic() + 10.0
    while Path(f"/proc/{children[0]}/cmdline").exists() and Path(f"/proc/{children[0]}/cmdline").read_bytes():
        assert time.monotonic() < end
        time.sleep(0.05)

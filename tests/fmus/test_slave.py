"""What only FMUs that run in Python need: neighbours in one interpreter, pythonfmu's faults, interrupts."""

import math
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from fmu_host import Instance

OK, DISCARD = 0, 2


@pytest.fixture
def kind():
    return "python"


def test_calls_in_the_wrong_state_are_refused_and_survived(instance):
    fmu = instance("sensor")
    assert fmu.step(1e-3) == DISCARD
    assert "must be initialized" in fmu.messages[-1]
    fmu.initialize()
    fmu.set("rest_resistance", 5.0)
    assert "is fixed once" in fmu.messages[-1]
    fmu.set("resistance", 5.0)
    assert "is a result" in fmu.messages[-1]
    assert fmu.step(1e-3) == OK


def test_a_second_initialization_is_refused_and_the_run_goes_on(instance):
    fmu = instance("sensor")
    fmu.initialize()
    fmu.slave.exitInitializationMode()
    assert "initialized already" in fmu.messages[-1]
    assert fmu.step(1e-3) == OK


def test_unknown_references_and_other_types_are_refused_and_survived(instance):
    fmu = instance("sensor")
    fmu.initialize()
    assert all(math.isnan(value) for value in fmu.slave.getReal([0, 999_999]))
    fmu.slave.setReal([4_000_000_000], [1.0])
    assert "no variable number" in fmu.messages[-1]
    assert fmu.slave.getInteger([0, 1]) == [0, 0]
    assert fmu.slave.getBoolean([0]) == [0]
    assert fmu.slave.getString([0]) == [b""]
    fmu.slave.setInteger([0], [1])
    fmu.slave.setBoolean([0], [True])
    fmu.slave.setString([0], ["one"])
    assert "real variables only" in fmu.messages[-1]
    assert fmu.step(1e-3) == OK


def test_a_failed_initialization_is_told_at_every_step(instance):
    fmu = instance("membrane")
    fmu.initialize(youngs_modulus=-1.0)
    assert "'youngs_modulus'" in fmu.messages[-1]
    assert fmu.step(3e-4) == DISCARD
    assert "'youngs_modulus'" in fmu.messages[-1]
    fmu.slave.reset()
    fmu.initialize()
    assert fmu.step(3e-4) == OK


@pytest.mark.parametrize("spoil", [lambda b: b[:-1], lambda b: b"", lambda b: bytes([b[0] ^ 1]) + b[1:]])
def test_a_spoilt_state_is_refused_and_the_run_goes_on(instance, spoil):
    fmu = instance("sensor")
    fmu.initialize()
    fmu.step(1e-3)
    state = fmu.slave.getFMUstate()
    spoilt = spoil(fmu.slave.serializeFMUstate(state))
    fmu.slave.freeFMUstate(state)
    before = fmu.get("resistance")
    restored = fmu.slave.deSerializeFMUstate(spoilt)
    fmu.slave.setFMUstate(restored)
    fmu.slave.freeFMUstate(restored)
    assert "saved state" in fmu.messages[-1]
    assert fmu.get("resistance") == before
    assert fmu.step(1e-3) == OK


STRANGER = """
import {module}
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Stranger(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = float({module}.VALUE)
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        return True
"""


@pytest.mark.parametrize("ours_first", [True, False])
def test_a_strangers_fmu_with_modules_of_our_names_keeps_its_own(fmus, tmp_path, ours_first):
    """Each in one process of its own, because modules stay loaded."""
    for module in ("gossamer_models", "stepper", "step_model", "errors", "slave"):
        source = tmp_path / module
        source.mkdir()
        (source / f"{module}.py").write_text("VALUE = 41\n")
        (source / f"stranger_{module}.py").write_text(STRANGER.format(module=module))
        build = [sys.executable, "-m", "pythonfmu", "build", "-f", f"stranger_{module}.py", "-d", ".", f"{module}.py"]
        subprocess.run(build, cwd=source, check=True, capture_output=True)
        shutil.copy(source / "Stranger.fmu", tmp_path / f"{module}.fmu")
    order = ["ours", "strangers"] if ours_first else ["strangers", "ours"]
    code = f"""
import sys
sys.path[:] = [p for p in sys.path if "models" not in p]  # a host without this project
import fmpy
def run(path, output):
    return float(fmpy.simulate_fmu(path, stop_time=0.01, step_size=0.001, output=[output])[output][-1])
for who in {order!r}:
    if who == "ours":
        for _ in range(2):
            print("ours", run({str(fmus["sensor"])!r}, "resistance"), run({str(fmus["membrane"])!r}, "strain[1]"))
    else:
        for module in ("gossamer_models", "stepper", "step_model", "errors", "slave"):
            print("stranger", run({str(tmp_path)!r} + "/" + module + ".fmu", "y"))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.split("\n")
    assert sum(line == "stranger 41.0" for line in lines) == 5, done.stdout
    assert len({line for line in lines if line.startswith("ours")}) == 1, done.stdout


def in_a_process(code, *arguments):
    """Run code that finds the FMU, its folder and the path of this one in ``sys.argv``."""
    head = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); from fmu_host import Instance\n"
    command = [sys.executable, "-c", head + code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


THOUSAND = """
import gc
keep = Instance(*sys.argv[1:])
keep.initialize()
slave = next(module for name, module in sys.modules.items() if name.startswith("slave_"))

def kibibytes_after(instances):
    for k in range(instances):
        Instance(*sys.argv[1:]).slave.freeInstance()
    gc.collect()
    return int(open("/proc/self/statm").read().split()[1]) * 4

before, references = kibibytes_after(200), sys.getrefcount(vars(slave))
growth = kibibytes_after(1000) - before
assert sys.getrefcount(vars(slave)) == references
keep.set("strain", 0.1)
assert keep.step(0.1) == 0
keep.slave.freeInstance()
print(growth)
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads /proc, which this system does not have")
def test_a_thousand_instances_come_and_go(fmus, unzipped):
    """pythonfmu miscounts the references to what it loads; what is left is its own leak, about 1 KiB per instance."""
    done = in_a_process(THOUSAND, fmus["sensor"], unzipped["sensor"])
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < 8_000


FREED = """
import gc
gc.disable()
keep = Instance(*sys.argv[1:])
for k in range(3):
    keep.initialize()
    keep.slave.reset()
    Instance(*sys.argv[1:]).slave.freeInstance()
print(sum(type(each).__name__ == "GossamerSlave" for each in gc.get_objects()))
"""


def test_an_instance_that_is_reset_or_freed_is_gone_before_python_looks_for_circles(fmus, unzipped):
    """A slave holds buffers of up to 1 MiB, and a host may not wait for the collector of its interpreter."""
    done = in_a_process(FREED, fmus["sensor"], unzipped["sensor"])
    assert (done.returncode, done.stdout) == (0, "1\n"), done.stderr


INTERRUPTED = """
import os, signal, threading, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a test run in the background ignores it
fmu = Instance(*sys.argv[1:])
fmu.initialize()
threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
end, status = time.monotonic() + 60.0, 0
while status == 0 and time.monotonic() < end:
    status = fmu.step(0.1)
print(status, fmu.step(3e-4), fmu.messages[-1])
fmu.slave.reset()
fmu.initialize()
print(fmu.step(3e-4))
fmu.slave.freeInstance()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="sends a signal")
def test_an_interrupt_during_a_step_refuses_it_and_all_others_until_reset(fmus, unzipped):
    """Ctrl-C that got as far as pythonfmu would crash the host; long steps, so that it comes in the middle of one."""
    done = in_a_process(INTERRUPTED, fmus["membrane"], unzipped["membrane"])
    assert done.returncode == 0, done.stderr
    refused, resumed = done.stdout.splitlines()
    assert refused.startswith("2 2 interrupted")
    assert resumed == "0"


@pytest.mark.parametrize("spoilt", ["model.json", "init.casadi", "step.casadi"])
def test_a_truncated_resource_fails_to_instantiate_without_harm(fmus, unzipped, tmp_path, spoilt):
    folder = tmp_path / "spoilt"
    shutil.copytree(unzipped["sensor"], folder)
    path = folder / "resources" / spoilt
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(Exception, match="instantiate"):
        Instance(fmus["sensor"], folder)
    fine = Instance(fmus["sensor"], unzipped["sensor"])
    fine.slave.freeInstance()

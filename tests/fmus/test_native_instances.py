"""Instances of native FMUs: a thousand at once, in threads, one allocation each."""

import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor

import pytest
from fmu_host import FMUS, Instance, excite, model_of
from gossamer_fmus.c_code import sources
from gossamer_fmus.compiler import fmi_headers

OK = 0


@pytest.fixture
def kind():
    return "native"


def test_a_thousand_instances_live_side_by_side(fmus, unzipped):
    instances = [Instance(fmus["sensor"], unzipped["sensor"], f"sensor{k}") for k in range(1000)]
    for k, fmu in enumerate(instances):
        fmu.initialize(rest_resistance=100.0 + k)
    for fmu in instances:
        assert fmu.step(0.1) == OK
    assert [fmu.get("resistance")[0] for fmu in instances] == [100.0 + k for k in range(1000)]
    for fmu in instances:
        fmu.slave.freeInstance()


@pytest.mark.parametrize("name", FMUS)
def test_instances_in_four_threads_give_what_one_gives(instance, name):
    """ctypes releases the interpreter's lock during a call, so the steps do run side by side."""

    def run(fmu):
        fmu.initialize()
        rows = []
        for k in range(300):
            for key, value in excite(name, k).items():
                fmu.set(key, value)
            assert fmu.step(3e-4) == OK
            rows.append(fmu.get(*fmu.names("output")))
        return rows

    wanted = run(instance(name))
    with ThreadPoolExecutor(4) as pool:
        assert all(rows == wanted for rows in pool.map(run, [instance(name) for _ in range(4)]))


STEPS = """
#include "fmi2.c"
static int allocations;
void *__real_malloc(size_t n);
void *__real_calloc(size_t n, size_t size);
void *__wrap_malloc(size_t n) { allocations++; return __real_malloc(n); }
void *__wrap_calloc(size_t n, size_t size) { allocations++; return __real_calloc(n, size); }
int main(void) {
  fmi2CallbackFunctions callbacks = {0};
  Instance *m = fmi2Instantiate("m", fmi2CoSimulation, MODEL_GUID, ".", &callbacks, 0, 0);
  fmi2EnterInitializationMode(m);
  if (!m || fmi2ExitInitializationMode(m) || allocations != 1 + HAS_TABLES) return 1;
  for (int k = 0; k < 1000; k++) if (fmi2DoStep(m, 3e-4 * k, 3e-4, fmi2True)) return 2;
  return allocations == 1 + HAS_TABLES ? 0 : 3;
}
"""


@pytest.mark.skipif(shutil.which("gcc") is None, reason="counts allocations with gcc's linker, which is not installed")
@pytest.mark.parametrize("name", FMUS)
def test_an_instance_is_one_allocation_beside_the_tables_of_all_and_a_step_is_none(tmp_path, name):
    for file, content in sources(model_of(name), "{guid}", 2).items():
        (tmp_path / file).write_bytes(content)
    (tmp_path / "steps.c").write_text(STEPS)
    wrap = "-Wl,--wrap=malloc,--wrap=calloc"
    command = ["gcc", "-O0", "steps.c", "-o", "steps", "-I", ".", "-I", str(fmi_headers()), wrap, "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert subprocess.run([str(tmp_path / "steps")], cwd=tmp_path, check=False).returncode == 0

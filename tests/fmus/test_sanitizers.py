"""The C code of native FMUs under the compilers' sanitizers and warnings, driven by the random calls of ``fuzz.c``."""

import importlib.util
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import pytest
from fmu_host import FMUS
from gossamer_fmus import build_all

FUZZ = Path(__file__).with_name("fuzz.c")
HEADERS = Path(fmpy.__file__).parent / "c-code"
STANDARD = ["-std=c11", "-isystem", HEADERS]
# Not optimized: the generated code compiles four times faster, and every access is checked.
MEMORY = ["-O0", "-g1", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
THREADS = ["-O0", "-g1", "-fsanitize=thread"]
ZIG = [sys.executable, "-m", "ziglang", "cc"]


def run(*command, **options):
    return subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, check=False, timeout=300, **options
    )


@pytest.fixture(scope="module")
def compiler(tmp_path_factory):
    """Find a C compiler whose sanitizers, named by their flags, can be linked and run here."""

    def find(flags):
        folder = tmp_path_factory.mktemp("try")
        (folder / "try.c").write_text("int main(void) { return 0; }\n")
        for name in filter(shutil.which, ("gcc", "clang")):
            built = run(name, *flags, "try.c", "-o", "try", cwd=folder)
            if built.returncode == 0 and run(folder / "try").returncode == 0:
                return name
        return pytest.skip(f"no C compiler here has {flags[-1]}")

    return find


@pytest.fixture(scope="module")
def sources(built, tmp_path_factory):
    """Folder of the C sources inside an FMU, beside that of its resources, by version of FMI and name.

    The membrane's mesh is of order 1: what we write in C is the same, what CasADi writes is shorter.
    """

    def get(fmi, name):
        folder = tmp_path_factory.mktemp(f"{name}{fmi}")
        if name == "membrane":
            path = build_all(folder, [name], native=True, fmi=fmi, elements_per_side=4, order=1)[name]
        else:
            path = built("native" if fmi == 2 else "native FMI 3")[name]
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder, [name for name in archive.namelist() if name.startswith(("sources/", "resources/"))])
        return folder / "sources"

    return get


def fuzzer(compiler, flags, fmi, sources):
    """Compile the random calls together with an FMU."""
    program = sources / "fuzz"
    options = [f"-DFMI={fmi}", f'-DRESOURCES="{sources.parent / "resources"}"', *flags]
    command = [compiler(flags), *STANDARD, *options, "-isystem", sources, FUZZ, "-o", program]
    done = run(*command, "-lm", "-pthread")
    assert done.returncode == 0, done.stderr
    return program


# the framed membrane has no C of its own but what CasADi writes, and takes five minutes
@pytest.mark.parametrize("name", [name for name in FMUS if name != "framed_membrane"])
@pytest.mark.parametrize("fmi", [2, 3])
def test_random_calls_touch_no_foreign_memory_leak_nothing_and_leave_no_trace_where_refused(compiler, sources, fmi, name):
    calls = 500 if name == "membrane" else 4000
    done = run(fuzzer(compiler, MEMORY, fmi, sources(fmi, name)), calls, 1, 1)
    assert done.returncode == 0, done.stderr
    _, steps, refused = done.stdout.split()
    assert int(steps) > calls / 5
    assert int(refused) > calls / 5


@pytest.mark.parametrize(
    ("file", "right", "wrong", "report"),
    [
        ("state.h", "size != STATE_SIZE || ", "", "heap-buffer-overflow"),
        ("state.h", "  free(*saved);\n", "", "LeakSanitizer"),
        ("stepper.h", "index < FIRST_INPUT || index >= FIRST_RESULT", "0", "out of bounds"),
        ("stepper.h", "  s->checked = true;\n", "  s->checked = true, s->state.last_step = h;\n", "memcmp"),
    ],
)
def test_the_random_calls_would_find_a_mistake(compiler, sources, file, right, wrong, report):
    folder = sources(2, "sensor")
    text = (folder / file).read_text()
    assert right in text
    (folder / file).write_text(text.replace(right, wrong))
    done = run(fuzzer(compiler, MEMORY, 2, folder), 5000, 1, 1)
    assert done.returncode != 0
    assert report in done.stderr


@pytest.mark.parametrize("name", ["sensor", "detector"])
def test_four_threads_with_instances_of_their_own_do_not_meet(compiler, sources, name):
    program = fuzzer(compiler, THREADS, 3, sources(3, name))
    together = run(program, 2000, 7, 4)
    assert together.returncode == 0, together.stderr
    assert together.stdout == "".join(run(program, 2000, 7 + k, 1).stdout for k in range(4))


@pytest.mark.parametrize("command", [["gcc"], ["clang"], ZIG], ids=["gcc", "clang", "zig"])
@pytest.mark.parametrize("fmi", [2, 3])
def test_our_own_sources_compile_without_a_warning(sources, tmp_path, command, fmi):
    """Warnings about what CasADi and the standard wrote do not count: theirs are system headers here."""
    there = shutil.which(command[0]) if command != ZIG else importlib.util.find_spec("ziglang")
    if not there:
        pytest.skip(f"no {command[0]} here")
    for path in sources(fmi, "sensor").iterdir():
        ours = path.name in ("fmi2.c", "fmi3.c", "stepper.h", "state.h", "instance.h", "model.h")
        folder = tmp_path / ("ours" if ours else "theirs")
        folder.mkdir(exist_ok=True)
        shutil.copy(path, folder)
    warnings = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    flags = [*STANDARD, "-O2", *warnings, "-isystem", tmp_path / "theirs", "-c", "-o", tmp_path / "object"]
    done = run(*command, *flags, tmp_path / "ours" / f"fmi{fmi}.c")
    assert done.returncode == 0, done.stderr

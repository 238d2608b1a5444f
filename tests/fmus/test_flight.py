"""Components for a flight processor: their numbers, what they refuse and survive, and what they need."""

import ctypes
import math
import re
import shutil
import subprocess
import time
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmu_host import Instance
from gossamer_fmus.catalogue import make_model
from gossamer_fmus.flight import HEALTH, PERIOD, flight_files, golden_vectors, vectors_of
from gossamer_fmus.flight_budgets import FlightError, budgets, missing_tools, run_tool, stack_bound
from gossamer_models import ParameterError, Stepper
from gossamer_models.compensator import compensator_model
from gossamer_models.detector import PosteriorArtifact, posterior_model
from gossamer_models.membrane import square_structure
from gossamer_models.sensor import default_artifact
from gossamer_models.twin.on_board import example_inputs, watch_model
from gossamer_models.twin.settled import stored_responses
from oracles.direct import direct_inverse

KINDS = ("compensator", "estimator", "filter")
BIT = {name: 1 << k for k, (name, _) in enumerate(HEALTH)}
STRICT = ["-std=c11", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Werror"]
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
SPARC, NEWLIB = shutil.which("sparc64-linux-gnu-gcc"), Path("/usr/include/newlib")
MAKE = ["make", "-s", f"CC={COMPILERS[0] if COMPILERS else ''}", "OPT=-O1"]
needs_compiler = pytest.mark.skipif(not COMPILERS or not shutil.which("make"), reason="no gcc, clang or make here")
needs_board = pytest.mark.skipif(bool(missing_tools()), reason=f"not installed: {', '.join(missing_tools())}")


def run(*command, folder, code=0, seconds=300):
    done = subprocess.run(
        [str(part) for part in command], cwd=folder, capture_output=True, text=True, check=False, timeout=seconds
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout


def write(folder, files):
    for name, content in files.items():
        (folder / name).write_bytes(content)


@pytest.fixture(scope="module")
def vectors():
    sensor = make_model("sensor")
    return {kind: golden_vectors(make_model(kind), sensor) for kind in KINDS}


@pytest.fixture(scope="module")
def written(vectors, tmp_path_factory):
    """Folder of a component by kind and bits."""
    folders = {}

    def get(kind, bits=64):
        if (kind, bits) not in folders:
            folders[kind, bits] = folder = tmp_path_factory.mktemp(f"{kind}_{bits}")
            write(folder, flight_files(make_model(kind), kind, *vectors[kind], bits))
        return folders[kind, bits]

    return get


def printed(text):
    return {name: float(value) for name, value in re.findall(r"^(\w+) (\S+)$", text, re.MULTILINE)}


@needs_compiler
@pytest.mark.parametrize("kind", KINDS)
def test_a_component_has_the_bits_of_the_model(written, kind):
    found = printed(run(*MAKE, "golden", folder=written(kind)))
    assert found["different"] == found["health"] == 0


def direct_compensator():
    return compensator_model(replace(default_artifact(), inverse=direct_inverse()), ageing=True), make_model("sensor")


def thesis_detector():
    return make_model("detector", artifact=Path("single_damage")), None


@needs_compiler
@pytest.mark.parametrize("make", [direct_compensator, thesis_detector])
def test_so_has_one_of_an_artifact(tmp_path, make):
    model, sensor = make()
    write(tmp_path, flight_files(model, "other", *golden_vectors(model, sensor)))
    found = printed(run(*MAKE, "golden", folder=tmp_path))
    assert found["different"] == found["health"] == 0


def small_detector():
    """Return two windows of the detector `nominal`, with a quarter of its components and some of its network."""
    nominal = PosteriorArtifact.default()
    windows = []
    for window in nominal.windows[:2]:
        some = np.arange(0, window.sectors.size, 4)
        W, b, *hidden = (a[..., :64] for a in window.encoder[:4])
        encoder = (W[[*some, -1]], b, hidden[0][:64], hidden[1], window.encoder[-2][:64], window.encoder[-1])
        kept = {"axes": window.axes[:, some], "sectors": window.sectors[some], "variances": window.variances[some]}
        windows.append(replace(window, **kept, encoder=encoder, latent=window.latent[:64]))
    return posterior_model(replace(nominal, windows=tuple(windows)))


IN_SLICES = r"""
#include "detector.c"
#include "golden.h"
#include <stdio.h>
static detector c, begun;
static detector_work work;
static detector_outputs y;
static int k;
static uint32_t go(void) {
  detector_inputs u;
  detector_to_inputs(GOLDEN_INPUTS[k], &u);
  u.sequence = (uint32_t)k++;
  detector_seal(&u);
  detector_parameters p = detector_start_parameters;
  p.repeat = 1;
  if (k == 1) return detector_init(&c, &p, GOLDEN_PERIOD, &u, &work);
  return detector_step(&c, &u, &y, &work);
}
static int is(int row) { return memcmp(c.first.results, GOLDEN_RESULTS[row], sizeof c.first.results) == 0; }
int main(void) {
  uint32_t health = 0U, calls = 0U;
  while (k == 0 || c.first.judging.slice == 0U) health = go();
  const int end = k - 1;
  begun = c;
  for (; c.first.judging.slice != DETECTOR_N_SLICES; calls++) health |= detector_slice(&c, &work);
  health |= go();
  printf("early %d", is(end + (int)DETECTOR_ANSWERS_AFTER));
  printf(" %d %x\n", (int)DETECTOR_ANSWERS_AFTER - (int)calls, health & DETECTOR_UNJUDGED);
  c = begun;
  k = end + 1;
  c.live[DETECTOR_VALUES[DETECTOR_PARTS[c.first.judging.slice].first_value].place] += 1;
  health = go();
  const int seen = (health & DETECTOR_UNJUDGED) != 0U, kept = is(end);
  while ((health & DETECTOR_UNJUDGED) != 0U) health = go();
  printf("lost %d %d until %d %d\n", seen, kept, k - 1 == 2 * end + (int)DETECTOR_ANSWERS_AFTER, is(k - 1));
  detector_block saved;
  printf("saved %d", detector_save(&begun, &saved));
  printf(" %x\n", detector_restore(&c, &saved, (uint32_t)end) & DETECTOR_UNJUDGED);
  return 0;
}
"""


MIXED = r"""
#include "detector.c"
#include "golden.h"
#include <stdio.h>
static detector a, at_once;
static detector_work work;
static detector_outputs y;
static uint32_t seed = 7U;
static uint32_t draw(uint32_t below) {
  seed = seed * 1664525U + 1013904223U;
  return (seed >> 8U) % below;
}
int main(void) {
  static const double ratios[] = {1.0, 2.5, 7.0}; /* of the period to the sampling step */
  for (int run = 0; run < 3; run++) {
    detector_parameters p = detector_start_parameters;
    detector_inputs u;
    detector_real before[DETECTOR_N_RESULTS], right[DETECTOR_N_RESULTS];
    int windows = 0, published = 0, wrong = 0, lost = 0;
    p.repeat = 1;
    p.window_length = 60 * p.sampling_step;
    for (int t = 0; t < 1200; t++) {
      detector_to_inputs(GOLDEN_INPUTS[t], &u);
      u.sequence = (t == 0) ? 0U : u.sequence + ((draw(5U) == 0U) ? draw(9U) : 1U); /* late, missing and repeated ones */
      detector_seal(&u);
      u.crc ^= (t > 0) && (draw(100U) == 0U); /* refused */
      if (t == 0) {
        (void)detector_init(&a, &p, ratios[run] * p.sampling_step, &u, &work);
        at_once = a;
        continue;
      }
      if (draw(100U) == 0U) a.live[draw(DETECTOR_N_LIVE)] += 1;
      if (draw(20U) == 0U) (void)detector_slice(&a, &work);
      (void)memcpy(before, a.first.results, sizeof before);
      lost += (detector_step(&a, &u, &y, &work) & DETECTOR_UNJUDGED) != 0U;
      if (memcmp(before, a.first.results, sizeof before) != 0) {
        published++;
        wrong += memcmp(right, a.first.results, sizeof right) != 0;
      }
      (void)detector_step(&at_once, &u, &y, &work);
      if (at_once.first.judging.slice != 0U) {
        windows++;
        while (at_once.first.judging.slice != DETECTOR_N_SLICES) (void)detector_slice(&at_once, &work);
        (void)memcpy(right, at_once.live, sizeof right);
      }
    }
    printf("%d %d %d\n", published > 10 && published < windows, wrong, lost > 0);
  }
  return 0;
}
"""


def run_beside_small_detector(code, folder):
    """Write the small detector, compile a program that includes it, and return the lines that this prints."""
    model = small_detector()
    write(folder, flight_files(model, "detector", *golden_vectors(model, None)) | {"program.c": code.encode()})
    run(COMPILERS[0], *STRICT[:2], "-O1", "program.c", "-lm", "-o", "program", folder=folder)
    return run(folder / "program", folder=folder).splitlines()


@needs_compiler
def test_windows_do_not_mix_whatever_samples_come_and_whatever_the_period_is(tmp_path):
    assert run_beside_small_detector(MIXED, tmp_path) == ["1 0 1"] * 3


@needs_compiler
def test_a_window_is_judged_in_slices_and_one_that_is_damaged_meanwhile_is_said_to_be_lost(tmp_path):
    assert run_beside_small_detector(IN_SLICES, tmp_path) == [
        "early 1 1 0",  # the first slice was in the step that ended the window
        "lost 1 1 until 1 1",
        "saved 1 400",
    ]
    for compiler in COMPILERS:
        run(compiler, *STRICT, "-fsyntax-only", "detector.c", "main.c", folder=tmp_path)
    found = printed(run(*MAKE, "golden", folder=tmp_path))
    assert found["different"] == found["health"] == 0
    lines = run(*MAKE, "upsets", "FLIPS=20", folder=tmp_path).splitlines()
    assert all(line.endswith(" 0 of these not seen, 0 valid and wrong") for line in lines)
    assert sum(int(re.search(r"(\d+) moved", line)[1]) for line in lines) > 0


@needs_compiler
def test_so_has_the_watch_which_no_flipped_bit_makes_wrong(tmp_path):
    stored = stored_responses(square_structure(8, 1), exact_mesh=True)
    model = watch_model(stored, 1e-3)
    stepper = Stepper(model)
    stepper.warn = lambda _: None
    vectors, golden = vectors_of(stepper, example_inputs(stored, 1e-3).T, stored.step)
    assert golden[-1, 0] == 1.0  # an alarm
    write(tmp_path, flight_files(model, "watch", vectors, golden, period=stored.step))
    found = printed(run(*MAKE, "golden", folder=tmp_path))
    assert found["different"] == found["health"] == 0
    lines = run(*MAKE, "upsets", "FLIPS=50", folder=tmp_path).splitlines()
    assert all(line.endswith(" 0 of these not seen, 0 valid and wrong") for line in lines)
    assert sum(int(re.search(r"(\d+) moved", line)[1]) for line in lines) > 0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("bits", [64, 32])
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_it_compiles_without_warnings(written, kind, bits, compiler):
    if compiler not in COMPILERS:
        pytest.skip(f"no {compiler} here")
    run(compiler, *STRICT, "-fsyntax-only", f"{kind}.c", "main.c", folder=written(kind, bits))


@needs_compiler
@pytest.mark.parametrize(("kind", "bound"), [("compensator", 1e-6), ("estimator", 5e-5)])
def test_single_precision_is_as_good_as_the_page_says(written, kind, bound):
    assert 0.0 < printed(run(*MAKE, "golden", folder=written(kind, 32)))["worst"] < bound


@pytest.mark.skipif("clang" not in COMPILERS, reason="no clang here")
@pytest.mark.parametrize("kind", KINDS[:2])
def test_clang_gives_the_bits_of_the_model(written, kind):
    folder = written(kind)
    run("clang", *STRICT[:2], "-O2", f"{kind}.c", "golden.c", "-lm", "-o", "by_clang", folder=folder)
    found = printed(run(folder / "by_clang", folder=folder))
    assert found["different"] == found["health"] == 0


@pytest.mark.skipif(not (SPARC and NEWLIB.is_dir()), reason="no gcc-sparc64-linux-gnu or newlib's headers here")
@pytest.mark.parametrize("bits", [64, 32])
def test_it_compiles_for_a_leon3_and_needs_mathematics_and_nothing_else(written, bits):
    folder = written("compensator", bits)
    options = ("-m32", "-mcpu=leon3", "-fno-pic", "-O1", "-isystem", NEWLIB)
    run(SPARC, *options, *STRICT, "-c", "compensator.c", "-o", "leon.o", folder=folder)
    assert (folder / "leon.o").read_bytes()[:20] == b"\x7fELF\x01\x02\x01" + bytes(9) + b"\x00\x01\x00\x02"  # 32 bits, SPARC
    symbols = [line.split() for line in run("sparc64-linux-gnu-nm", "leon.o", folder=folder).splitlines()]
    wanted = {words[-1].removesuffix("f") for words in symbols if words[-2] == "U"}
    assert wanted <= {"memcpy", "memset", "exp", "floor", "fmax", "fmin", "fabs", "sqrt"}


def test_golden_vectors_are_what_the_native_fmu_gives(vectors, built, unzipped_once):
    (parameters, inputs), results = vectors["compensator"]
    model = make_model("compensator")
    names = [model.names[part] for part in model.slices()]
    path = built("native")["compensator"]
    fmu = Instance(path, unzipped_once(path))
    try:
        fmu.initialize(
            **dict(zip(names[0], parameters, strict=True)), **dict(zip(names[1], inputs[0].tolist(), strict=True))
        )
        rows = [fmu.get(*names[2])]
        for row in inputs[1:]:
            for name, value in zip(names[1], row.tolist(), strict=True):
                fmu.set(name, value)
            assert fmu.step(PERIOD) == 0
            rows.append(fmu.get(*names[2]))
    finally:
        fmu.slave.freeInstance()
    assert np.array(rows).tobytes() == results.tobytes()


@needs_board
@pytest.mark.parametrize(("kind", "bits"), [("compensator", 64), ("estimator", 64)])
def test_a_cortex_m7_gives_the_golden_results_within_its_budgets(written, kind, bits):
    found = budgets(written(kind, bits), kind)
    assert found["worst"] <= 1e-12
    assert found["ram"] < 8 * 1024
    assert found["stack"] < 1280
    assert found["stack"] + found["work"] < (8 if kind == "compensator" else 16) * 1024
    assert found["most"] < 1.01 * found["mean"]  # a step takes as long, whatever comes in


@needs_board
def test_what_is_counted_is_instructions(written, tmp_path):
    """A loop of two instructions, a million times."""
    for name in ("board.c", "board.h", "board.ld", "Makefile"):
        shutil.copy(written("compensator") / name, tmp_path)
    (tmp_path / "loop.c").write_text(
        '#include "board.h"\n#include <stdio.h>\nint main(void) {\n  const uint32_t begin = BOARD_COUNT();\n'
        '  __asm volatile("ldr r0, =1000000\\n1: subs r0, #1\\n bne 1b" ::: "r0", "cc");\n'
        '  printf("count %lu\\n", (unsigned long)BOARD_PASSED(begin, BOARD_COUNT()));\n  return 0;\n}\n'
    )
    make = (tmp_path / "Makefile").read_text().replace("compensator.c golden.c board.c", "loop.c board.c")
    (tmp_path / "Makefile").write_text(re.sub(r"^board\.elf: .*$", "board.elf: loop.c", make, flags=re.MULTILINE))
    assert printed(run("make", "-s", "qemu", folder=tmp_path))["count"] == pytest.approx(2e6, abs=100)


@pytest.mark.skipif(not (shutil.which("s390x-linux-gnu-gcc") and shutil.which("qemu-s390x")), reason="no s390x here")
def test_a_processor_with_the_highest_byte_first_gives_the_same_bits(written):
    folder = written("compensator")
    options = ("-std=c11", "-O1", "-ffp-contract=off", "-static")
    run("s390x-linux-gnu-gcc", *options, "compensator.c", "golden.c", "-lm", "-o", "highest_first", folder=folder)
    found = printed(run("qemu-s390x", "highest_first", folder=folder))
    assert found["different"] == found["health"] == 0


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="no /proc here")
def test_what_takes_too_long_is_ended_with_all_that_it_started(tmp_path):
    with pytest.raises(FlightError, match="did not end within"):
        run_tool(["sh", "-c", "sleep 60 & echo $! > pid; wait"], tmp_path, 0.5)
    child = Path("/proc") / (tmp_path / "pid").read_text().strip() / "stat"
    end = time.monotonic() + 10.0
    while child.exists() and child.read_text().split()[2] != "Z":
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_function_that_calls_itself_has_no_stack_bound():
    node = 'node: {{ title: "{0}" label: "{0}\\nx.c:1:1\\n{1} bytes (static)\\n0 dynamic objects" }}\n'
    edge = 'edge: {{ sourcename: "{}" targetname: "{}" label: "x.c:2:2" }}\n'
    graph = node.format("step", 100) + node.format("a", 20) + node.format("b", 30)
    graph += edge.format("step", "a") + edge.format("step", "b") + edge.format("a", "exp")
    assert stack_bound(graph, "step") == 130.0
    with pytest.raises(FlightError, match="step > b > step"):
        stack_bound(graph + edge.format("b", "step"), "step")
    with pytest.raises(FlightError, match="no bound: step > __indirect_call"):
        stack_bound(graph + edge.format("step", "__indirect_call"), "step")


@needs_compiler
@pytest.mark.parametrize("kind", KINDS[:2])
def test_it_needs_mathematics_and_nothing_else(written, kind):
    folder = written(kind)
    run(COMPILERS[0], "-std=c11", "-O1", "-fno-pic", "-ffp-contract=off", "-c", f"{kind}.c", "-o", "bare.o", folder=folder)
    symbols = [line.split() for line in run("nm", "bare.o", folder=folder).splitlines()]
    wanted = {words[-1] for words in symbols if words[-2] == "U"}
    assert wanted <= {"memcpy", "memset", "__stack_chk_fail", "exp", "floor", "fmax", "fmin", "fabs", "sqrt"}
    assert not [
        words for words in symbols if words[-2] in "bBdDC"
    ]  # nothing that is written lies outside the caller's memory
    exported = {words[-1] for words in symbols if words[-2] == "T"}
    assert all(name.startswith(f"{kind}_") for name in exported)


def test_a_model_without_a_fixed_number_of_operations_is_refused():
    membrane = make_model("membrane", compiled=True)
    with pytest.raises(ParameterError, match="Choose a compensator or a detector"):
        flight_files(membrane, "membrane", (np.zeros(0), np.zeros((0, 0))), np.zeros((0, 0)))


class Inputs(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_double) for name in ("resistance", "temperature", "known", "known_strain")),
        *((name, ctypes.c_uint32) for name in ("sequence", "crc")),
    ]


class Outputs(ctypes.Structure):
    _fields_ = [
        *((n, ctypes.c_double) for n in ("strain", "saturated", "gain", "gain_deviation", "offset", "offset_deviation")),
        *((name, ctypes.c_uint32) for name in ("sequence", "health", "crc")),
    ]


class Flown:
    """A compensator that was compiled for this machine, with the golden samples."""

    def __init__(self, library, vectors):
        self.library = library
        (parameters, self.samples), self.results = vectors
        self.parameters = (ctypes.c_double * parameters.size)(*parameters)
        self.state, self.work = ctypes.create_string_buffer(4256), ctypes.create_string_buffer(1 << 14)
        self.u, self.y = Inputs(), Outputs()

    def _sample(self, k, **change):
        number = change.pop("number", k)
        self.u.resistance, self.u.temperature, self.u.known, self.u.known_strain = self.samples[k]
        self.u.sequence = number
        for name, value in change.items():
            setattr(self.u, name, value)
        self.library.compensator_seal(ctypes.byref(self.u))

    def init(self, k=0, **change):
        self._sample(k, **change)
        period = ctypes.c_double(PERIOD)
        return self.library.compensator_init(self.state, self.parameters, period, ctypes.byref(self.u), self.work)

    def step(self, k, damage=False, **change):
        self._sample(k, **change)
        if damage:
            self.u.resistance += 1.0
        health = self.library.compensator_step(self.state, ctypes.byref(self.u), ctypes.byref(self.y), self.work)
        assert health == self.y.health
        assert self.library.compensator_is_sealed(ctypes.byref(self.y))
        return health

    def until(self, k):
        assert self.init() == 0
        assert all(self.step(each) == 0 for each in range(1, k + 1))
        return self

    def health(self):
        return self.library.compensator_health(self.state)

    def flip(self, place):
        self.state[place] = bytes([self.state[place][0] ^ 4])


@pytest.fixture(scope="module")
def library(written):
    if not COMPILERS:
        pytest.skip("no gcc or clang here")
    folder = written("compensator")
    command = ("-std=c11", "-O1", "-ffp-contract=off", "-fPIC", "-shared", "compensator.c", "-lm", "-o", "flown.so")
    run(COMPILERS[0], *command, folder=folder)
    library = ctypes.CDLL(str(folder / "flown.so"))
    for name in ("init", "step", "health", "restore"):
        getattr(library, f"compensator_{name}").restype = ctypes.c_uint32
    for name in ("save", "is_sealed", "constants_hold"):
        getattr(library, f"compensator_{name}").restype = ctypes.c_bool
    return library


@pytest.fixture
def flown(library, vectors):
    return Flown(library, vectors["compensator"])


@pytest.mark.parametrize(
    "change", [{"resistance": math.nan}, {"resistance": math.inf}, {"temperature": -1.0}, {"known": 2.0}]
)
def test_a_sample_that_is_no_number_or_out_of_range_is_refused_and_bridged(flown, change):
    flown.until(50)
    assert flown.step(51, **change) == BIT["REFUSED"]
    assert flown.y.strain == flown.results[50][0]
    assert flown.step(52) == BIT["MISSED"]
    assert flown.y.strain == pytest.approx(flown.results[52][0], abs=1e-4)


def test_a_sample_that_is_damaged_on_its_way_is_refused(flown):
    flown.until(50)
    assert flown.step(51, damage=True) == BIT["REFUSED"]
    assert flown.step(51) == 0
    assert flown.y.strain == flown.results[51][0]


def test_repeated_and_late_samples_change_nothing(flown):
    flown.until(50)
    assert flown.step(50) == flown.step(20) == BIT["REPEATED"]
    assert flown.step(51) == 0
    assert flown.y.strain == flown.results[51][0]


def test_a_gap_is_bridged_and_a_long_one_stays_in_the_health(flown):
    flown.until(50)
    assert flown.step(58) == BIT["MISSED"]
    assert flown.step(59) == 0
    assert flown.step(68) == BIT["MISSED"] | BIT["GAP"]
    assert flown.step(69) == flown.health() == BIT["GAP"]
    assert flown.init(70) == 0
    assert flown.step(71) == 0


def test_the_number_of_a_sample_may_run_over(flown):
    assert flown.init(number=2**32 - 2) == 0
    assert [flown.step(k, number=(2**32 - 2 + k) % 2**32) for k in range(1, 5)] == [0, 0, 0, 0]
    assert flown.y.strain == flown.results[4][0]


@pytest.mark.parametrize("place", [0, 200, 2000, 2120])
def test_a_damaged_state_is_healed_from_its_copy(flown, place):
    flown.until(50).flip(place)
    assert flown.health() == BIT["HEALED"]  # as the next step does
    assert flown.step(51) == BIT["HEALED"]
    assert flown.y.strain == flown.results[51][0]
    flown.flip(2128 + place)  # the copy itself
    assert flown.step(52) == 0
    assert flown.y.strain == flown.results[52][0]


def test_where_both_copies_are_damaged_it_says_so_until_it_begins_again(flown):
    flown.until(50).flip(300)
    flown.flip(2128 + 500)
    assert flown.step(51) == flown.step(52) == BIT["LOST"]
    assert flown.y.strain == 0.0
    assert flown.init(53) == 0


def test_a_saved_state_starts_warm_and_a_damaged_one_or_another_version_is_refused(flown, library, vectors):
    saved = ctypes.create_string_buffer(2128)
    assert library.compensator_save(flown.until(50).state, saved)
    other = Flown(library, vectors["compensator"])
    for number in (0, 2**31):  # a counter that begins anew, and one that has gone on
        assert library.compensator_restore(other.state, saved, ctypes.c_uint32(number)) == 0
        assert other.step(51, number=number + 1) == 0
        assert other.y.strain == flown.results[51][0]
    for place in (16, 2080):  # a parameter; the version
        damaged = ctypes.create_string_buffer(saved.raw, 2128)
        damaged[place] = bytes([damaged[place][0] ^ 1])
        assert library.compensator_restore(other.state, damaged, 51) == BIT["LOST"]
        assert other.step(52) == BIT["LOST"]


def test_a_refused_start_leaves_no_state(flown):
    assert flown.init(resistance=math.nan) == BIT["REFUSED"] | BIT["LOST"]
    assert flown.step(1) == BIT["LOST"]


def test_the_crc_of_a_sample_is_that_of_zlib(flown):
    flown._sample(7)
    assert flown.u.crc == zlib.crc32(bytes(flown.u)[:36])
    assert flown.library.compensator_constants_hold()


@needs_compiler
def test_bits_that_flip_are_seen_and_make_no_valid_answer_wrong(written):
    """In the state, in the constants, in samples: of each 100; ``make upsets FLIPS=10000`` takes minutes."""
    lines = run(*MAKE, "upsets", "FLIPS=100", folder=written("compensator")).splitlines()
    assert len(lines) == 3
    assert all(line.endswith(" 0 of these not seen, 0 valid and wrong") for line in lines)


@needs_compiler
def test_any_input_and_any_state_end_in_a_defined_way(written):
    folder = written("compensator")
    (folder / "try.c").write_text("int main(void) { return 0; }\n")
    sanitize = ["-fsanitize=undefined,address,float-cast-overflow", "-fno-sanitize-recover=all"]
    if subprocess.run(
        [COMPILERS[0], *sanitize, "try.c", "-o", "try"], cwd=folder, capture_output=True, check=False
    ).returncode:
        pytest.skip("the compiler here has no sanitizers")
    assert "1000 calls" in run(*MAKE[:-1], "OPT=-O0", "fuzz", "CALLS=1000", folder=folder)


@needs_compiler
def test_cmake_builds_and_runs_it(written, tmp_path):
    if not shutil.which("cmake"):
        pytest.skip("no cmake here")
    run("cmake", "-S", written("compensator"), "-B", tmp_path, folder=tmp_path)
    run("cmake", "--build", tmp_path, folder=tmp_path)
    run("ctest", folder=tmp_path)
    assert "results are valid" in run(tmp_path / "example", folder=tmp_path)


def test_the_deviations_from_misra_are_those_of_the_page(written, tmp_path):
    """With a number in place of each long list: the rules are of code."""
    if not shutil.which("cppcheck"):
        pytest.skip("no cppcheck here")
    for path in written("compensator").glob("compensator*.[ch]"):
        (tmp_path / path.name).write_text(re.sub(r"= *\n? *\{[^{};/]{400,}\};", "= {0};", path.read_text()))
    page = (Path(__file__).parents[2] / "docs/flight.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+\.\d+) \| (our|CasADi's)", page, re.MULTILINE)
    command = ("--std=c11", "--max-configs=1", "--enable=style", "--addon=misra", "compensator.c")
    done = subprocess.run(["cppcheck", *command], cwd=tmp_path, capture_output=True, text=True, check=False)
    found = set(re.findall(r"^compensator(_math|_table)?\.[ch]:.*\[misra-c2012-([\d.]+)\]$", done.stderr, re.MULTILINE))
    assert {rule for part, rule in found if part != "_math"} == {rule for rule, whose in rows if whose == "our"}
    assert {rule for part, rule in found if part == "_math"} <= {rule for rule, _ in rows}


@pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler here")
def test_a_program_in_cpp_can_include_the_interface(written):
    folder = written("compensator")
    (folder / "include.cpp").write_text(
        '#include "compensator.h"\nint main() { return static_cast<int>(compensator_health(nullptr)); }\n'
    )
    run("g++", "-std=c++20", "-Wall", "-Wextra", "-fsyntax-only", "include.cpp", folder=folder)


@needs_compiler
def test_a_compiler_that_may_forget_numbers_that_are_none_is_refused(written):
    command = [COMPILERS[0], "-std=c11", "-ffast-math", "-fsyntax-only", "compensator.c"]
    refused = subprocess.run(command, cwd=written("compensator"), capture_output=True, text=True, check=False)
    assert refused.returncode
    assert "leave out -ffast-math" in refused.stderr

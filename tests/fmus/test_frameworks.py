"""Components in F Prime and cFS: F Prime's tools accept the model, and the code runs against stubs of both interfaces."""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from gossamer_fmus.catalogue import make_model
from gossamer_fmus.flight import flight_files, golden_vectors
from gossamer_fmus.frameworks import framework_files

SPACE = "' '"
STUBS = Path(__file__).parent / "frameworks"
PLACES = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
CHECK, TO_CPP = (shutil.which(name, path=PLACES) for name in ("fpp-check", "fpp-to-cpp"))
needs_tools = pytest.mark.skipif(not (CHECK and TO_CPP), reason="no fprime-fpp-check or fprime-fpp-to-cpp here")
needs_compiler = pytest.mark.skipif(not (shutil.which("gcc") and shutil.which("g++")), reason="no gcc here")


def run(*command, folder):
    done = subprocess.run(
        [str(part) for part in command], cwd=folder, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folder of a component in a framework."""
    folders = {}

    def get(kind, framework):
        if (kind, framework) not in folders:
            folders[kind, framework] = folder = tmp_path_factory.mktemp(f"{kind}_{framework}")
            model = make_model(kind)
            golden = golden_vectors(model, None if kind == "detector" else make_model("sensor"))
            files = flight_files(model, kind, *golden) | framework_files(model, kind, framework)
            for name, content in files.items():
                (folder / name).write_bytes(content)
            for path in STUBS.iterdir():
                named = path.read_text().replace("NAME", kind).replace("UPPER", kind.upper())
                (folder / path.name).write_text(named.replace("Capital", kind.capitalize()))
        return folders[kind, framework]

    return get


@needs_tools
@pytest.mark.parametrize("kind", ["compensator", "estimator", "filter", "detector"])
def test_fpp_accepts_the_model_and_it_holds_the_table_of_variables(written, kind):
    folder = written(kind, "fprime")
    run(CHECK, "Fw.fpp", f"{kind.capitalize()}.fpp", folder=folder)
    text = (folder / f"{kind.capitalize()}.fpp").read_text()
    for v in make_model(kind).variables:
        name = v.name.partition("[")[0]
        if v.causality == "parameter":
            assert f"param {name.upper()}: " in text
        elif v.causality == "input":
            assert f"    ${name}: " in text
        else:
            assert f"telemetry ${name}: " in text


def test_a_channel_has_unit_and_limits(written):
    text = (written("compensator", "fprime") / "Compensator.fpp").read_text()
    assert 'telemetry $offset_deviation: F64 id 0x06 format "{e} ohm" low { red 0.0 }' in text
    assert "param FULL_SCALE_STRAIN: F64 default 0.5 id 0x03" in text


@pytest.mark.parametrize(
    ("framework", "file", "line"),
    [
        ("fprime", "Other.fpp", "param PERIOD: F64 default 0.002 id"),
        ("cfs", "other_tbl.c", "(other_real)0.002, /* period [s] */"),
    ],
)
def test_it_starts_with_the_period_of_the_component(framework, file, line):
    assert line in framework_files(make_model("compensator"), "other", framework, period=2e-3)[file].decode()


def test_no_description_ends_a_comment():
    model = replace(make_model("compensator"), description="a */ b ??/ c")
    assert "/* a * / b ?? / c" in framework_files(model, "other", "cfs")["other_app.h"].decode()


def declared_base(folder, kind):
    """A base class with the declarations that F Prime's own tool wrote, which prints what is called."""
    name = kind.capitalize()
    run(TO_CPP, "-i", "Fw.fpp", f"{name}.fpp", folder=folder)
    text = re.sub(r"//!?.*", "", (folder / f"{name}ComponentAc.hpp").read_text())
    found = re.findall(
        r"^ +((?:virtual )?[\w:]+) (tlmWrite_\w+|log_\w+|paramGet_\w+|resultOut_out|isConnected_resultOut_OutputPort|"
        r"cmdResponse_out|sampleIn_handler|BEGIN_cmdHandler)\(([^;{]*?)\)( const)?( = 0)?;",
        text,
        re.MULTILINE | re.DOTALL,
    )
    lines = []
    for kind_of_result, function, arguments, constant, abstract in found:
        head = f"{kind_of_result} {function}({' '.join(arguments.split())}){constant}"
        if abstract:
            lines.append(f"{head} = 0;")
            continue
        names = [argument.split("=")[0].split()[-1].strip("&") for argument in arguments.split(",")]
        if function.startswith("paramGet_"):
            value = "3e-4" if function == "paramGet_PERIOD" else f"{kind}_start_parameters.{function[9:].lower()}"
            lines.append(f"{head} {{ valid = Fw::ParamValid::DEFAULT; return {value}; }}")
        elif function.startswith("isConnected"):
            lines.append(f"{head} {{ return true; }}")
        else:
            shown = [each for each in names if each not in ("_tlmTime", "portNum", "response")]
            lines.append(
                f'{head} {{ std::cout << "{function}"{"".join(f" << {SPACE} << {each}" for each in shown)} << "\\n"; }}'
            )
    return "\n".join(
        [
            f'#include "{kind}.h"',
            "#include <cstdint>\n#include <iostream>\n#include <iomanip>",
            "typedef double F64; typedef float F32; typedef std::uint32_t U32;",
            "typedef int FwIndexType; typedef U32 FwOpcodeType;",
            "namespace Fw { struct Time {}; enum class CmdResponse { OK }; enum class ParamValid { INVALID, DEFAULT }; }",
            f"namespace Gossamer {{ class {name}ComponentBase {{ public:",
            f"explicit {name}ComponentBase(const char*) {{}}",
            f"virtual ~{name}ComponentBase() {{}}",
            *lines,
            "}; }",
        ]
    )


@needs_tools
@needs_compiler
@pytest.mark.parametrize("kind", ["compensator", "estimator"])
def test_the_component_of_f_prime_gives_the_golden_results(written, kind):
    folder = written(kind, "fprime")
    name = kind.capitalize()
    place = folder / f"Gossamer/{name}"
    place.mkdir(parents=True, exist_ok=True)
    (place / f"{name}ComponentAc.hpp").write_text(declared_base(folder, kind))
    shutil.copy(folder / f"{name}.hpp", place)
    inputs = ", ".join(f"GOLDEN_INPUTS[k][{i}]" for i in range(make_model(kind).count("input")))
    (folder / "drive.cpp").write_text(
        f'#include "Gossamer/{name}/{name}.hpp"\n#include "golden.h"\n'
        f'int main() {{ static Gossamer::{name} c("c"); Gossamer::{name}ComponentBase& b = c;\n'
        "  std::cout << std::setprecision(17);\n"
        f"  for (int k = 0; k <= GOLDEN_STEPS; k++) b.sampleIn_handler(0, {inputs}, (U32)k);\n"
        f"  b.sampleIn_handler(0, {inputs.replace('[k]', '[3]')}, 3); b.BEGIN_cmdHandler(5, 6);\n"
        f"  b.sampleIn_handler(0, {inputs.replace('[k]', '[0]')}, 1000); }}\n"
    )
    run("gcc", "-std=c11", "-O1", "-ffp-contract=off", "-c", f"{kind}.c", "-o", "c.o", folder=folder)
    quiet = ("-Wno-unused-parameter", "-Wno-missing-field-initializers")  # of the stub; of what C sets to zero
    run(
        "g++", "-std=c++14", "-Wall", "-Wextra", *quiet, "-Werror", "-I.", "-c", f"{name}.cpp", "-o", "glue.o", folder=folder
    )
    run("g++", "-std=c++17", "-I.", "drive.cpp", "glue.o", "c.o", "-lm", "-o", "drive", folder=folder)
    lines = run("./drive", folder=folder).splitlines()
    golden = (folder / "golden.h").read_text()
    rows = golden[golden.index("GOLDEN_RESULTS") :].splitlines()[1:-1]
    wanted = [[float.fromhex(each) for each in row.strip("{},").split(", ")] for row in rows]
    results = [line.split()[1:] for line in lines if line.startswith("resultOut_out")]
    assert [[float(each) for each in row[:-2]] for row in results[: len(wanted)]] == wanted
    assert [int(row[-2]) for row in results[: len(wanted)]] == list(range(len(wanted)))
    assert [int(row[-1]) for row in results] == [0] * len(wanted) + [2, 0]  # the last but one is repeated
    events = [line for line in lines if line.startswith(("log_", "cmdResponse"))]
    assert events == [
        "log_ACTIVITY_HI_Began 0",
        "log_WARNING_HI_HealthChanged 2 3",
        "cmdResponse_out 5 6",
        "log_ACTIVITY_HI_Began 1000",
        "log_WARNING_HI_HealthChanged 0 1000",
    ]
    assert sum(line.startswith("tlmWrite_strain ") for line in lines) == len(results)


@needs_compiler
@pytest.mark.parametrize("kind", ["compensator", "estimator"])
def test_the_application_of_cfs_gives_the_golden_results_and_its_housekeeping(written, kind):
    folder = written(kind, "cfs")
    flags = ("-std=c11", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror")
    sources = (f"{kind}_app.c", f"{kind}_tbl.c", f"{kind}.c", "cfe_run.c")
    run("gcc", *flags, "-I.", *sources, "-lm", "-o", "application", folder=folder)
    lines = run("./application", folder=folder).splitlines()
    assert lines[:3] == [f"subscribed 0x18a{k}" for k in range(3)]
    assert f"event 6 3 {kind.upper()}: a number of the table is out of its range" in lines
    assert "validated 1 0" in lines
    results = [line.split()[1:] for line in lines if line.startswith("result")]
    assert [(int(number), health, different) for number, health, different in results[:-1]] == [
        (k, "0x0", "0") for k in range(len(results) - 1)
    ]
    assert results[-1][1] == "0x1"  # a damaged sample is refused
    steps = len(results) - 2
    assert f"housekeeping 2 1 0 0x1 {steps} {steps} 1" in lines
    assert lines[-1] == "exit 1"
    assert sum(line.startswith("event") for line in lines) == 7

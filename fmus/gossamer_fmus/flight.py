"""Write a component for a flight processor: C without an operating system, from the model that its native FMU is built from.

A folder holds, with names that begin with that of the component::

    compensator.h           the interface: units and ranges, a structure, ``init``, ``step``, ``health``
    compensator.c           what surrounds the mathematics; the same for every model
    compensator_math.h      init and step, written by CasADi as for the native FMU, without derivatives
    compensator_table.h     ranges, sizes, and checksums of the constants
    main.c, golden.c        an example at a fixed rate; vectors with what the model gives for them, and what runs them
    board.c, board.h, .ld   the start of a Cortex-M7 board that QEMU has
    upsets.c, fuzz.c        bits that flip; anything for an input
    INTERFACE.md            the interface, to be read
    Makefile, CMakeLists.txt
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Iterator, Sequence
from functools import reduce
from pathlib import Path

import numpy as np
from gossamer_models import ParameterError, StepModel, Stepper, Variable
from gossamer_models.arrays import Vector

from .description import Array, arrays_in_parts
from .flight_mathematics import FloatBits, mathematics
from .flight_slices import Slices, slices_of

GOLDEN_STEPS = 240  # samples of the golden vectors
BEYOND = 2  # windows of a detector after those that it was trained for, in which the last one is judged
PERIOD = 3e-4  # [s]
FOLLOWED = 60  # samples after a bit that flips; all of a detector, which answers once a window
TOLERANCES = {64: 1e-12, 32: 1e-2}  # of golden vectors, over the largest value of each result
_JUDGEMENTS = {"saturated": 0.0, "valid": 1.0}  # results that say whether a model explains its inputs, and when it does


def flight_files(
    model: StepModel, name: str, vectors: tuple[Vector, Vector], golden: Vector, bits: FloatBits = 64, period: float = PERIOD
) -> dict[str, bytes]:
    """Return the files of a component by name.

    Parameters
    ----------
    model : StepModel
        What it runs; one without loops over a mesh.
    name : str
        Of the component, an identifier of C; names in its interface begin with it.
    vectors : tuple of array, shapes (n_parameters,) and (steps + 1, n_inputs)
        Golden parameters and inputs.
    golden : array, shape (steps + 1, n_results)
        Results of the model for them.
    bits : {32, 64}
        Of its numbers.
    period : float
        Of the golden vectors [s].

    Raises
    ------
    ParameterError
        The model sums over a mesh, or its internal step is a result.
    """
    first_result = model.slices()[2].start
    limit = None if model.step_limit is None else model.names.index(model.step_limit)
    if model.tables is not None or model.restarted or (limit is not None and limit >= first_result):
        msg = f"model {model.name!r} has no fixed number of operations in a step. Choose a compensator or a detector."
        raise ParameterError(msg)
    slices = slices_of(model)
    code, lists, sizes = mathematics(model, bits, slices)
    late = 0 if slices is None else _steps_of(model, slices, period)
    if late:
        golden = np.vstack([*[golden[:1]] * late, golden[:-late]])
    here = Path(__file__).parent / "native/flight"
    files = {path.name: path.read_text(encoding="utf-8") for path in sorted(here.iterdir())}
    files["main.c"] = files["main.c"].replace("3e-4", repr(period))
    files["component.h"] = _header(model, sizes, bits, slices, late)
    files["component_math.h"] = code
    files["component_table.h"] = _table(model, lists, bits, limit)
    files["golden.h"] = _golden(model, vectors, golden, bits, period)
    files["INTERFACE.md"] = _interface(model, bits, f"{late} steps of {period:g} s" if late else "")
    names = (("component", name), ("COMPONENT", name.upper()))

    def named(text: str) -> str:
        return reduce(lambda text, pair: text.replace(*pair), names, text)

    return {named(file): named(text).encode() for file, text in files.items()}


def golden_vectors(model: StepModel, sensor: StepModel | None) -> tuple[tuple[Vector, Vector], Vector]:
    """Return parameters and inputs of a run that loads, ripples, holds and unloads, and the results of the model.

    Parameters
    ----------
    model : StepModel
        The model.
    sensor : StepModel or None
        The sensor whose resistance it reads; None if it reads strain.
    """
    k = np.arange((GOLDEN_STEPS if sensor is not None else _windows_of(model)) + 1)
    ramp = np.interp(k, [0, 80, 110, 190, GOLDEN_STEPS], [0.04, 0.60, 0.60, 0.24, 0.24])
    strain = ramp + 0.02 * np.sin(2.0 * np.pi * 20.0 * PERIOD * k)  # over full scale
    stepper = Stepper(model)
    if sensor is not None:
        full = next(v.start for v in sensor.variables if v.name == "full_scale_strain")
        drive = Stepper(sensor)
        columns = {"resistance": np.array(list(_driven(drive, "resistance", {"strain": strain * (full or 1.0)})))}
    else:
        names = [v.name for v in model.variables if v.causality == "input"]
        columns = {each: 0.1 * (strain + 0.1 * np.sin(0.7 * k + i) + 0.1) for i, each in enumerate(names)}
        stepper.set("repeat", 1.0)
    inputs = model.slices()[1]
    table = np.array([[v.start or 0.0 for v in model.variables[inputs]]] * k.size)
    for name, column in columns.items():
        table[:, model.names.index(name) - inputs.start] = column
    return vectors_of(stepper, table)


def vectors_of(stepper: Stepper, table: Vector, period: float = PERIOD) -> tuple[tuple[Vector, Vector], Vector]:
    """Return the parameters of a stepper and inputs, shape (steps + 1, n_inputs), and the results of its model."""
    model, stepper.warn = stepper.model, lambda _: None  # golden inputs need not be what a model is for
    parameters, inputs, results = model.slices()
    given = {v.name: table[:, i] for i, v in enumerate(model.variables[inputs])}
    rows = np.array(list(_driven(stepper, model.names[results], given, period)))
    return (np.array([stepper.get(name) for name in model.names[parameters]]), table), rows


def _driven(
    stepper: Stepper, read: str | Sequence[str], given: dict[str, Vector], period: float = PERIOD
) -> Iterator[float | list[float]]:
    """Run a model over columns of inputs; yield one result or several at each sample."""
    for k in range(len(next(iter(given.values())))):
        for name, column in given.items():
            stepper.set(name, float(column[k]))
        if k:
            stepper.step(period)
        else:
            stepper.initialize()
        yield stepper.get(read) if isinstance(read, str) else [stepper.get(name) for name in read]


def _range(v: Variable) -> str:
    """Return the range of a variable as words."""
    low, high = v.minimum, v.maximum
    if low is None and high is None:
        return "any finite number"
    return f"{'any' if low is None else f'{low:g}'} to {'any finite number' if high is None else f'{high:g}'}"


def c_comment(text: str) -> str:
    """Return text that ends no comment of C and holds no trigraph of a backslash."""
    return text.replace("*/", "* /").replace("??/", "?? /")


def _windows_of(model: StepModel) -> int:
    """Return the golden samples of a detector, in which it judges each of its windows."""
    slices, starts = slices_of(model), {v.name: v.start or 0.0 for v in model.variables}
    windows = BEYOND + (0 if slices is None else len(slices.windows))
    return math.ceil((starts["start_time"] + windows * starts["window_length"]) / PERIOD)


def _steps_of(model: StepModel, slices: Slices, period: float) -> int:
    """Return the steps of a period from the end of a window to its results; ``component.c`` divides likewise."""
    length = next(v.start or 0.0 for v in model.variables if v.name == "window_length")
    left = length - 2.0 * period
    each = 1 + math.floor(slices.count * period / left) if left > 0.0 else slices.count
    return math.ceil(slices.count / each)


def _header(model: StepModel, sizes: dict[str, int], bits: FloatBits, slices: Slices | None, late: int) -> str:
    """Write the interface."""
    real = "float" if bits == 32 else "double"
    parameters, inputs, results = (model.variables[part] for part in model.slices())
    version, parts = int(model.digest[:8], 16) ^ bits, arrays_in_parts(model)
    lines = [
        f"/* {model.name}: {c_comment(model.description)}. Written by gossamer flight; see INTERFACE.md. */",
        "#ifndef COMPONENT_H",
        "#define COMPONENT_H",
        "",
        "#include <stdbool.h>",
        "#include <stdint.h>",
        "",
        f"#define COMPONENT_FLOAT {bits}",
        f"#define COMPONENT_VERSION 0x{version:08x}U /* of the model: a saved block of another is refused */",
        f"#define COMPONENT_N_PARAMETERS {len(parameters)}",
        f"#define COMPONENT_N_INPUTS {len(inputs)}",
        f"#define COMPONENT_N_RESULTS {len(results)}",
        f"#define COMPONENT_N_STATES {model.n_states}",
        "#define COMPONENT_LONGEST_GAP 8U /* periods; after a longer one the memory is not that of the sensor */",
        "",
        *_BITS,
        "",
        f"typedef {real} component_real;",
        "",
    ]
    for what, arrays in zip(("parameters", "inputs", "outputs"), parts, strict=True):
        lines.append("typedef struct {")
        for array in arrays:
            v, size = array.members[0], f"[{array.size}]" if array.shape else ""
            start = "" if v.start is None else f"; starts at {v.start:g}"
            lines.append(
                f"  component_real {array.name}{size}; /* [{v.unit}] {c_comment(v.description)}; {_range(v)}{start} */"
            )
        if what == "inputs":
            lines += ["  uint32_t sequence; /* number of the sample, one more each period */"]
        if what == "outputs":
            lines += ["  uint32_t sequence; /* of the last sample that was used */", "  uint32_t health; /* of this step */"]
        if what != "parameters":
            lines += ["  uint32_t crc;"]
        lines += [f"}} component_{what};", ""]
    if slices is not None:
        lines += [
            f"#define COMPONENT_N_SLICES {len(slices.all)}U",
            f"#define COMPONENT_N_LIVE {slices.size}",
            f"#define COMPONENT_N_FOLDS {slices.folds}U",
            f"#define COMPONENT_N_PARTS {slices.count} /* of the slices of a window */",
            f"#define COMPONENT_WINDOW_LENGTH {model.names.index('window_length')} /* among the parameters */",
            f"#define COMPONENT_ANSWERS_AFTER {late} /* steps after a window, of the period of the golden vectors */",
            "",
            "typedef struct { /* how far the window that ended last is judged */",
            "  uint32_t slice; /* the next one; 0: none, COMPONENT_N_SLICES: all are done */",
            "  uint32_t part;",
            "  uint32_t unjudged; /* 1: the window that ended last was lost */",
            "  uint32_t folded; /* words of the constant of a product so far */",
            "  uint32_t folds[COMPONENT_N_FOLDS]; /* of values in between */",
            "} component_judging;",
            "",
        ]
    lines += [
        "/* counts since init; they stop at their largest value */",
        *(f"#define COMPONENT_COUNT_{each} {k}" for k, each in enumerate(_COUNTS)),
        f"#define COMPONENT_N_COUNTS {len(_COUNTS)}U",
        "",
        "typedef struct { /* all that is remembered; it may be saved and restored as it is, on the same processor */",
        "  component_real parameters[COMPONENT_N_PARAMETERS];",
        "  component_real results[COMPONENT_N_RESULTS];",
        "  component_real state[COMPONENT_N_STATES];",
        "  component_real period; /* [s] */",
        *(f"  uint32_t {each};" for each in ("version", "sequence", "health", "next_list")),
        *(["  component_judging judging;"] if slices else []),
        "  uint32_t counts[COMPONENT_N_COUNTS];",
        "  uint32_t crc;",
        "} component_block;",
        "",
        "typedef struct {",
        "  component_block first;",
        "  component_block second;",
        *(["  component_real live[COMPONENT_N_LIVE]; /* what slices give each other */"] if slices else []),
        "} component;",
        "",
        "typedef struct { /* what a step writes before it reads it: components that run in turn may share one */",
        f"  const component_real *arg[{sizes['ARG']}];",
        f"  component_real *res[{sizes['RES']}];",
        f"  int iw[{sizes['IW']}];",
        *["  component_real x[COMPONENT_N_STATES];"] * (model.step_limit is not None),
        f"  component_real w[{sizes['W']}];",
        "} component_work;",
        "",
        *_starts("parameters", parts[0], bits),
        *_starts("inputs", parts[1], bits),
        "#ifdef __cplusplus",
        'extern "C" {',
        "#endif",
        *_PROTOTYPES,
        *(_OF_SLICES if slices else ()),
        "#ifdef __cplusplus",
        "}",
        "#endif",
        *_copies("parameters", parameters),
        *_copies("inputs", inputs),
        *_copies("outputs", results),
        "#endif",
        "",
    ]
    return "\n".join(lines)


# What ``health`` says: name, bit, meaning.
HEALTH = (
    ("REFUSED", "this sample was not used: its CRC is wrong, or a number is not finite or out of its range"),
    ("REPEATED", "this sample was not used: its number is that of the last one, or of one before"),
    ("MISSED", "samples are missing before this one; the step spans their time"),
    ("HEALED", "the state was damaged and was taken from its second copy"),
    ("OUT_OF_RANGE", "a result has left the range in which the model is valid"),
    ("FAILED", "the step gave no finite numbers; state and results are those before it"),
    ("UNEXPLAINED", "the model says that it does not explain its inputs (saturated, or not valid)"),
    ("LOST", "neither copy of the state is whole, or there is none: init or restore"),
    ("CONSTANTS", "constants of the program are damaged: load it again, then init or restore"),
    ("GAP", "more than COMPONENT_LONGEST_GAP samples were missing; stays until init or restore"),
    (
        "UNJUDGED",
        "the last window of a detector is lost: its numbers were damaged or not finite, a step failed, or the state was "
        "restored; stays until one is judged, or init",
    ),
)
_USABLE = ("MISSED", "HEALED")
_COUNTS = ("STEPS", "REFUSED", "MISSED", "HEALED", "FAILED")
_BITS = (
    "/* health, one bit each */",
    *(f"#define COMPONENT_{name} 0x{1 << k:03x}U /* {meaning} */" for k, (name, meaning) in enumerate(HEALTH)),
    "/* with one of these a result must not be used */",
    f"#define COMPONENT_INVALID 0x{sum(1 << k for k, (name, _) in enumerate(HEALTH) if name not in _USABLE):03x}U",
    "#define COMPONENT_STAYS (COMPONENT_GAP | COMPONENT_CONSTANTS)",
)
_PROTOTYPES = """/* Begin: state from parameters and the first sample. Returns health; COMPONENT_LOST: there is no state. */
uint32_t component_init(component *c, const component_parameters *p, component_real period, const component_inputs *u,
                        component_work *w);

/* Advance to a sample and write the results; those of the last step where it cannot be used. Returns health. */
uint32_t component_step(component *c, const component_inputs *u, component_outputs *y, component_work *w);

/* Health of the last step; COMPONENT_HEALED too where one copy of the state has been damaged since, COMPONENT_LOST where
   both have. Changes nothing. */
uint32_t component_health(const component *c);

/* Write the CRC of a sample, where it is measured. */
void component_seal(component_inputs *u);

/* Whether results are as they were written. */
bool component_is_sealed(const component_outputs *y);

/* Copy the state for a warm start; false if both copies of it are damaged. */
bool component_save(const component *c, component_block *saved);

/* Begin from a saved state, whose strain has not changed since, with the number of the present sample. Returns its health;
   COMPONENT_LOST if it is damaged or of another model. */
uint32_t component_restore(component *c, const component_block *saved, uint32_t sequence);

/* Whether all constants are as they were compiled, by their CRC: slow, for a background task. */
bool component_constants_hold(void);

/* Numbers in the order of the table, for telemetry and files. */""".splitlines()


_OF_SLICES = """
/* Judge the window that ended last further by one slice, as each step does, so that its results come earlier. Never while a
   step of the same component runs, or of one with the same work space: call it in the same task. Returns health. */
uint32_t component_slice(component *c, component_work *w);""".splitlines()


def _number(value: float, bits: FloatBits) -> str:
    return f"{value!r}f" if bits == 32 else repr(value)


def _starts(what: str, arrays: Sequence[Array], bits: FloatBits) -> list[str]:
    lines = [f"static const component_{what} component_start_{what} = {{"]
    for array in arrays:
        numbers = ", ".join(_number(float(v.start or 0.0), bits) for v in array.members)
        lines.append(f"  .{array.name} = {f'{{{numbers}}}' if array.shape else numbers},")
    return [*lines, "};", ""]


def _copies(what: str, variables: Sequence[Variable]) -> list[str]:
    names = [re.sub(r"\[(\d+)\]", lambda k: f"[{int(k[1]) - 1}]", v.name) for v in variables]
    return [
        f"static inline void component_from_{what}(const component_{what} *from, component_real *numbers) {{",
        *(f"  numbers[{k}] = from->{name};" for k, name in enumerate(names)),
        "}",
        f"static inline void component_to_{what}(const component_real *numbers, component_{what} *to) {{",
        *(f"  to->{name} = numbers[{k}];" for k, name in enumerate(names)),
        "}",
        "",
    ]


def _table(model: StepModel, lists: str, bits: FloatBits, limit: int | None) -> str:
    """Write what the code around the mathematics needs of a model."""
    largest = "FLT_MAX" if bits == 32 else "DBL_MAX"
    results = model.names[model.slices()[2].start :]
    judge = next((name for name in _JUDGEMENTS if name in results), None)

    def end(value: float | None, without: str) -> str:
        return without if value is None else _number(float(value), bits)

    lines = [
        f"#define COMPONENT_BITS uint{bits}_t",
        f"#define COMPONENT_LARGEST {largest}",
        f"#define COMPONENT_STEP_LIMIT {-1 if limit is None else limit}",
        f"#define COMPONENT_NEARLY_ONE {_number(1.0 - (1e-12 if bits == 64 else 5e-7), bits)}",
        "#define COMPONENT_MOST_PARTS 64U",
        f"#define COMPONENT_JUDGEMENT {-1 if judge is None else results.index(judge)}",
        f"#define COMPONENT_GOOD {_number(_JUDGEMENTS.get(judge or '', 0.0), bits)}",
        "",
        "static const uint32_t CRC_TABLE[4][256] = {",
        *(" {" + " ".join(f"0x{crc:08x}U," for crc in row) + "}," for row in _crc_tables()),
        "};",
        "",
        "/* smallest and largest value of each variable, in the order of the table */",
        f"static const component_real COMPONENT_LIMITS[{len(model.variables)}][2] = {{",
        *(f" {{{end(v.minimum, '-' + largest)}, {end(v.maximum, largest)}}}, /* {v.name} */" for v in model.variables),
        "};",
        "",
        "typedef struct {",
        "  const void *begin;",
        "  uint32_t words; /* of 32 bits */",
        "  uint32_t is_of_numbers;",
        "  uint32_t folded; /* all words, exclusive or */",
        "} component_list;",
        "",
    ]
    return "\n".join(lines) + lists + "\n"


def _crc_tables() -> list[list[int]]:
    """Return the CRC of each byte with 0 to 3 bytes of zero behind it, as sums of four bytes at once need."""
    rows = [[zlib.crc32(bytes([k]), 0xFFFFFFFF) ^ 0xFFFFFFFF for k in range(256)]]
    for _ in range(3):
        rows.append([crc >> 8 ^ rows[0][crc & 0xFF] for crc in rows[-1]])
    return rows


def _golden(model: StepModel, vectors: tuple[Vector, Vector], golden: Vector, bits: FloatBits, period: float) -> str:
    """Write golden vectors; hexadecimal, so that no digit is lost."""

    def row(values: Vector) -> str:
        return "{" + ", ".join(float(value).hex() for value in values) + "},"

    parameters, inputs = vectors
    far = 10.0 * np.abs(inputs).max(axis=0) + 1.0
    ranges = [
        (-end if v.minimum is None else v.minimum, end if v.maximum is None else v.maximum)
        for v, end in zip(model.variables[model.slices()[1]], far.tolist(), strict=True)
    ]
    names = model.names[model.slices()[2].start :]
    lines = [
        "/* Golden vectors: what the model gives in double precision. */",
        f"#define GOLDEN_STEPS {len(inputs) - 1}",
        f"#define GOLDEN_PERIOD {period!r}",
        f"#define GOLDEN_WINDOW {len(inputs) - 1 if 'window_length' in model.names else FOLLOWED}",
        f"#define GOLDEN_TOLERANCE {TOLERANCES[bits]!r}",
        "static const char *const GOLDEN_NAMES[] = {" + ", ".join(f'"{name}"' for name in names) + "};",
        "/* of inputs; where there is no end, ten times what is here */",
        f"static const double GOLDEN_RANGES[][2] = {{{', '.join(f'{{{low!r}, {high!r}}}' for low, high in ranges)}}};",
        "static const double GOLDEN_PARAMETERS[] = " + row(parameters)[:-1] + ";",
        f"static const double GOLDEN_INPUTS[][{inputs.shape[1]}] = {{",
        *map(row, inputs),
        "};",
        f"static const double GOLDEN_RESULTS[][{golden.shape[1]}] = {{",
        *map(row, golden),
        "};",
    ]
    return "\n".join(lines) + "\n"


def _interface(model: StepModel, bits: FloatBits, late: str) -> str:
    """Write the interface to be read; ``late`` says how much later than those of the FMU results come, if they do."""
    lines = [
        "# Interface of component",
        "",
        f"{model.description}. Written from the model's table of variables; numbers have {bits} bits. The model is "
        f"`{model.digest[:16]}`.",
    ]
    if late:
        lines += ["", f"Results come {late} after the end of a window, later than those of the FMU."]
    for title, arrays in zip(("Parameters", "Inputs", "Results"), arrays_in_parts(model), strict=True):
        lines += ["", f"## {title}", "", "| name | unit | range | start | meaning |", "| --- | --- | --- | --- | --- |"]
        for array in arrays:
            v, size = array.members[0], f"[{array.size}]" if array.size > 1 else ""
            start = "" if v.start is None else f"{v.start:g}"
            lines.append(f"| `{array.name}{size}` | {v.unit} | {_range(v)} | {start} | {v.description} |")
    lines += ["", "## Health", "", "| bit | name | meaning | usable |", "| --- | --- | --- | --- |"]
    lines += [
        f"| 0x{1 << k:03x} | `COMPONENT_{name}` | {meaning} | {'yes' if name in _USABLE else 'no'} |"
        for k, (name, meaning) in enumerate(HEALTH)
    ]
    return "\n".join(lines) + "\n"

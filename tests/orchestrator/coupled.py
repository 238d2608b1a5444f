"""FMUs in C that are coupled to others: a gain, ``y = A u + b``, and a mass that a force or a spring moves.

The outputs of both are those of the present inputs, in the initialization too. The mass takes the mean of its accelerations
at both ends of a step (the trapezoidal rule), so its displacement at the step's end depends on the input then.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import fmpy
from gossamer_models.compiler import compile_shared
from hostile import SAVED, UNUSED

SOURCE = r"""
#include <stdlib.h>
#include <string.h>
#define EXPORT __attribute__((visibility("default")))
typedef struct { double v[40]; } State;
#define V ((State *)c)->v
static void outputs(double v[]);
static void begin(double v[]);
static int step(double v[], double h);

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const names[]) { return 0; }
EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                             int visible, int logging) {
    return calloc(1, sizeof(State));
}
EXPORT void fmi2FreeInstance(void *c) { free(c); }
EXPORT int fmi2SetupExperiment(void *c, int a, double b, double d, int e, double f) { return 0; }
EXPORT int fmi2EnterInitializationMode(void *c) { return 0; }
EXPORT int fmi2ExitInitializationMode(void *c) { begin(V); return 0; }
EXPORT int fmi2Terminate(void *c) { return 0; }
EXPORT int fmi2Reset(void *c) { memset(c, 0, sizeof(State)); return 0; }
EXPORT int fmi2SetReal(void *c, const unsigned r[], size_t n, const double v[]) {
    for (size_t i = 0; i < n; i++) V[r[i]] = v[i];
    return 0;
}
EXPORT int fmi2GetReal(void *c, const unsigned r[], size_t n, double v[]) {
    outputs(V);
    for (size_t i = 0; i < n; i++) v[i] = V[r[i]];
    return 0;
}
EXPORT int fmi2DoStep(void *c, double t, double h, int keep) { return step(V, h); }
"""
GAIN = r"""
enum { U = 0, B = 3, A = 6, LIMIT = 15, Y = 16 };
static void outputs(double v[]) {
    for (int i = 0; i < 3; i++) {
        v[Y + i] = v[B + i];
        for (int j = 0; j < 3; j++) v[Y + i] += v[A + 3 * i + j] * v[U + j];
    }
}
static void begin(double v[]) { }
static int step(double v[], double h) { return v[LIMIT] > 0 && (v[U] > v[LIMIT] || h > 0.05) ? 2 : 0; }
"""
MASS = r"""
enum { U, M, K, X0, LONGEST, X, SPEED, FORCE, OLD, BEGUN };  /* with K > 0, U is the place of the spring's other end */
static double force(const double v[]) { return v[K] > 0 ? v[K] * (v[U] - v[X]) : v[U]; }
static void outputs(double v[]) {
    if (!v[BEGUN]) v[X] = v[X0];
    v[FORCE] = force(v);
}
static void begin(double v[]) {
    outputs(v);
    v[OLD] = v[FORCE];
    v[BEGUN] = 1;
}
static int step(double v[], double h) {
    if (v[LONGEST] > 0 && h > v[LONGEST]) return 2;
    double q = h * h / (4 * v[M]), f;
    double x = v[X] + h * v[SPEED] + q * v[OLD];                      /* without the force at the end */
    f = v[K] > 0 ? v[K] * (v[U] - x) / (1 + q * v[K]) : v[U];
    v[X] = x + q * f;
    v[SPEED] += h / (2 * v[M]) * (v[OLD] + f);
    v[OLD] = f;
    return 0;
}
"""
KINDS = {  # source and variables: references, causality, start
    "gain": (GAIN, [("u", 0, 3, "input", 0), ("b", 3, 3, "input", 0), ("A", 6, 9, "parameter", 0),
                    ("limit", 15, 1, "parameter", 0), ("y", 16, 3, "output", None)]),
    "mass": (MASS, [("u", 0, 1, "input", 0), ("m", 1, 1, "parameter", 1), ("k", 2, 1, "parameter", 0),
                    ("x0", 3, 1, "parameter", 0), ("longest", 4, 1, "parameter", 0), ("x", 5, 1, "output", None),
                    ("speed", 6, 1, "output", None), ("force", 7, 1, "output", None)]),
}  # fmt: skip


def description(name: str) -> str:
    """Return the model description; nothing is declared of dependencies, so every output depends on every input."""
    lines, outputs = [], ""
    for base, first, count, causality, start in KINDS[name][1]:
        for i in range(count):
            given = "" if start is None else f' start="{start}"'
            variability = "fixed" if causality == "parameter" else "continuous"
            label = base if count == 1 else f"{base}[{i + 1}]"
            lines.append(
                f'<ScalarVariable name="{label}" valueReference="{first + i}" causality="{causality}" '
                f'variability="{variability}"><Real{given}/></ScalarVariable>'
            )
            outputs += f'<Unknown index="{len(lines)}"/>' if causality == "output" else ""
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{{coupled {name}}}">'
        f'<CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true" '
        'canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>'
        f"<ModelVariables>{''.join(lines)}</ModelVariables><ModelStructure><Outputs>{outputs}</Outputs>"
        f"<InitialUnknowns>{outputs}</InitialUnknowns></ModelStructure></fmiModelDescription>"
    )


def build(name: str, folder: Path) -> Path:
    """Compile one of them for this machine."""
    source = SOURCE + SAVED + KINDS[name][0] + "".join(f"EXPORT int {unused}(void) {{ return 3; }}\n" for unused in UNUSED)
    library = f"{name}{fmpy.sharedLibraryExtension}"
    binary = compile_shared({"it.c": source.encode()}, "it.c", library, ["-Wno-everything"], f"the test FMU {name}")
    path = folder / f"{name}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description(name))
        archive.writestr(f"binaries/{fmpy.platform}/{library}", binary)
    return path

"""An FMU in C that misbehaves as it is told, and can be saved: its outputs integrate its input.

``y[i]`` is ``i`` times the state, whose derivative is ``1 + u``. In step number ``at``, counted from 0, it does ``fault``.
"""

from __future__ import annotations

import sys
import uuid
import zipfile
from pathlib import Path

import fmpy
from gossamer_models.compiler import compile_shared

EXIT, SEGFAULT, ABORT, OVERFLOW, HANG, NAN, INFINITE, FORK, HANG_WHEN_FREED, CRASH_WHEN_FREED, WAIT = range(1, 12)
DAEMON, COPY, WRITE, REFUSE = 12, 13, 14, 15  # the last refuses inputs that are not finite
SLEEPER = "sleeper"  # an instance of this name never returns from its instantiation

SOURCE = r"""
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#ifndef _WIN32
#include <unistd.h>
#endif
#define EXPORT __attribute__((visibility("default")))
enum { U, FAULT, AT, PAUSE, INPUTS, FIRST = 10 };
#define WRITTEN "1\n{\"log\": 2}\n\xff[["
typedef struct { double x, inputs[INPUTS]; long steps; } State;

static void hang(void) { for (;;) { struct timespec second = {1, 0}; nanosleep(&second, NULL); } }
#ifndef _WIN32
static void wait(const char *gate) {  // until there is a file of that name
    struct timespec moment = {0, 5000000};
    while (access(gate, F_OK)) nanosleep(&moment, NULL);
}
#endif
static int overflow(int depth) { volatile char room[4096]; room[0] = (char)depth; return overflow(depth + 1) + room[0]; }

static void misbehave(State *s) {
    switch ((int)s->inputs[FAULT]) {
    case 1: exit(0);
    case 2: *(volatile int *)8 = 1; break;
    case 3: abort();
    case 4: overflow(0); break;
    case 5: hang(); break;
    case 6: s->x = NAN; break;
    case 7: s->x = INFINITY; break;
#ifndef _WIN32
    case 8: if (fork() == 0) hang(); break;
    case 11: wait(getenv("HOSTILE_GATE")); break;
    case 12: if (fork() == 0) { setsid(); hang(); } break;
    case 14: for (int fd = 3; fd < 256; fd++) if (write(fd, WRITTEN, sizeof WRITTEN - 1) < 0) continue; break;
    case 13: if (fork()) s->inputs[PAUSE] = 0.01; else s->x += 1000; break;  // both return, the copy is faster
#endif
    }
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const names[]) { return 0; }
EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                             int visible, int logging) {
    if (strcmp(name, "sleeper") == 0) hang();
    return calloc(1, sizeof(State));
}
EXPORT void fmi2FreeInstance(void *c) {
    State *s = c;
    if (s->inputs[FAULT] == 9) hang();
    if (s->inputs[FAULT] == 10) abort();
    free(c);
}
EXPORT int fmi2SetupExperiment(void *c, int a, double b, double d, int e, double f) { return 0; }
EXPORT int fmi2EnterInitializationMode(void *c) { return 0; }
EXPORT int fmi2ExitInitializationMode(void *c) { return 0; }
EXPORT int fmi2Terminate(void *c) { return 0; }
EXPORT int fmi2Reset(void *c) { memset(c, 0, sizeof(State)); return 0; }
EXPORT int fmi2SetReal(void *c, const unsigned r[], size_t n, const double v[]) {
    for (size_t i = 0; i < n; i++) ((State *)c)->inputs[r[i]] = v[i];
    return 0;
}
EXPORT int fmi2GetReal(void *c, const unsigned r[], size_t n, double v[]) {
    State *s = c;
    for (size_t i = 0; i < n; i++) v[i] = r[i] < FIRST ? s->inputs[r[i]] : (r[i] - FIRST + 1) * s->x;
    return 0;
}
EXPORT int fmi2DoStep(void *c, double t, double h, int keep) {
    State *s = c;
    if (s->inputs[PAUSE] > 0) {
        struct timespec pause = {0, (long)(1e9 * s->inputs[PAUSE])};
        nanosleep(&pause, NULL);
    }
    if (s->inputs[FAULT] == 15 && !isfinite(s->inputs[U])) return 3;
    s->x += h * (1 + s->inputs[U]);
    if (s->steps++ == (long)s->inputs[AT]) misbehave(s);
    return 0;
}
"""
SAVED = r"""
EXPORT int fmi2GetFMUstate(void *c, void **f) {
    if (!*f) *f = malloc(sizeof(State));
    memcpy(*f, c, sizeof(State));
    return 0;
}
EXPORT int fmi2SetFMUstate(void *c, void *f) { memcpy(c, f, sizeof(State)); return 0; }
EXPORT int fmi2FreeFMUstate(void *c, void **f) { free(*f); *f = NULL; return 0; }
EXPORT int fmi2SerializedFMUstateSize(void *c, void *f, size_t *n) { *n = sizeof(State); return 0; }
EXPORT int fmi2SerializeFMUstate(void *c, void *f, char b[], size_t n) { memcpy(b, f, n); return 0; }
EXPORT int fmi2DeSerializeFMUstate(void *c, const char b[], size_t n, void **f) {
    *f = malloc(n);
    memcpy(*f, b, n);
    return 0;
}
"""
UNUSED = (
    *(f"fmi2{verb}{kind}" for verb in ("Get", "Set") for kind in ("Integer", "Boolean", "String")),
    *("fmi2GetDirectionalDerivative", "fmi2SetRealInputDerivatives", "fmi2GetRealOutputDerivatives", "fmi2CancelStep"),
    *(f"fmi2Get{kind}Status" for kind in ("", "Real", "Integer", "Boolean", "String")),
)


def description(outputs: int) -> str:
    """Return the model description of the FMU with so many outputs."""
    variables = [("u", 0, 'causality="input" variability="continuous"', 'start="0"')]
    for reference, name in enumerate(("fault", "at", "pause"), start=1):
        variables.append((name, reference, 'causality="parameter" variability="fixed"', 'start="0"'))
    first = len(variables) + 1
    kind = 'causality="output" variability="continuous"'
    variables += [(f"y[{i + 1}]", 10 + i, kind, "") for i in range(outputs)]
    lines = [
        f'<ScalarVariable name="{name}" valueReference="{reference}" {what}><Real {start}/></ScalarVariable>'
        for name, reference, what, start in variables
    ]
    unknowns = "".join(f'<Unknown index="{first + i}" dependencies=""/>' for i in range(outputs))
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmiModelDescription fmiVersion="2.0" modelName="hostile" guid="{uuid.uuid5(uuid.NAMESPACE_DNS, str(outputs))}">'
        '<CoSimulation modelIdentifier="hostile" canHandleVariableCommunicationStepSize="true" '
        'canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>'
        f"<ModelVariables>{''.join(lines)}</ModelVariables><ModelStructure><Outputs>{unknowns}</Outputs>"
        f"<InitialUnknowns>{unknowns}</InitialUnknowns></ModelStructure></fmiModelDescription>"
    )


def build(path: Path, outputs: int = 1) -> Path:
    """Compile the FMU for this machine."""
    source = SOURCE + SAVED + "".join(f"EXPORT int {name}(void) {{ return 3; }}\n" for name in UNUSED)
    library = f"hostile{fmpy.sharedLibraryExtension}"
    # without the compiler's traps, which would turn every fault into the same one
    options = ["-fno-sanitize=all", "-fno-stack-protector", "-O1", "-Wno-everything"]
    binary = compile_shared({"hostile.c": source.encode()}, "hostile.c", library, options, "a hostile FMU")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description(outputs))
        archive.writestr(f"binaries/{fmpy.platform}/{library}", binary)
    return path


if __name__ == "__main__":
    build(Path(sys.argv[1]), int(sys.argv[2]) if sys.argv[2:] else 1)

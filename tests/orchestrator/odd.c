/* An FMU of FMI 2.0 that a test completes with C statements: AT_LOAD, AT_INSTANTIATION, AT_ENTRY and AT_EXIT of the
   initialization, AT_SETTING and AT_READING of Reals, and AT_STEP, from odd.h; SAY logs a text.
   note(pid) adds a line to the file PIDS. Its output y is the input u, its parameter p is fixed; a step sees `time` and `size` [s] and may return another status. */
#define _DEFAULT_SOURCE
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "fmi2Functions.h"
#include "odd.h"

typedef struct { double value[3]; int over, begun; const fmi2CallbackFunctions *host; } Instance; /* u, y, p */
#define SAY(text) one->host->logger(one->host->componentEnvironment, "odd", fmi2OK, "note", text)
#define ONE Instance *one = c; (void)one

void note(int pid) {
  FILE *file = fopen(PIDS, "a");
  fprintf(file, "%d\n", pid);
  fclose(file);
}

__attribute__((constructor)) static void load(void) { AT_LOAD; }

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Component fmi2Instantiate(fmi2String n, fmi2Type t, fmi2String guid, fmi2String f, const fmi2CallbackFunctions *b,
                              fmi2Boolean v, fmi2Boolean l) {
  AT_INSTANTIATION;
  if (strcmp(guid, "{odd}")) return NULL;
  Instance *one = calloc(1, sizeof(Instance));
  one->host = b;
  return one;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2Reset(fmi2Component c) { ONE; memset(one->value, 0, sizeof one->value); one->over = one->begun = 0; return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { ONE; one->begun = 1; AT_ENTRY; return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { ONE; one->begun = 2; AT_EXIT; return fmi2OK; }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean b) {
  ONE;
  if (one->over) return fmi2Error;
  AT_STEP;
  one->value[1] = one->value[0];
  return fmi2OK;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind k, fmi2Boolean *v) {
  ONE;
  *v = one->over;
  return k == fmi2Terminated ? fmi2OK : fmi2Discard;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[]) {
  ONE;
  AT_READING;
  for (size_t i = 0; i < n; i++) v[i] = one->value[r[i]];
  return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[]) {
  ONE;
  AT_SETTING;
  for (size_t i = 0; i < n; i++) one->value[r[i]] = v[i];
  return fmi2OK;
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s) {
  if (!*s) *s = malloc(sizeof(Instance));
  memcpy(*s, c, sizeof(Instance));
  return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) { memcpy(c, s, sizeof(Instance)); return fmi2OK; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s) { free(*s); *s = NULL; return fmi2OK; }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t *n) { *n = sizeof(Instance); return fmi2OK; }
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n) {
  memcpy(b, s, n);
  return fmi2OK;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s) {
  if (!*s) *s = malloc(sizeof(Instance));
  memcpy(*s, b, n);
  return fmi2OK;
}

#define ALWAYS(name, status, ...) fmi2Status name(fmi2Component c, ##__VA_ARGS__) { return status; }
#define R const fmi2ValueReference r[], size_t n
#define K const fmi2StatusKind k
ALWAYS(fmi2SetDebugLogging, fmi2OK, fmi2Boolean b, size_t n, const fmi2String s[])
ALWAYS(fmi2SetupExperiment, fmi2OK, fmi2Boolean b, fmi2Real t, fmi2Real s, fmi2Boolean d, fmi2Real e)
ALWAYS(fmi2Terminate, fmi2OK)
ALWAYS(fmi2CancelStep, fmi2Error)
ALWAYS(fmi2GetInteger, fmi2Error, R, fmi2Integer v[])
ALWAYS(fmi2GetBoolean, fmi2Error, R, fmi2Boolean v[])
ALWAYS(fmi2GetString, fmi2Error, R, fmi2String v[])
ALWAYS(fmi2SetInteger, fmi2Error, R, const fmi2Integer v[])
ALWAYS(fmi2SetBoolean, fmi2Error, R, const fmi2Boolean v[])
ALWAYS(fmi2SetString, fmi2Error, R, const fmi2String v[])
ALWAYS(fmi2GetStatus, fmi2Discard, K, fmi2Status *v)
ALWAYS(fmi2GetRealStatus, fmi2Discard, K, fmi2Real *v)
ALWAYS(fmi2GetIntegerStatus, fmi2Discard, K, fmi2Integer *v)
ALWAYS(fmi2GetStringStatus, fmi2Discard, K, fmi2String *v)
ALWAYS(fmi2SetRealInputDerivatives, fmi2Error, R, const fmi2Integer o[], const fmi2Real v[])
ALWAYS(fmi2GetRealOutputDerivatives, fmi2Error, R, const fmi2Integer o[], fmi2Real v[])
ALWAYS(fmi2GetDirectionalDerivative, fmi2Error, R, const fmi2ValueReference k[], size_t m, const fmi2Real s[], fmi2Real v[])

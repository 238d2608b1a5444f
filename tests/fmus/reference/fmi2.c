/* FMI 2.0 for co-simulation and model exchange around a model. */
#include "fmi2Functions.h"
#include "model.h"

typedef struct { Core core; } Instance;

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) {
  (void)c; (void)on; (void)n; (void)names;
  return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String folder,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
  (void)name; (void)callbacks; (void)visible; (void)logging;
  if (strcmp(guid, TOKEN)) return NULL;
  Instance *one = calloc(1, sizeof *one);
  one->core.exchange = type == fmi2ModelExchange;
  start(&one->core.model);
#ifdef NEEDS_FOLDER
  open_folder(&one->core.model, strncmp(folder, "file://", 7) ? folder : folder + 7);
#else
  (void)folder;
#endif
  return one;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real begin, fmi2Boolean d, fmi2Real e) {
  (void)a; (void)b; (void)d; (void)e;
  Core *core = &((Instance *)c)->core;
  if (core->phase != BEFORE) return fmi2Error;
  core->begin = core->time = begin;
  return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  Core *core = &((Instance *)c)->core;
  if (core->phase != BEFORE) return fmi2Error;
  core->phase = INITIALIZING;
  return fmi2OK;
}
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  Core *core = &((Instance *)c)->core;
  if (core->phase != INITIALIZING) return fmi2Error;
  core->phase = core->exchange ? EVENTS : RUNNING;
  return fmi2OK;
}
fmi2Status fmi2Terminate(fmi2Component c) { ((Instance *)c)->core.phase = OVER; return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) {
  Core *core = &((Instance *)c)->core;
  Model old = core->model;
  *core = (Core){0};
  start(&core->model);
#ifdef NEEDS_FOLDER
  core->model = old;
#else
  (void)old;
#endif
  return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean no_return) {
  (void)no_return;
  Core *core = &((Instance *)c)->core;
  if (core->phase != RUNNING || core->over) return fmi2Error;
  while (now(core) + STEP <= time + size + 1e-6 * STEP) {
    one_step(core);
    if (event(&core->model, now(core))) update(&core->model);
    if (ended(&core->model)) { core->over = true; return fmi2Discard; }
  }
  return fmi2OK;
}
fmi2Status fmi2CancelStep(fmi2Component c) { (void)c; return fmi2Error; }
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind k, fmi2Status *v) { (void)c; (void)k; (void)v; return fmi2Discard; }
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind k, fmi2Real *v) {
  if (k != fmi2LastSuccessfulTime) return fmi2Discard;
  *v = now(&((Instance *)c)->core);
  return fmi2OK;
}
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind k, fmi2Integer *v) { (void)c; (void)k; (void)v; return fmi2Discard; }
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind k, fmi2Boolean *v) {
  if (k != fmi2Terminated) return fmi2Discard;
  *v = ((Instance *)c)->core.over;
  return fmi2OK;
}
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind k, fmi2String *v) { (void)c; (void)k; (void)v; return fmi2Discard; }
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
                                       const fmi2Real v[]) { (void)c; (void)r; (void)n; (void)o; (void)v; return fmi2Error; }
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
                                        fmi2Real v[]) { (void)c; (void)r; (void)n; (void)o; (void)v; return fmi2Error; }
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference u[], size_t n,
                                        const fmi2ValueReference k[], size_t m, const fmi2Real s[], fmi2Real v[]) {
  (void)c; (void)u; (void)n; (void)k; (void)m; (void)s; (void)v;
  return fmi2Error;
}

#define EXCHANGE(Name, CType, TYPE, read, store)                                                             \
  fmi2Status fmi2Get##Name(fmi2Component c, const fmi2ValueReference r[], size_t n, CType v[]) {             \
    Core *core = &((Instance *)c)->core;                                                                     \
    derivatives(&core->model);                                                                               \
    for (size_t i = 0; i < n; i++) {                                                                         \
      const Variable *found = find(r[i], TYPE);                                                              \
      if (!found) return fmi2Error;                                                                          \
      char *place = (char *)&core->model + found->place;                                                     \
      read;                                                                                                  \
    }                                                                                                        \
    return fmi2OK;                                                                                           \
  }                                                                                                          \
  fmi2Status fmi2Set##Name(fmi2Component c, const fmi2ValueReference r[], size_t n, const CType v[]) {       \
    Core *core = &((Instance *)c)->core;                                                                     \
    for (size_t i = 0; i < n; i++) {                                                                         \
      const Variable *found = find(r[i], TYPE);                                                              \
      if (!found || !may_set(core, found)) return fmi2Error;                                                 \
      char *place = (char *)&core->model + found->place;                                                     \
      store;                                                                                                 \
    }                                                                                                        \
    return fmi2OK;                                                                                           \
  }
EXCHANGE(Real, fmi2Real, F64, v[i] = *(double *)place, *(double *)place = v[i])
EXCHANGE(Integer, fmi2Integer, I32, v[i] = *(int32_t *)place, *(int32_t *)place = v[i])
EXCHANGE(Boolean, fmi2Boolean, BOOL, v[i] = *(bool *)place, *(bool *)place = v[i])
EXCHANGE(String, fmi2String, STR, v[i] = place, snprintf(place, sizeof(Text), "%s", v[i]))

#define PART Core *core = &((Instance *)c)->core
fmi2Status fmi2EnterEventMode(fmi2Component c) {
  PART;
  if (core->phase != RUNNING) return fmi2Error;
  core->phase = EVENTS;
  return fmi2OK;
}
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
  PART;
  if (core->phase != EVENTS) return fmi2Error;
  bool changed = event(&core->model, core->time);
  if (changed) update(&core->model);
  double next = next_event(&core->model);
  *info = (fmi2EventInfo){0};
  info->valuesOfContinuousStatesChanged = changed;
  info->terminateSimulation = ended(&core->model);
  info->nextEventTimeDefined = isfinite(next);
  info->nextEventTime = next;
  return fmi2OK;
}
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
  PART;
  if (core->phase != EVENTS) return fmi2Error;
  core->phase = RUNNING;
  return fmi2OK;
}
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean keep, fmi2Boolean *events, fmi2Boolean *over) {
  PART;
  (void)keep;
  *events = step_event(&core->model);
  *over = false;
  return fmi2OK;
}
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) { PART; core->time = time; return fmi2OK; }
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
  PART;
  if (n != NX || core->phase != RUNNING) return fmi2Error;
  memcpy(&core->model, x, n * sizeof *x);
  return fmi2OK;
}
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real dx[], size_t n) {
  PART;
  if (n != NX) return fmi2Error;
  derivatives(&core->model);
  memcpy(dx, (double *)&core->model + NX, n * sizeof *dx);
  return fmi2OK;
}
fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) {
  PART;
  if (n != NZ) return fmi2Error;
  indicators(&core->model, z);
  return fmi2OK;
}
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
  PART;
  if (n != NX) return fmi2Error;
  memcpy(x, &core->model, n * sizeof *x);
  return fmi2OK;
}
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
  (void)c;
  for (size_t i = 0; i < n; i++) x[i] = 1.0;
  return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
  if (!*state) *state = malloc(sizeof(Instance));
  memcpy(*state, c, sizeof(Instance));
  return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) { memcpy(c, state, sizeof(Instance)); return fmi2OK; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) { (void)c; free(*state); *state = NULL; return fmi2OK; }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t *n) { (void)c; (void)s; *n = sizeof(Instance); return fmi2OK; }
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n) { (void)c; memcpy(b, s, n); return fmi2OK; }
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s) {
  (void)c;
  if (n != sizeof(Instance)) return fmi2Error;
  if (!*s) *s = malloc(n);
  memcpy(*s, b, n);
  return fmi2OK;
}

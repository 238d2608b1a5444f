/* FMI 3.0 for co-simulation and model exchange around a model, with event mode and early return if the host wants them. */
#include "fmi3Functions.h"
#include "model.h"

typedef struct {
  Core core;
  bool event_mode, early;
#ifdef CLOCKED
  bool active[CLOCKED + 1], done[CLOCKED + 1];
#endif
} Instance;
/* Let the clocks that are active tick, once, at the latest when something is read. */
static void evaluate(Instance *one) {
#ifdef CLOCKED
  for (int i = 1; i <= CLOCKED; i++)
    if (one->active[i] && !one->done[i]) {
      one->done[i] = true;
      tick(&one->core.model, i, now(&one->core));
    }
#else
  (void)one;
#endif
}
#define CORE Core *core = &((Instance *)c)->core

const char *fmi3GetVersion(void) { return fmi3Version; }
fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String names[]) {
  (void)c; (void)on; (void)n; (void)names;
  return fmi3OK;
}
static Instance *instantiate(fmi3String token, fmi3String folder) {
  if (strcmp(token, TOKEN)) return NULL;
  Instance *one = calloc(1, sizeof *one);
  start(&one->core.model);
#ifdef NEEDS_FOLDER
  open_folder(&one->core.model, folder);
#else
  (void)folder;
#endif
  return one;
}
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String folder, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback intermediate) {
  (void)name; (void)visible; (void)logging; (void)required; (void)n; (void)environment; (void)log; (void)intermediate;
  Instance *one = instantiate(token, folder);
  if (!one) return NULL;
  one->event_mode = event_mode;
  one->early = early;
  return one;
}
fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String folder, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
  (void)name; (void)visible; (void)logging; (void)environment; (void)log;
  Instance *one = instantiate(token, folder);
  if (!one) return NULL;
  one->event_mode = one->core.exchange = true;
  return one;
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) {
  CORE;
  if (core->phase != BEFORE) return fmi3Error;
  core->phase = CONFIGURING;
  return fmi3OK;
}
fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) {
  CORE;
  if (core->phase != CONFIGURING) return fmi3Error;
#ifdef NEEDS_SIZES
  if (core->model.m > MOST || core->model.n > MOST || core->model.r > MOST) return fmi3Error;
  resize(&core->model);
#endif
  core->phase = BEFORE;
  return fmi3OK;
}
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 begin_time, fmi3Boolean d,
                                       fmi3Float64 e) {
  (void)a; (void)b; (void)d; (void)e;
  CORE;
  if (core->phase != BEFORE) return fmi3Error;
  core->begin = core->time = begin_time;
  core->phase = INITIALIZING;
  return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
  CORE;
  if (core->phase != INITIALIZING) return fmi3Error;
#ifdef NEEDS_SIZES
  begin(&core->model);
#endif
  core->phase = ((Instance *)c)->event_mode ? EVENTS : RUNNING;
  return fmi3OK;
}
fmi3Status fmi3EnterEventMode(fmi3Instance c) {
  CORE;
  if (core->phase != RUNNING || !((Instance *)c)->event_mode) return fmi3Error;
  core->phase = EVENTS;
  return fmi3OK;
}
fmi3Status fmi3EnterStepMode(fmi3Instance c) {
  CORE;
  if (core->phase != EVENTS) return fmi3Error;
  core->phase = RUNNING;
  return fmi3OK;
}
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *over, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *next) {
  CORE;
  if (core->phase != EVENTS) return fmi3Error;
  evaluate(c);
#ifdef CLOCKED
  memset(((Instance *)c)->active, 0, 2 * (CLOCKED + 1));
#endif
  *values = event(&core->model, now(core));
  if (*values) update(&core->model);
  core->over = ended(&core->model);
  *again = *nominals = false;
  *over = core->over;
  *next = next_event(&core->model);
  *defined = isfinite(*next);
  return fmi3OK;
}
fmi3Status fmi3Terminate(fmi3Instance c) { CORE; core->phase = OVER; return fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance c) {
  CORE;
  Model old = core->model;
  *core = (Core){0};
  start(&core->model);
#ifdef NEEDS_FOLDER
  core->model = old;
#else
  (void)old;
#endif
  return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 size, fmi3Boolean no_return, fmi3Boolean *events,
                      fmi3Boolean *over, fmi3Boolean *early, fmi3Float64 *last) {
  (void)no_return;
  Instance *one = c;
  CORE;
  *events = *over = *early = false;
  *last = time;
  if (core->phase != RUNNING || core->over) return fmi3Error;
  while (now(core) + STEP <= time + size + 1e-6 * STEP) {
    one_step(core);
    if (event(&core->model, now(core))) {
      bool inside = now(core) + STEP <= time + size + 1e-6 * STEP;
      if (one->event_mode && (one->early || !inside)) {
        *events = true;
        *early = inside;
        *last = inside ? now(core) : time + size;
        return fmi3OK;
      }
      update(&core->model);
    }
    if (ended(&core->model)) {
      *over = core->over = true;
      *last = now(core);
      return fmi3OK;
    }
  }
  *last = time + size;
  return fmi3OK;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) { return fmi3EnterStepMode(c); }
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean keep, fmi3Boolean *events, fmi3Boolean *over) {
  CORE;
  (void)keep;
  *events = step_event(&core->model);
  *over = false;
  return fmi3OK;
}
fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) { CORE; core->time = time; return fmi3OK; }
fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) {
  CORE;
  if (n != NX || core->phase != RUNNING) return fmi3Error;
  memcpy(&core->model, x, n * sizeof *x);
  return fmi3OK;
}
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 dx[], size_t n) {
  CORE;
  if (n != NX) return fmi3Error;
  derivatives(&core->model);
  memcpy(dx, (double *)&core->model + NX, n * sizeof *dx);
  return fmi3OK;
}
fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 z[], size_t n) {
  CORE;
  if (n != NZ) return fmi3Error;
  indicators(&core->model, z);
  return fmi3OK;
}
fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) {
  CORE;
  if (n != NX) return fmi3Error;
  memcpy(x, &core->model, n * sizeof *x);
  return fmi3OK;
}
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) {
  (void)c;
  for (size_t i = 0; i < n; i++) x[i] = 1.0;
  return fmi3OK;
}
fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n) { (void)c; *n = NZ; return fmi3OK; }
fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n) { (void)c; *n = NX; return fmi3OK; }

#ifdef CLOCKED
/* What belongs to a clock may be read and set while it is active, and before the run. */
static bool hidden(Instance *one, const Variable *v) {
  int clock = clock_of(v->reference);
  return clock && one->core.phase > INITIALIZING && !one->active[clock];
}
fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Clock on[]) {
  Instance *one = c;
  CORE;
  if (core->phase != EVENTS) return fmi3Error;
  for (size_t i = 0; i < n; i++) {
    if (r[i] < 1 || r[i] > CLOCKED || !on[i] || one->active[r[i]]) return fmi3Error;
    one->active[r[i]] = true;
  }
  return fmi3OK;
}
fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 T[],
                                  fmi3IntervalQualifier known[]) {
  CORE;
  if (core->phase != EVENTS && core->phase != INITIALIZING) return fmi3Error;
  for (size_t i = 0; i < n; i++) known[i] = interval(&core->model, r[i], T + i);
  return fmi3OK;
}
fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 s[]) {
  CORE;
  if (core->phase != INITIALIZING) return fmi3Error;
  for (size_t i = 0; i < n; i++) s[i] = shift(&core->model, r[i]);
  return fmi3OK;
}
#else
static bool hidden(Instance *one, const Variable *v) { (void)one; (void)v; return false; }
#endif

#define EACH(TYPE, setting, body)                                                       \
  CORE;                                                                                 \
  size_t k = 0;                                                                         \
  for (size_t i = 0; i < n; i++) {                                                      \
    const Variable *found = find(r[i], TYPE);                                           \
    if (!found || hidden(c, found) || (setting && !may_set(core, found))) return fmi3Error;                 \
    size_t size = many(core, found);                                                    \
    char *place = (char *)&core->model + found->place;                                  \
    if (k + size > m) return fmi3Error;                                                 \
    for (size_t j = 0; j < size; j++, k++, place += SIZES[TYPE]) { body; }              \
  }                                                                                     \
  return k == m ? fmi3OK : fmi3Error;
#define EXCHANGE(Name, CType, TYPE, read, store)                                                                         \
  fmi3Status fmi3Get##Name(fmi3Instance c, const fmi3ValueReference r[], size_t n, CType v[], size_t m) {                \
    derivatives(&((Instance *)c)->core.model);                                                                           \
    evaluate(c);                                                                                                         \
    EACH(TYPE, false, read)                                                                                              \
  }                                                                                                                      \
  fmi3Status fmi3Set##Name(fmi3Instance c, const fmi3ValueReference r[], size_t n, const CType v[], size_t m) {          \
    EACH(TYPE, true, store)                                                                                              \
  }
#define NUMBER(Name, CType, TYPE) EXCHANGE(Name, CType, TYPE, v[k] = *(CType *)place, *(CType *)place = v[k])
NUMBER(Float64, fmi3Float64, F64) NUMBER(Float32, fmi3Float32, F32)
NUMBER(Int8, fmi3Int8, I8) NUMBER(UInt8, fmi3UInt8, U8) NUMBER(Int16, fmi3Int16, I16) NUMBER(UInt16, fmi3UInt16, U16)
NUMBER(Int32, fmi3Int32, I32) NUMBER(UInt32, fmi3UInt32, U32) NUMBER(Int64, fmi3Int64, I64) NUMBER(UInt64, fmi3UInt64, U64)
NUMBER(Boolean, fmi3Boolean, BOOL)
EXCHANGE(String, fmi3String, STR, v[k] = place, snprintf(place, sizeof(Text), "%s", v[k]))
fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t n, size_t sizes[], fmi3Binary v[], size_t m) {
  EACH(BIN, false, sizes[k] = ((Bytes *)place)->size; v[k] = ((Bytes *)place)->data)
}
fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t n, const size_t sizes[], const fmi3Binary v[],
                         size_t m) {
  EACH(BIN, true, if (sizes[k] > 64) return fmi3Error; ((Bytes *)place)->size = sizes[k];
       memcpy(((Bytes *)place)->data, v[k], sizes[k]))
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  if (!*state) *state = malloc(sizeof(Instance));
  memcpy(*state, c, sizeof(Instance));
  return fmi3OK;
}
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) { memcpy(c, state, sizeof(Instance)); return fmi3OK; }
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) { (void)c; free(*state); *state = NULL; return fmi3OK; }
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState s, size_t *n) { (void)c; (void)s; *n = sizeof(Instance); return fmi3OK; }
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState s, fmi3Byte b[], size_t n) { (void)c; memcpy(b, s, n); return fmi3OK; }
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte b[], size_t n, fmi3FMUState *s) {
  (void)c;
  if (n != sizeof(Instance)) return fmi3Error;
  if (!*s) *s = malloc(n);
  memcpy(*s, b, n);
  return fmi3OK;
}

/* FMI 3.0 for co-simulation around the stepper. Value reference 0 is time; k is the k-th array of the model, whose
   elements are neighbours in its table of variables. */

#include "fmi3Functions.h"
#include "stepper.h"
#include "state.h"

typedef struct {
  Stepper stepper;
  fmi3InstanceEnvironment environment;
  fmi3LogMessageCallback logger;
  bool logging;
} Instance;

#include "instance.h"

/* Log the stepper's message: an error always, as the standard allows, anything else if the host wants it. */
static fmi3Status fail(Instance *m, fmi3Status status) {
  const char *category = status == fmi3Warning   ? "logStatusWarning"
                         : status == fmi3Discard ? "logStatusDiscard"
                                                 : "logStatusError";
  bool wanted = m->logging || status >= fmi3Error;
  if (m->logger && wanted) m->logger(m->environment, status, category, m->stepper.message);
  return status;
}

/* Log the results that have left the range in which the model is valid. That refuses nothing. */
static fmi3Status with_warnings(Instance *m) {
  while (stepper_warns(&m->stepper)) fail(m, fmi3Warning);
  return fmi3OK;
}

/* Log a call that the present mode does not allow. */
static fmi3Status wrong(Instance *m, const char *call) {
  if (!m) return fmi3Error;
  wrong_call(&m->stepper, call);
  return fail(m, fmi3Error);
}

static bool is_in(const Instance *m, Mode mode) { return m && m->stepper.state.mode == mode; }

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]) {
  Instance *m = c;
  (void)n, (void)categories; /* all or nothing: refusals and warnings are all that is logged */
  if (!m) return fmi3Error;
  m->logging = on;
  return fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference required[], size_t n_required,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                         fmi3IntermediateUpdateCallback update) {
  const char *refusal = NULL;
  Instance *m = NULL;
  (void)visible, (void)early_return, (void)required, (void)n_required, (void)update;
  if (!name || !*name) {
    refusal = "an instance needs a name";
  } else if (!token || strcmp(token, MODEL_GUID) != 0) {
    refusal = "the token is not " MODEL_GUID ", which this binary was built for";
  } else if (event_mode) {
    refusal = "model '" MODEL_NAME "' has no event mode, as its description says";
  } else if ((refusal = tables_open(resources))) {
    /* said why */
  } else if (!(m = instance_new())) {
    tables_close();
    refusal = "there is no memory for another instance of model '" MODEL_NAME "'";
  }
  if (refusal) {
    if (logger) logger(environment, fmi3Error, "logStatusError", refusal);
    return NULL;
  }
  m->logger = logger;
  m->logging = logging;
  m->environment = environment;
  stepper_reset(&m->stepper);
  return m;
}

void fmi3FreeInstance(fmi3Instance c) { instance_free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop) {
  Instance *m = c;
  (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
  if (!is_in(m, INSTANTIATED)) return wrong(m, "fmi3EnterInitializationMode");
  m->stepper.state.mode = INITIALIZING;
  m->stepper.state.time = start;
  return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
  Instance *m = c;
  if (!is_in(m, INITIALIZING)) return wrong(m, "fmi3ExitInitializationMode");
  if (!m->stepper.results_known && !stepper_initialize(&m->stepper)) return fail(m, fmi3Error);
  m->stepper.state.mode = RUNNING;
  return with_warnings(m);
}

fmi3Status fmi3Terminate(fmi3Instance c) {
  Instance *m = c;
  if (!is_in(m, RUNNING)) return wrong(m, "fmi3Terminate");
  m->stepper.state.mode = TERMINATED;
  return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c) {
  Instance *m = c;
  if (!m) return fmi3Error;
  stepper_reset(&m->stepper);
  return fmi3OK;
}

/* Check the arguments of a call that names arrays; some calls may name time, which is value reference 0. */
static bool valid(Instance *m, const fmi3ValueReference vr[], size_t n, const void *values, size_t n_values,
                  bool with_time) {
  size_t needed = 0;
  if ((n > 0 && !vr) || (n_values > 0 && !values)) {
    return refuse(&m->stepper, "there are %zu variables, but an array is NULL", n);
  }
  for (size_t i = 0; i < n; i++) {
    if (vr[i] > N_ARRAYS || (vr[i] == 0 && !with_time)) {
      return refuse(&m->stepper, "value reference %u of model '%s' cannot be used here; there are 1 to %d", vr[i],
                    MODEL_NAME, N_ARRAYS);
    }
    needed += vr[i] == 0 ? 1 : ARRAYS[vr[i] - 1].size;
  }
  if (needed == n_values) return true;
  return refuse(&m->stepper, "these variables of model '%s' have %zu values, not %zu", MODEL_NAME, needed, n_values);
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[],
                          size_t n_values) {
  Instance *m = c;
  if (!m) return fmi3Error;
  /* a host that ignores the status must not take the buffer's old content for a value */
  for (size_t i = 0; values && i < n_values; i++) values[i] = NAN;
  if (!valid(m, vr, n, values, n_values, true)) return fail(m, fmi3Error);
  for (size_t i = 0; i < n; i++) {
    if (vr[i] > 0 && !stepper_may_get(&m->stepper, ARRAYS[vr[i] - 1].first)) return fail(m, fmi3Error);
  }
  for (size_t i = 0; i < n; i++) {
    if (vr[i] == 0) {
      *values++ = m->stepper.state.time;
    } else {
      const Array *array = &ARRAYS[vr[i] - 1];
      for (int k = 0; k < array->size; k++) *values++ = m->stepper.state.values[array->first + k];
    }
  }
  return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 values[],
                          size_t n_values) {
  Instance *m = c;
  if (!m || is_in(m, TERMINATED)) return wrong(m, "fmi3SetFloat64");
  if (!valid(m, vr, n, values, n_values, false)) return fail(m, fmi3Error);
  for (size_t i = 0; i < n; i++) {
    if (!stepper_may_set(&m->stepper, ARRAYS[vr[i] - 1].first)) return fail(m, fmi3Error); /* before any is set */
  }
  for (size_t i = 0; i < n; i++) {
    const Array *array = &ARRAYS[vr[i] - 1];
    for (int k = 0; k < array->size; k++) stepper_set(&m->stepper, array->first + k, *values++);
  }
  return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 h, fmi3Boolean no_return,
                      fmi3Boolean *event_handling_needed, fmi3Boolean *terminate, fmi3Boolean *early_return,
                      fmi3Float64 *last_successful_time) {
  Instance *m = c;
  (void)no_return;
  if (!is_in(m, RUNNING)) return wrong(m, "fmi3DoStep");
  if (event_handling_needed) *event_handling_needed = fmi3False;
  if (terminate) *terminate = fmi3False;
  if (early_return) *early_return = fmi3False;
  if (last_successful_time) *last_successful_time = time;
  if (!stepper_step(&m->stepper, h)) return fail(m, fmi3Discard);
  m->stepper.state.time = time + h;
  if (last_successful_time) *last_successful_time = time + h;
  return with_warnings(m);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns,
                                        const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[],
                                        size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity) {
  Instance *m = c;
  if (!m || is_in(m, TERMINATED)) return wrong(m, "fmi3GetDirectionalDerivative");
  if (!valid(m, unknowns, n_unknowns, sensitivity, n_sensitivity, false) ||
      !valid(m, knowns, n_knowns, seed, n_seed, false)) {
    return fail(m, fmi3Error);
  }
  memset(m->stepper.du, 0, sizeof m->stepper.du);
  for (size_t i = 0; i < n_knowns; i++) {
    const Array *array = &ARRAYS[knowns[i] - 1];
    for (int k = 0; k < array->size; k++) {
      if (!stepper_seed(&m->stepper, array->first + k, *seed++)) return fail(m, fmi3Error);
    }
  }
  if (!stepper_derivative(&m->stepper)) return fail(m, fmi3Error);
  for (size_t i = 0; i < n_unknowns; i++) {
    const Array *array = &ARRAYS[unknowns[i] - 1];
    for (int k = 0; k < array->size; k++) *sensitivity++ = derivative_of(&m->stepper, array->first + k);
  }
  return fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  Instance *m = c;
  if (!m || !state) return fmi3Error;
  return state_save(&m->stepper, state) ? fmi3OK : fail(m, fmi3Error);
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  Instance *m = c;
  if (!m || !state) return wrong(m, "fmi3SetFMUState with no state");
  state_restore(&m->stepper, state);
  return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
  if (!c) return fmi3Error;
  if (state) state_free(state);
  return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
  if (!c || !state || !size) return wrong(c, "fmi3SerializedFMUStateSize with no state");
  *size = STATE_SIZE;
  return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  if (!c || !state || !bytes || size < STATE_SIZE) return wrong(c, "fmi3SerializeFMUState with too little room");
  state_write(state, bytes);
  return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
  Instance *m = c;
  if (!m || !bytes || !state) return wrong(m, "fmi3DeserializeFMUState with nothing to read");
  return state_read(&m->stepper, bytes, size, state) ? fmi3OK : fail(m, fmi3Error);
}

/* Every other function belongs to what the model description denies: other kinds of simulation, variables of other
   types, events, clocks, configuration. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define REFERENCES fmi3Instance c, const fmi3ValueReference vr[], size_t n

static fmi3Instance co_simulation_only(fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger) {
  if (logger) logger(environment, fmi3Error, "logStatusError", "model '" MODEL_NAME "' is for co-simulation only");
  return NULL;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback logger) {
  return co_simulation_only(environment, logger);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback logger,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
  return co_simulation_only(environment, logger);
}

static fmi3Status not_float64(Instance *m, size_t n) {
  if (!m) return fmi3Error;
  if (n == 0) return fmi3OK;
  refuse(&m->stepper, "model '%s' has variables of type Float64 only", MODEL_NAME);
  return fail(m, fmi3Error);
}

#define NO_VARIABLES(name, ...) \
  fmi3Status name(__VA_ARGS__) { return not_float64(c, n); }
#define NO_VARIABLES_OF(Type)                                                  \
  NO_VARIABLES(fmi3Get##Type, REFERENCES, fmi3##Type values[], size_t n_values) \
  NO_VARIABLES(fmi3Set##Type, REFERENCES, const fmi3##Type values[], size_t n_values)

NO_VARIABLES_OF(Float32)
NO_VARIABLES_OF(Int8)
NO_VARIABLES_OF(UInt8)
NO_VARIABLES_OF(Int16)
NO_VARIABLES_OF(UInt16)
NO_VARIABLES_OF(Int32)
NO_VARIABLES_OF(UInt32)
NO_VARIABLES_OF(Int64)
NO_VARIABLES_OF(UInt64)
NO_VARIABLES_OF(Boolean)
NO_VARIABLES_OF(String)
NO_VARIABLES(fmi3GetBinary, REFERENCES, size_t sizes[], fmi3Binary values[], size_t n_values)
NO_VARIABLES(fmi3SetBinary, REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t n_values)
NO_VARIABLES(fmi3GetClock, REFERENCES, fmi3Clock values[])
NO_VARIABLES(fmi3SetClock, REFERENCES, const fmi3Clock values[])

#define NOT_PROVIDED(name, ...) \
  fmi3Status name(__VA_ARGS__) { return wrong(c, #name ": the model description does not offer it, so it"); }

NOT_PROVIDED(fmi3EnterConfigurationMode, fmi3Instance c)
NOT_PROVIDED(fmi3ExitConfigurationMode, fmi3Instance c)
NOT_PROVIDED(fmi3EnterEventMode, fmi3Instance c)
NOT_PROVIDED(fmi3EnterStepMode, fmi3Instance c)
NOT_PROVIDED(fmi3EnterContinuousTimeMode, fmi3Instance c)
NOT_PROVIDED(fmi3EvaluateDiscreteStates, fmi3Instance c)
NOT_PROVIDED(fmi3UpdateDiscreteStates, fmi3Instance c, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *d, fmi3Boolean *e,
             fmi3Boolean *f, fmi3Float64 *g)
NOT_PROVIDED(fmi3GetNumberOfVariableDependencies, fmi3Instance c, fmi3ValueReference vr, size_t *n)
NOT_PROVIDED(fmi3GetVariableDependencies, fmi3Instance c, fmi3ValueReference vr, size_t a[], fmi3ValueReference b[],
             size_t d[], fmi3DependencyKind e[], size_t n)
NOT_PROVIDED(fmi3GetAdjointDerivative, fmi3Instance c, const fmi3ValueReference a[], size_t b,
             const fmi3ValueReference d[], size_t e, const fmi3Float64 f[], size_t g, fmi3Float64 h[], size_t i)
NOT_PROVIDED(fmi3GetOutputDerivatives, REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t m)
NOT_PROVIDED(fmi3GetIntervalDecimal, REFERENCES, fmi3Float64 a[], fmi3IntervalQualifier b[])
NOT_PROVIDED(fmi3GetIntervalFraction, REFERENCES, fmi3UInt64 a[], fmi3UInt64 b[], fmi3IntervalQualifier d[])
NOT_PROVIDED(fmi3GetShiftDecimal, REFERENCES, fmi3Float64 a[])
NOT_PROVIDED(fmi3GetShiftFraction, REFERENCES, fmi3UInt64 a[], fmi3UInt64 b[])
NOT_PROVIDED(fmi3SetIntervalDecimal, REFERENCES, const fmi3Float64 a[])
NOT_PROVIDED(fmi3SetIntervalFraction, REFERENCES, const fmi3UInt64 a[], const fmi3UInt64 b[])
NOT_PROVIDED(fmi3SetShiftDecimal, REFERENCES, const fmi3Float64 a[])
NOT_PROVIDED(fmi3SetShiftFraction, REFERENCES, const fmi3UInt64 a[], const fmi3UInt64 b[])
NOT_PROVIDED(fmi3CompletedIntegratorStep, fmi3Instance c, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *d)
NOT_PROVIDED(fmi3SetTime, fmi3Instance c, fmi3Float64 time)
NOT_PROVIDED(fmi3SetContinuousStates, fmi3Instance c, const fmi3Float64 a[], size_t n)
NOT_PROVIDED(fmi3GetContinuousStateDerivatives, fmi3Instance c, fmi3Float64 a[], size_t n)
NOT_PROVIDED(fmi3GetEventIndicators, fmi3Instance c, fmi3Float64 a[], size_t n)
NOT_PROVIDED(fmi3GetContinuousStates, fmi3Instance c, fmi3Float64 a[], size_t n)
NOT_PROVIDED(fmi3GetNominalsOfContinuousStates, fmi3Instance c, fmi3Float64 a[], size_t n)
NOT_PROVIDED(fmi3GetNumberOfEventIndicators, fmi3Instance c, size_t *n)
NOT_PROVIDED(fmi3GetNumberOfContinuousStates, fmi3Instance c, size_t *n)
NOT_PROVIDED(fmi3ActivateModelPartition, fmi3Instance c, fmi3ValueReference a, fmi3Float64 time)

#if HAS_LOOPS
#include "loop.h"
#endif

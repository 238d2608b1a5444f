/* FMI 2.0 for co-simulation around the stepper. Value references are places in the model's table of variables. */

#include "fmi2Functions.h"
#include "stepper.h"
#include "state.h"

typedef struct {
  Stepper stepper;
  fmi2ComponentEnvironment environment;
  fmi2CallbackLogger logger;
  char name[128];
  fmi2Status last_step;
} Instance;

#include "instance.h"

/* Log a refusal or a warning. Its text is a printf format for the host: a percent sign is doubled. */
static void log_text(fmi2CallbackLogger logger, fmi2ComponentEnvironment environment, const char *name,
                     fmi2Status status, const char *text) {
  char format[2 * sizeof((Stepper *)0)->message];
  size_t n = 0;
  if (!logger) return;
  for (; *text && n + 2 < sizeof format; text++) {
    if (*text == '%') format[n++] = '%';
    format[n++] = *text;
  }
  format[n] = '\0';
  logger(environment, name, status,
         status == fmi2Warning   ? "logStatusWarning"
         : status == fmi2Discard ? "logStatusDiscard"
                                 : "logStatusError",
         format);
}

/* Log the stepper's message. */
static fmi2Status fail(Instance *m, fmi2Status status) {
  log_text(m->logger, m->environment, m->name, status, m->stepper.message);
  return status;
}

/* Log the results that have left the range in which the model is valid. That refuses nothing. */
static fmi2Status with_warnings(Instance *m) {
  while (stepper_warns(&m->stepper)) fail(m, fmi2Warning);
  return fmi2OK;
}

/* Log a call that the present mode does not allow. */
static fmi2Status wrong(Instance *m, const char *call) {
  if (!m) return fmi2Error;
  wrong_call(&m->stepper, call);
  return fail(m, fmi2Error);
}

static bool is_in(const Instance *m, Mode mode) { return m && m->stepper.state.mode == mode; }

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
  fmi2CallbackLogger logger = callbacks ? callbacks->logger : NULL;
  fmi2ComponentEnvironment environment = callbacks ? callbacks->componentEnvironment : NULL;
  const char *refusal = NULL;
  Instance *m = NULL;
  (void)visible, (void)logging;
  if (!name || !*name) {
    refusal = "an instance needs a name";
  } else if (type != fmi2CoSimulation) {
    refusal = "model '" MODEL_NAME "' is for co-simulation only";
  } else if (!guid || strcmp(guid, MODEL_GUID) != 0) {
    refusal = "the guid is not " MODEL_GUID ", which this binary was built for";
  } else if ((refusal = tables_open(resources))) {
    /* said why */
  } else if (!(m = instance_new())) {
    tables_close();
    refusal = "there is no memory for another instance of model '" MODEL_NAME "'";
  }
  if (refusal) {
    log_text(logger, environment, name ? name : "", fmi2Error, refusal);
    return NULL;
  }
  m->logger = logger;
  m->environment = environment;
  snprintf(m->name, sizeof m->name, "%s", name);
  MODEL_RESOURCES(&m->stepper, resources);
  stepper_reset(&m->stepper);
  return m;
}

void fmi2FreeInstance(fmi2Component c) { instance_free(c); }

/* Refusals and warnings are logged always: FMI 2.0 allows it, and they explain what a run did. */
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
  (void)on, (void)n, (void)categories;
  return c ? fmi2OK : fmi2Error;
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stop_defined, fmi2Real stop) {
  Instance *m = c;
  (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
  if (!is_in(m, INSTANTIATED)) return wrong(m, "fmi2SetupExperiment");
  m->stepper.state.time = start;
  return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  Instance *m = c;
  if (!is_in(m, INSTANTIATED)) return wrong(m, "fmi2EnterInitializationMode");
  m->stepper.state.mode = INITIALIZING;
  return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  Instance *m = c;
  if (!is_in(m, INITIALIZING)) return wrong(m, "fmi2ExitInitializationMode");
  if (!m->stepper.results_known && !stepper_initialize(&m->stepper)) return fail(m, fmi2Error);
  m->stepper.state.mode = RUNNING;
  return with_warnings(m);
}

fmi2Status fmi2Terminate(fmi2Component c) {
  Instance *m = c;
  if (!is_in(m, RUNNING)) return wrong(m, "fmi2Terminate");
  m->stepper.state.mode = TERMINATED;
  return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
  Instance *m = c;
  if (!m) return fmi2Error;
  stepper_reset(&m->stepper);
  m->last_step = fmi2OK;
  return fmi2OK;
}

/* Check the arguments of a call that names variables. */
static bool valid(Instance *m, const fmi2ValueReference vr[], size_t n, const void *values) {
  if (n > 0 && (!vr || !values)) return refuse(&m->stepper, "there are %zu variables, but an array is NULL", n);
  for (size_t i = 0; i < n; i++) {
    if (vr[i] >= N_VARIABLES) {
      return refuse(&m->stepper, "model '%s' has no value reference %u; it has 0 to %d", MODEL_NAME, vr[i],
                    N_VARIABLES - 1);
    }
  }
  return true;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
  Instance *m = c;
  if (!m) return fmi2Error;
  /* a host that ignores the status must not take the buffer's old content for a value */
  for (size_t i = 0; value && i < n; i++) value[i] = NAN;
  if (!valid(m, vr, n, value)) return fail(m, fmi2Error);
  for (size_t i = 0; i < n; i++) {
    if (!stepper_may_get(&m->stepper, vr[i])) return fail(m, fmi2Error);
  }
  for (size_t i = 0; i < n; i++) value[i] = m->stepper.state.values[vr[i]];
  return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
  Instance *m = c;
  if (!m || is_in(m, TERMINATED)) return wrong(m, "fmi2SetReal");
  if (!valid(m, vr, n, value)) return fail(m, fmi2Error);
  for (size_t i = 0; i < n; i++) {
    if (!stepper_may_set(&m->stepper, vr[i])) return fail(m, fmi2Error); /* before any is set */
  }
  for (size_t i = 0; i < n; i++) stepper_set(&m->stepper, vr[i], value[i]);
  return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean no_return) {
  Instance *m = c;
  (void)no_return;
  if (!is_in(m, RUNNING)) return wrong(m, "fmi2DoStep");
  if (!stepper_step(&m->stepper, h)) return fail(m, m->last_step = fmi2Discard);
  m->stepper.state.time = time + h;
  return m->last_step = with_warnings(m);
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
  Instance *m = c;
  if (!m || !value || kind != fmi2DoStepStatus) return fmi2Discard;
  *value = m->last_step;
  return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
  Instance *m = c;
  if (!m || !value || kind != fmi2LastSuccessfulTime) return fmi2Discard;
  *value = m->stepper.state.time;
  return fmi2OK;
}

/* A host that cannot do a refused step in another way should end: some would repeat it for ever. */
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
  Instance *m = c;
  if (!m || !value || kind != fmi2Terminated) return fmi2Discard;
  *value = m->last_step == fmi2Discard;
  return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown,
                                        const fmi2ValueReference known[], size_t n_known, const fmi2Real d_known[],
                                        fmi2Real d_unknown[]) {
  Instance *m = c;
  if (!m || is_in(m, TERMINATED)) return wrong(m, "fmi2GetDirectionalDerivative");
  if (!valid(m, unknown, n_unknown, d_unknown) || !valid(m, known, n_known, d_known)) return fail(m, fmi2Error);
  memset(m->stepper.du, 0, sizeof m->stepper.du);
  for (size_t i = 0; i < n_known; i++) {
    if (!stepper_seed(&m->stepper, known[i], d_known[i])) return fail(m, fmi2Error);
  }
  if (!stepper_derivative(&m->stepper)) return fail(m, fmi2Error);
  for (size_t i = 0; i < n_unknown; i++) d_unknown[i] = derivative_of(&m->stepper, unknown[i]);
  return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
  Instance *m = c;
  if (!m || !state) return fmi2Error;
  return state_save(&m->stepper, state) ? fmi2OK : fail(m, fmi2Error);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  Instance *m = c;
  if (!m || !state) return wrong(m, "fmi2SetFMUstate with no state");
  state_restore(&m->stepper, state);
  return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
  if (!c) return fmi2Error;
  if (state) state_free(state);
  return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
  if (!c || !state || !size) return wrong(c, "fmi2SerializedFMUstateSize with no state");
  *size = STATE_SIZE;
  return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
  if (!c || !state || !bytes || size < STATE_SIZE) return wrong(c, "fmi2SerializeFMUstate with too little room");
  state_write(state, (uint8_t *)bytes);
  return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
  Instance *m = c;
  if (!m || !bytes || !state) return wrong(m, "fmi2DeSerializeFMUstate with nothing to read");
  return state_read(&m->stepper, (const uint8_t *)bytes, size, state) ? fmi2OK : fail(m, fmi2Error);
}

/* Every other function belongs to what an instance does not have: variables of other types, steps that are pending,
   interpolated inputs. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define REFERENCES fmi2Component c, const fmi2ValueReference vr[], size_t n

static fmi2Status not_real(Instance *m, size_t n) {
  if (!m) return fmi2Error;
  if (n == 0) return fmi2OK;
  refuse(&m->stepper, "model '%s' has real variables only", MODEL_NAME);
  return fail(m, fmi2Error);
}

#define NO_VARIABLES_OF(Type)                                                         \
  fmi2Status fmi2Get##Type(REFERENCES, fmi2##Type value[]) { return not_real(c, n); } \
  fmi2Status fmi2Set##Type(REFERENCES, const fmi2##Type value[]) { return not_real(c, n); }

NO_VARIABLES_OF(Integer)
NO_VARIABLES_OF(Boolean)
NO_VARIABLES_OF(String)

#define NO_STATUS_OF(Type)                                                                          \
  fmi2Status fmi2Get##Type##Status(fmi2Component c, const fmi2StatusKind kind, fmi2##Type *value) { \
    return fmi2Discard;                                                                             \
  }

NO_STATUS_OF(Integer)
NO_STATUS_OF(String)

#define NOT_PROVIDED(name, why, ...) \
  fmi2Status name(__VA_ARGS__) { return wrong(c, #name ": " why ", so it"); }

NOT_PROVIDED(fmi2CancelStep, "steps are never pending", fmi2Component c)
NOT_PROVIDED(fmi2SetRealInputDerivatives, "inputs are not interpolated", REFERENCES, const fmi2Integer order[],
             const fmi2Real value[])
NOT_PROVIDED(fmi2GetRealOutputDerivatives, "outputs have no derivatives by time", REFERENCES,
             const fmi2Integer order[], fmi2Real value[])

#if HAS_LOOPS
#include "loop.h"
#endif

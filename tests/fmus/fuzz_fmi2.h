/* What fuzz.c needs to know about FMI 2.0. */

#define N_REFERENCES N_VARIABLES
#define CALL(name) fmi2##name
#define STATE(before, after) fmi2##before##FMUstate##after
#define DESERIALIZE fmi2DeSerializeFMUstate
typedef fmi2Byte Byte;
static void ignore(void *e, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...) {
  (void)e, (void)name, (void)status, (void)category, (void)text;
}

static Instance *instantiate(const char *name, const char *guid) {
  static const fmi2CallbackFunctions callbacks = {.logger = ignore};
  return fmi2Instantiate(name, fmi2CoSimulation, guid, RESOURCES, &callbacks, 0, 1);
}

static size_t size_of(unsigned reference) { return (void)reference, 1; }
static int place_of(unsigned reference) { return reference < N_VARIABLES ? (int)reference : 0; }
static int get(Instance *m, const unsigned *vr, size_t n, double *v, size_t n_v) {
  (void)n_v;
  return fmi2GetReal(m, vr, n, v);
}

static int set(Instance *m, const unsigned *vr, size_t n, const double *v, size_t n_v) {
  (void)n_v;
  return fmi2SetReal(m, vr, n, v);
}

static int enter(Instance *m, double start) {
  int status = fmi2SetupExperiment(m, 0, 0.0, start, 0, 0.0);
  return status == OK ? (int)fmi2EnterInitializationMode(m) : status;
}

static int do_step(Instance *m, double time, double h) { return fmi2DoStep(m, time, h, 1); }
static int derive(Instance *m, const unsigned *y, size_t n_y, const unsigned *u, size_t n_u, const double *du,
                  size_t n_du, double *dy, size_t n_dy) {
  return (void)n_du, (void)n_dy, fmi2GetDirectionalDerivative(m, y, n_y, u, n_u, du, dy);
}

static void others(Instance *m) {
  fmi2Status status;
  double time;
  int flag;
  fmi2GetInteger(m, NULL, 1, NULL), fmi2SetInteger(m, NULL, 1, NULL), fmi2GetBoolean(m, NULL, 1, NULL);
  fmi2SetBoolean(m, NULL, 1, NULL);
  fmi2GetString(m, NULL, 1, NULL), fmi2SetString(m, NULL, 1, NULL), fmi2GetString(m, NULL, 0, NULL), fmi2CancelStep(m);
  fmi2SetRealInputDerivatives(m, NULL, 1, NULL, NULL), fmi2GetRealOutputDerivatives(m, NULL, 1, NULL, NULL);
  fmi2GetStatus(m, fmi2DoStepStatus, &status), fmi2GetStatus(m, fmi2PendingStatus, &status);
  fmi2GetStatus(m, fmi2DoStepStatus, NULL);
  fmi2GetRealStatus(m, fmi2LastSuccessfulTime, &time), fmi2GetRealStatus(m, fmi2LastSuccessfulTime, NULL);
  fmi2GetBooleanStatus(m, fmi2Terminated, &flag), fmi2GetIntegerStatus(m, fmi2Terminated, NULL);
  fmi2GetStringStatus(m, fmi2Terminated, NULL);
  fmi2SetDebugLogging(m, 1, 1, NULL);
}

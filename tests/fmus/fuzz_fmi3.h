/* What fuzz.c needs to know about FMI 3.0. */

#define N_REFERENCES (N_ARRAYS + 1)
#define CALL(name) fmi3##name
#define STATE(before, after) fmi3##before##FMUState##after
#define DESERIALIZE fmi3DeserializeFMUState
typedef fmi3Byte Byte;
static void ignore(void *e, fmi3Status status, fmi3String category, fmi3String text) {
  (void)e, (void)status, (void)category, (void)text;
}

static Instance *instantiate(const char *name, const char *token) {
  return fmi3InstantiateCoSimulation(name, token, RESOURCES, 0, 1, 0, 0, NULL, 0, NULL, ignore, NULL);
}

static size_t size_of(unsigned reference) {
  return reference >= 1 && reference <= N_ARRAYS ? (size_t)ARRAYS[reference - 1].size : 1;
}

static int place_of(unsigned reference) {
  return reference >= 1 && reference <= N_ARRAYS ? ARRAYS[reference - 1].first : 0;
}

static int get(Instance *m, const unsigned *vr, size_t n, double *v, size_t n_v) {
  return fmi3GetFloat64(m, vr, n, v, n_v);
}

static int set(Instance *m, const unsigned *vr, size_t n, const double *v, size_t n_v) {
  return fmi3SetFloat64(m, vr, n, v, n_v);
}

static int enter(Instance *m, double start) { return fmi3EnterInitializationMode(m, 0, 0.0, start, 0, 0.0); }
static int do_step(Instance *m, double time, double h) {
  bool event, terminate, early;
  double last;
  return fmi3DoStep(m, time, h, 1, &event, &terminate, &early, &last);
}

static int derive(Instance *m, const unsigned *y, size_t n_y, const unsigned *u, size_t n_u, const double *du,
                  size_t n_du, double *dy, size_t n_dy) {
  return fmi3GetDirectionalDerivative(m, y, n_y, u, n_u, du, n_du, dy, n_dy);
}

static void others(Instance *m) {
  fmi3GetInt32(m, NULL, 1, NULL, 1), fmi3SetInt32(m, NULL, 1, NULL, 1), fmi3GetString(m, NULL, 1, NULL, 1);
  fmi3SetString(m, NULL, 1, NULL, 1);
  fmi3GetBinary(m, NULL, 1, NULL, NULL, 1), fmi3SetBinary(m, NULL, 1, NULL, NULL, 1), fmi3GetClock(m, NULL, 1, NULL);
  fmi3SetClock(m, NULL, 0, NULL);
  fmi3EnterEventMode(m), fmi3EnterStepMode(m), fmi3EnterConfigurationMode(m), fmi3ExitConfigurationMode(m);
  fmi3EnterContinuousTimeMode(m);
  fmi3UpdateDiscreteStates(m, NULL, NULL, NULL, NULL, NULL, NULL), fmi3EvaluateDiscreteStates(m);
  fmi3GetNumberOfContinuousStates(m, NULL);
  fmi3GetAdjointDerivative(m, NULL, 1, NULL, 1, NULL, 1, NULL, 1);
  fmi3GetOutputDerivatives(m, NULL, 1, NULL, NULL, 1), fmi3SetTime(m, 0.0);
  fmi3GetVariableDependencies(m, 0, NULL, NULL, NULL, NULL, 0), fmi3ActivateModelPartition(m, 0, 0.0);
  fmi3SetDebugLogging(m, 1, 1, NULL);
}

/* The functions of FMI 3.0 that the test FMUs do not offer; each returns fmi3Error (3), or NULL. */
#define NO(name, type, value) __attribute__((visibility("default"), weak)) type name(void) { return value; }
#define ERROR(name) NO(name, int, 3)

/* No clock ever ticks. */
__attribute__((visibility("default"))) int fmi3GetClock(void *c, const unsigned r[], unsigned long n, _Bool v[]) {
  for (unsigned long i = 0; i < n; i++) v[i] = 0;
  return c && r ? 0 : 3;
}

NO(fmi3InstantiateScheduledExecution, void *, 0)
ERROR(fmi3SetClock) ERROR(fmi3GetNumberOfVariableDependencies) ERROR(fmi3GetVariableDependencies)
ERROR(fmi3GetDirectionalDerivative) ERROR(fmi3GetAdjointDerivative) ERROR(fmi3GetIntervalDecimal)
ERROR(fmi3GetIntervalFraction) ERROR(fmi3GetShiftDecimal) ERROR(fmi3GetShiftFraction) ERROR(fmi3SetIntervalDecimal)
ERROR(fmi3SetIntervalFraction) ERROR(fmi3SetShiftDecimal) ERROR(fmi3SetShiftFraction) ERROR(fmi3EvaluateDiscreteStates)
ERROR(fmi3GetOutputDerivatives) ERROR(fmi3ActivateModelPartition)

/* Run one instance of a step model: the C twin of gossamer_models/stepper.py.

   Symbols: x state, u inputs, p parameters, y results (outputs, then locals), h step [s]:

       init(u, p)       -> (x, y)        once, when initialization ends
       step(x, u, p, h) -> (x_next, y)   u holds at the end of the step

   model.h holds the table of variables, functions.h the C code that CasADi generated from the model's expressions. A
   Stepper holds all the memory it needs; nothing that changes is shared, so instances may run in different threads. A function that
   returns a bool either does what it says and returns true, or writes a message that says why not, returns false and
   leaves the state as it was. Everything is static or carries the model's name, so that sources of several FMUs can be
   linked into one program; define FMI2_FUNCTION_PREFIX or FMI3_FUNCTION_PREFIX for that, as the standard says. */

/* the same numbers everywhere: no fused multiply-add */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
  const char *name, *unit;
  double start, minimum, maximum; /* no limit: the largest finite number, so that infinities are out of range */
  const char *advice;             /* where a result leaves its range */
} Variable;

typedef struct {
  int first, size; /* place of its first element in the table, number of elements */
} Array;

#include "model.h"

#define CASADI_SYMBOL_EXPORT static
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-function"
#endif
static uint32_t crc32(const uint8_t *bytes, size_t size) {
  uint32_t crc = ~0u;
  for (size_t i = 0; i < size; i++) {
    crc ^= bytes[i];
    for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (0xEDB88320u & -(crc & 1));
  }
  return ~crc;
}

#if HAS_TABLES
#include "tables.h"
#else
static const double *const tables = NULL;
static const char *tables_open(const char *resources) { return (void)resources, NULL; }
static void tables_close(void) {}
#endif
#if HAS_LOOPS
static int (*run_loop)(int which, const double **arg, double **res); /* chosen in loop.h */
#endif
#include "functions.h"

#ifndef MODEL_FAILURE
#define MODEL_FAILURE(s) NULL /* why init or step failed, where they say it (processor.h) */
#define MODEL_RESOURCES(s, place) ((void)0) /* takes note of where the resources of an instance are */
#define MODEL_END(s) ((void)0)
#define MODEL_CAN_BE_SAVED true
#endif

#define MAX_INTERNAL_STEPS 100000.0
#define FIRST_INPUT N_PARAMETERS
#define FIRST_RESULT (N_PARAMETERS + N_INPUTS)

typedef enum { INSTANTIATED, INITIALIZING, RUNNING, TERMINATED } Mode;

/* Everything that an instance remembers, and so what a saved state holds. */
typedef struct {
  int64_t mode;
  double time;         /* [s], for hosts that read it; the model itself is autonomous */
  double last_step;    /* [s], 0 before the first */
  double limit_before; /* [s], largest internal step when the last step began, for derivatives */
  double values[N_VARIABLES]; /* parameters, inputs, outputs, locals */
  double x[N_STATES];
  double x_before[N_STATES]; /* at the start of the last step, for derivatives */
} State;

typedef struct {
  State state;
  bool checked;       /* the inputs are known to be in range */
  bool results_known; /* while initializing: results belong to the present parameters and inputs */
  bool warned[N_RESULTS]; /* results that have left their range */
  double x[N_STATES], dx[N_STATES];
  double next[N_STATES + N_RESULTS], d_next[N_STATES + N_RESULTS]; /* x and y as one, as functions write them */
  double du[N_INPUTS];
  const double *arg[SIZE_ARG];
  double *res[SIZE_RES];
  casadi_int iw[SIZE_IW];
  double w[SIZE_W];
  char message[640];
} Stepper;

static bool refuse(Stepper *s, const char *format, ...) {
  va_list values;
  va_start(values, format);
  vsnprintf(s->message, sizeof s->message, format, values);
  va_end(values);
  return false;
}

/* Refuse a call that the present mode does not allow. */
static bool wrong_call(Stepper *s, const char *call) {
  static const char *const when[] = {
      "before initialization of model '" MODEL_NAME "'",
      "while model '" MODEL_NAME "' is in initialization mode",
      "while model '" MODEL_NAME "' is running",
      "after model '" MODEL_NAME "' was terminated",
  };
  return refuse(s, "%s is not allowed %s", call, when[s->state.mode]);
}

static void stepper_reset(Stepper *s) {
  MODEL_END(s);
  memset(&s->state, 0, sizeof s->state);
  for (int i = 0; i < N_VARIABLES; i++) s->state.values[i] = VARIABLES[i].start;
  s->checked = s->results_known = false;
  memset(s->warned, 0, sizeof s->warned);
}

static bool stepper_may_set(Stepper *s, size_t index) {
  if (index >= FIRST_RESULT) {
    return refuse(s, "'%s' is a result of model '%s' and cannot be set", VARIABLES[index].name, MODEL_NAME);
  }
  if (index < FIRST_INPUT && s->state.mode == RUNNING) {
    return refuse(s, "parameter '%s' is fixed once model '%s' runs. Reset it, then set it.", VARIABLES[index].name,
                  MODEL_NAME);
  }
  return true;
}

static bool is_within(const Stepper *s, int index) {
  double value = s->state.values[index];
  return value >= VARIABLES[index].minimum && value <= VARIABLES[index].maximum;
}

/* Write what a variable is and, after the demand, the range that it should be in. */
static bool out_of_range(Stepper *s, const char *kind, int index, const char *demand, const char *advice) {
  const Variable *v = &VARIABLES[index];
  bool has_unit = strcmp(v->unit, "1") != 0;
  return refuse(s, "%s'%s' of model '%s' is %g%s%s; %s from %g to %g. %s%s%s", kind, v->name, MODEL_NAME,
                s->state.values[index], has_unit ? " " : "", has_unit ? v->unit : "", demand,
                v->minimum == -DBL_MAX ? -HUGE_VAL : v->minimum, v->maximum == DBL_MAX ? HUGE_VAL : v->maximum,
                v->advice, *v->advice ? " " : "", advice);
}

/* A value that is not finite or out of range is refused by the step that would use it, so it may still be corrected. */
static void stepper_set(Stepper *s, size_t index, double value) {
  s->state.values[index] = value;
  s->checked = s->results_known = false;
}

static bool in_range(Stepper *s, int begin, int end) {
  for (int i = begin; i < end; i++) {
    if (!is_within(s, i)) {
      return out_of_range(s, i < FIRST_INPUT ? "parameter " : "input ", i, "it must be a finite number",
                          "Correct it and call again.");
    }
  }
  return true;
}

/* Write a warning of a result that is out of its range for the first time, if there is one. */
static bool stepper_warns(Stepper *s) {
  for (int i = 0; i < N_RESULTS; i++) {
    if (!s->warned[i] && !is_within(s, FIRST_RESULT + i)) {
      out_of_range(s, "", FIRST_RESULT + i, "the model is valid", "The run goes on; this is logged once.");
      return s->warned[i] = true;
    }
  }
  return false;
}

static bool all_finite(Stepper *s, const double *results, const char *what) {
  const int residual = RESIDUAL;
  const char *why = MODEL_FAILURE(s);
  if (why) return refuse(s, "%s", why);
  for (int i = 0; i < N_STATES + N_RESULTS; i++) {
    if (!isfinite(results[i])) {
      char stopped[80] = "";
      if (residual >= 0 && results[residual] > 1.0) {
        snprintf(stopped, sizeof stopped, " It stopped where forces are %.3g times those that are accepted.", results[residual]);
      }
      return refuse(s, "%s of model '%s' gave a result that is not finite.%s %s", what, MODEL_NAME, stopped, MODEL_ADVICE);
    }
  }
  return true;
}

/* Initial state and results from parameters and inputs. May be repeated: it depends on nothing else. */
static bool stepper_initialize(Stepper *s) {
  double *values = s->state.values;
  if (!in_range(s, 0, FIRST_RESULT)) return false;
  s->arg[0] = values + FIRST_INPUT;
  s->arg[1] = values;
  if (HAS_LOOPS) s->arg[2] = tables;
  s->res[0] = s->next;
  s->res[1] = s->next + N_STATES;
  if (init(s->arg, s->res, s->iw, s->w, 0)) s->next[0] = NAN;
  if (!all_finite(s, s->next, "initialization")) return false;
  memcpy(s->state.x, s->next, sizeof s->state.x);
  memcpy(values + FIRST_RESULT, s->next + N_STATES, N_RESULTS * sizeof(double));
  s->checked = s->results_known = true;
  return true;
}

/* Make a value ready to be read: while initializing, a result is computed when it is read. */
static bool stepper_may_get(Stepper *s, size_t index) {
  if (index < FIRST_RESULT || s->state.mode >= RUNNING || s->results_known) return true;
  if (s->state.mode == INSTANTIATED) return wrong_call(s, "reading a result");
  return stepper_initialize(s);
}

/* Count the equal internal steps, none longer than limit [s], that make up h [s]. */
static bool divide(Stepper *s, double h, double limit, double *count) {
  double ratio = h / limit * (1.0 - 1e-12);
  if (!(ratio <= MAX_INTERNAL_STEPS)) {
    return refuse(s,
                  "a step of %g s needs %.3g internal steps of %.3e s of model '%s', more than %g. "
                  "Use shorter communication steps.",
                  h, ratio, limit, MODEL_NAME, MAX_INTERNAL_STEPS);
  }
  *count = ratio > 1.0 ? ceil(ratio) : 1.0;
  return true;
}

/* Carry s->x over h [s] in internal steps, the first no longer than limit [s], and leave the end in s->next. With the
   derivative, carry s->dx along for inputs that change by s->du, and leave the end of that in s->d_next. */
static bool integrate(Stepper *s, double h, double limit, bool with_derivative) {
  (void)with_derivative;
  const double *values = s->state.values;
  double remaining = 1.0, part;
  if (!divide(s, h, limit, &remaining)) return false;
  part = h / remaining;
  memset(s->x + N_STATES - N_RESTARTED, 0, N_RESTARTED * sizeof(double)); /* what counts from the beginning of the step */
  memset(s->dx + N_STATES - N_RESTARTED, 0, N_RESTARTED * sizeof(double));
  for (;;) {
    s->arg[0] = s->x;
    s->arg[1] = values + FIRST_INPUT;
    s->arg[2] = values;
    s->arg[3] = &part;
#if HAS_DERIVATIVES
    if (with_derivative) {
      s->arg[4] = s->dx;
      s->arg[5] = s->du;
      s->res[0] = s->d_next;
      s->res[1] = s->d_next + N_STATES;
      if (derivative(s->arg, s->res, s->iw, s->w, 0)) s->d_next[0] = NAN;
      if (!all_finite(s, s->d_next, "the derivative")) return false;
      memcpy(s->dx, s->d_next, sizeof s->dx);
      s->arg[0] = s->x; /* generated code may use arg as work space */
      s->arg[1] = values + FIRST_INPUT;
      s->arg[2] = values;
      s->arg[3] = &part;
    }
#endif
    if (HAS_LOOPS) s->arg[4] = tables;
    s->res[0] = s->next;
    s->res[1] = s->next + N_STATES;
    if (step(s->arg, s->res, s->iw, s->w, 0)) s->next[0] = NAN;
    if (!all_finite(s, s->next, "a step")) return false;
    memcpy(s->x, s->next, sizeof s->x);
    if (--remaining == 0.0) return true;
    if (STEP_LIMIT >= FIRST_RESULT) {
      limit = s->next[N_STATES + STEP_LIMIT - FIRST_RESULT];
      if (part > limit) {
        double rest = part * remaining;
        if (!divide(s, rest, limit, &remaining)) return false;
        part = rest / remaining;
      }
    }
  }
}

/* Advance by h seconds with the inputs as set. */
static bool stepper_step(Stepper *s, double h) {
  double limit;
  if (!(isfinite(h) && h > 0.0)) {
    return refuse(s, "the step of model '%s' must be a positive time [s], not %g", MODEL_NAME, h);
  }
  if (!s->checked && !in_range(s, FIRST_INPUT, FIRST_RESULT)) return false;
  s->checked = true;
  limit = STEP_LIMIT < 0 ? HUGE_VAL : s->state.values[STEP_LIMIT];
  memcpy(s->x, s->state.x, sizeof s->x);
  if (!integrate(s, h, limit, false)) return false;
  memcpy(s->state.x_before, s->state.x, sizeof s->state.x);
  memcpy(s->state.x, s->next, sizeof s->state.x);
  memcpy(s->state.values + FIRST_RESULT, s->next + N_STATES, N_RESULTS * sizeof(double));
  s->state.last_step = h;
  s->state.limit_before = limit;
  return true;
}

/* Let an input change at the given rate in the derivative that is taken next, beside those that change already. */
static bool stepper_seed(Stepper *s, size_t index, double rate) {
  if (index < FIRST_INPUT || index >= FIRST_RESULT) {
    return refuse(s, "model '%s' has derivatives by its inputs only, and '%s' is no input", MODEL_NAME,
                  VARIABLES[index].name);
  }
  s->du[index - FIRST_INPUT] += rate;
  return true;
}

/* Change of all results (s->d_next + N_STATES) with the inputs (s->du) over the last step, taken again from its
   beginning with the inputs as they stand; before the first step, change of the initial results. Leaves the state
   alone. */
static bool stepper_derivative(Stepper *s) {
#if !HAS_DERIVATIVES
  return refuse(s, "model '%s' has no derivatives, as its description says", MODEL_NAME);
#else
  if (s->state.mode == INSTANTIATED) return wrong_call(s, "taking a derivative");
  if (!in_range(s, 0, FIRST_RESULT)) return false;
  if (s->state.last_step == 0.0) {
    s->arg[0] = s->state.values + FIRST_INPUT;
    s->arg[1] = s->state.values;
    s->arg[2] = s->du;
    s->res[0] = s->d_next + N_STATES;
    memset(s->d_next, 0, sizeof s->d_next);
    if (initial_derivative(s->arg, s->res, s->iw, s->w, 0)) s->d_next[0] = NAN;
    return all_finite(s, s->d_next, "the derivative");
  }
  memcpy(s->x, s->state.x_before, sizeof s->x);
  memset(s->dx, 0, sizeof s->dx);
  return integrate(s, s->state.last_step, s->state.limit_before, true);
#endif
}

/* The derivative of one variable, after stepper_derivative. */
static double derivative_of(const Stepper *s, size_t index) {
  if (index >= FIRST_RESULT) return s->d_next[N_STATES + index - FIRST_RESULT];
  return index >= FIRST_INPUT ? s->du[index - FIRST_INPUT] : 0.0;
}

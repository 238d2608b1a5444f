/* Drive two instances of an FMU with the same random calls, but keep from the second what the first refuses: a refused
   call must leave no trace. Compiled together with the sources of the FMU:

       cc -DFMI=2 '-DRESOURCES="resources"' -I sources -I headers fuzz.c -lm -pthread && ./a.out CALLS SEED THREADS

   Prints, for each thread, a checksum of all it saw and how many steps were done and how many calls refused. */

#define OK 0
#define DISCARD 2
#define ERROR 3

#if FMI == 2
#include "fmi2.c"
#include "fuzz_fmi2.h"
#else
#include "fmi3.c"
#include "fuzz_fmi3.h"
#endif
#include <pthread.h>

#define SLOTS 8
#define REQUIRE(condition)                                                                                   \
  do {                                                                                                       \
    if (!(condition)) {                                                                                      \
      fprintf(stderr, "line %d: %s after '%s'\n", __LINE__, #condition, f->a ? f->a->stepper.message : ""); \
      abort();                                                                                               \
    }                                                                                                        \
  } while (0)

typedef struct {
  Instance *a, *b; /* b never sees what a refuses */
  void *saved[SLOTS];
  uint64_t seed;
  uint32_t seen;
  long steps, refused;
} Fuzz;

/* ---- random numbers ---- */

static uint64_t below(Fuzz *f, uint64_t n) { /* splitmix64 */
  uint64_t z = f->seed += 0x9E3779B97F4A7C15u;
  z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
  z = (z ^ z >> 27) * 0x94D049BB133111EBu;
  return (z ^ z >> 31) % n;
}

static double odd_number(Fuzz *f) {
  static const double numbers[] = {0.0,   -0.0,   1.0,     -1.0, 1e-310,   -5e-324,
                                   1e308, -1e308, DBL_MIN, NAN,  HUGE_VAL, -HUGE_VAL};
  return numbers[below(f, sizeof numbers / sizeof *numbers)];
}

/* Mostly close to the start value, sometimes a limit, sometimes anything. */
static double value_for(Fuzz *f, int place) {
  const Variable *v = &VARIABLES[place];
  uint64_t kind = below(f, 40);
  if (kind == 0) return odd_number(f);
  if (kind == 1) return v->minimum;
  if (kind == 2) return v->maximum;
  double value = v->start + (v->start == 0.0 ? 1e-3 : 0.02 * v->start) * ((double)below(f, 1001) / 1000.0);
  return fmin(fmax(value, v->minimum), v->maximum);
}

static unsigned reference(Fuzz *f) {
  return below(f, 30) ? (unsigned)below(f, N_REFERENCES) : (unsigned)below(f, 1ull << 32);
}

/* ---- calls ---- */

static bool accepted(Fuzz *f, int status) {
  REQUIRE(status == OK || status == DISCARD || status == ERROR);
  f->refused += status != OK;
  return status == OK;
}

static void saw(Fuzz *f, const double *values, size_t n) {
  f->seen = f->seen * 31 + crc32((const uint8_t *)values, n * sizeof *values);
}

/* Choose up to three variables; return how many values they have. */
static size_t choose(Fuzz *f, unsigned vr[3], size_t *n) {
  size_t n_values = 0;
  *n = below(f, 4);
  for (size_t i = 0; i < *n; i++) n_values += size_of(vr[i] = reference(f));
  return n_values;
}

/* Exactly as large as needed, so that a sanitizer sees what goes beyond. */
static double *room(size_t n) { return calloc(n ? n : 1, sizeof(double)); }

static void random_get(Fuzz *f) {
  unsigned vr[3];
  size_t n, n_values = choose(f, vr, &n), claimed = below(f, 20) ? n_values : below(f, n_values + 1);
  double *values = room(n_values), *same = room(n_values);
  if (accepted(f, get(f->a, vr, n, values, claimed))) {
    REQUIRE(get(f->b, vr, n, same, claimed) == OK);
    REQUIRE(memcmp(values, same, n_values * sizeof *values) == 0);
    saw(f, values, n_values);
  }
  free(values), free(same);
}

static void random_set(Fuzz *f) {
  unsigned vr[3];
  size_t n, n_values = choose(f, vr, &n), claimed = below(f, 20) ? n_values : below(f, n_values + 1), k = 0;
  double *values = room(n_values);
  for (size_t i = 0; i < n; i++) {
    for (size_t j = 0; j < size_of(vr[i]); j++) values[k++] = value_for(f, place_of(vr[i]) + (int)j);
  }
  if (accepted(f, set(f->a, vr, n, values, claimed))) REQUIRE(set(f->b, vr, n, values, claimed) == OK);
  free(values);
}

/* Give all inputs, and parameters where they may be set, good values again. */
static void repair(Fuzz *f) {
  for (unsigned i = 0; i < N_REFERENCES; i++) {
    double *values = room(size_of(i));
    int place = place_of(i);
    for (size_t k = 0; k < size_of(i); k++) values[k] = VARIABLES[place + (int)k].start;
    if (place < FIRST_RESULT && accepted(f, set(f->a, &i, 1, values, size_of(i)))) {
      REQUIRE(set(f->b, &i, 1, values, size_of(i)) == OK);
    }
    free(values);
  }
}

static void random_step(Fuzz *f) {
  static const double steps[] = {1e-4, 3e-4, 3e-4, 1e-3, 2e-3};
  double h = below(f, 20) ? steps[below(f, 5)] : odd_number(f), time = f->a->stepper.state.time;
  if (!accepted(f, do_step(f->a, time, h))) return;
  REQUIRE(do_step(f->b, time, h) == OK);
  f->steps++;
  for (int i = FIRST_RESULT; i < N_VARIABLES; i++) REQUIRE(isfinite(f->a->stepper.state.values[i]));
  for (int i = 0; i < N_STATES; i++) REQUIRE(isfinite(f->a->stepper.state.x[i]));
}

static int begin(Instance *m) { return enter(m, 0.5); }
static int leave(Instance *m) { return CALL(ExitInitializationMode)(m); }
static int reset(Instance *m) { return CALL(Reset)(m); }
static int terminate(Instance *m) { return CALL(Terminate)(m); }

static void both(Fuzz *f, int (*call)(Instance *)) {
  if (accepted(f, call(f->a))) REQUIRE(call(f->b) == OK);
}

static void random_mode(Fuzz *f) {
  static int (*const calls[])(Instance *) = {begin, begin, leave, leave, reset, terminate};
  both(f, calls[below(f, 6)]);
}

static void start_again(Fuzz *f) { both(f, reset), both(f, begin), both(f, leave); }

static void random_state(Fuzz *f) {
  void **slot = &f->saved[below(f, SLOTS)];
  if (below(f, 2)) {
    REQUIRE(STATE(Get, )(below(f, 2) ? f->a : f->b, slot) == OK);
  } else if (accepted(f, STATE(Set, )(f->a, *slot))) {
    REQUIRE(STATE(Set, )(f->b, *slot) == OK);
  }
  if (below(f, 8) == 0) REQUIRE(STATE(Free, )(f->a, slot) == OK && !*slot);
}

/* Serialize, spoil in one of many ways, and read again. */
static void random_bytes(Fuzz *f) {
  void *state = NULL, *copy = NULL;
  size_t size = 0, part;
  uint64_t spoil = below(f, 7);
  REQUIRE(STATE(Get, )(f->a, &state) == OK && STATE(Serialized, Size)(f->a, state, &size) == OK);
  Byte *bytes = malloc(size);
  REQUIRE(STATE(Serialize, )(f->a, state, bytes, size) == OK);
  REQUIRE(STATE(Serialize, )(f->a, state, bytes, size - 1) != OK);
  part = spoil == 0 ? below(f, size) : size;
  if (spoil == 1) ((uint8_t *)bytes)[below(f, size)] ^= (uint8_t)(1u << below(f, 8));
  if (spoil == 2) ((State *)state)->mode = (int64_t)below(f, 5);
  if (spoil == 3) ((State *)state)->values[below(f, N_VARIABLES)] = odd_number(f);
  if (spoil == 4) ((State *)state)->x[below(f, N_STATES)] = odd_number(f);
  if (spoil >= 2 && spoil <= 4) state_write(state, (uint8_t *)bytes); /* forged, with a checksum that fits */
  Byte *given = malloc(part ? part : 1);
  memcpy(given, bytes, part);
  int status = DESERIALIZE(f->a, given, part, &copy);
  REQUIRE(status == (spoil < 2 || (spoil == 2 && ((State *)state)->mode > TERMINATED) ? ERROR : OK));
  if (status == OK) {
    REQUIRE(memcmp(copy, state, sizeof(State)) == 0);
    REQUIRE(STATE(Set, )(f->a, copy) == OK && STATE(Set, )(f->b, copy) == OK);
  }
  free(bytes), free(given);
  STATE(Free, )(f->a, &state), STATE(Free, )(f->a, &copy);
}

static void random_derivative(Fuzz *f) {
  unsigned u[3], y[3];
  size_t n_u, n_y, n_du = choose(f, u, &n_u), n_dy = choose(f, y, &n_y);
  double *du = room(n_du), *dy = room(n_dy), *same = room(n_dy);
  for (size_t i = 0; i < n_du; i++) du[i] = below(f, 10) ? 1.0 : odd_number(f);
  if (accepted(f, derive(f->a, y, n_y, u, n_u, du, n_du, dy, n_dy))) {
    REQUIRE(derive(f->b, y, n_y, u, n_u, du, n_du, same, n_dy) == OK);
    REQUIRE(memcmp(dy, same, n_dy * sizeof *dy) == 0);
  }
  free(du), free(dy), free(same);
}

/* Calls that must be refused whatever the mode, or that change nothing. */
static void hopeless(Fuzz *f) {
  unsigned vr = 1;
  double value = 0.0;
  void *state = NULL;
  size_t size;
  REQUIRE(get(f->a, NULL, 1, &value, 1) == ERROR);
  REQUIRE(get(f->a, &vr, 1, NULL, 1) == ERROR);
  REQUIRE(get(NULL, &vr, 1, &value, 1) == ERROR);
  REQUIRE(set(f->a, NULL, 1, &value, 1) == ERROR);
  REQUIRE(set(f->a, &vr, 1, NULL, 1) == ERROR);
  REQUIRE(set(NULL, &vr, 1, &value, 1) == ERROR);
  REQUIRE(enter(NULL, 0.0) == ERROR);
  REQUIRE(do_step(NULL, 0.0, 1e-3) == ERROR);
  REQUIRE(derive(NULL, &vr, 1, &vr, 1, &value, 1, &value, 1) == ERROR);
  REQUIRE(CALL(ExitInitializationMode)(NULL) == ERROR && CALL(Terminate)(NULL) == ERROR && CALL(Reset)(NULL) == ERROR);
  REQUIRE(STATE(Get, )(f->a, NULL) == ERROR);
  REQUIRE(STATE(Get, )(NULL, &state) == ERROR);
  REQUIRE(STATE(Set, )(f->a, NULL) == ERROR);
  REQUIRE(STATE(Serialized, Size)(f->a, NULL, &size) == ERROR && DESERIALIZE(f->a, NULL, 10, &state) == ERROR);
  REQUIRE(!instantiate("", MODEL_GUID));
  REQUIRE(!instantiate(NULL, MODEL_GUID));
  REQUIRE(!instantiate("x", "{no}"));
  REQUIRE(!instantiate("x", NULL));
  others(f->a), others(NULL);
  CALL(FreeInstance)(NULL);
}

static void *run(void *argument) {
  Fuzz *f = argument;
  static void (*const calls[])(Fuzz *) = {
      random_get,   random_set,   random_set,   repair,       random_mode,       start_again,
      random_state, random_state, random_bytes, random_derivative, hopeless,
  };
  long n = f->steps;
  f->steps = 0;
  f->a = instantiate("first", MODEL_GUID);
  f->b = instantiate("second", MODEL_GUID);
  for (long i = 0; i < n; i++) {
    if (below(f, 3)) random_step(f);
    else calls[below(f, sizeof calls / sizeof *calls)](f);
    REQUIRE(memcmp(&f->a->stepper.state, &f->b->stepper.state, sizeof(State)) == 0);
    saw(f, f->a->stepper.state.values, N_VARIABLES);
  }
  for (int i = 0; i < SLOTS; i++) STATE(Free, )(f->a, &f->saved[i]);
  CALL(FreeInstance)(f->a);
  CALL(FreeInstance)(f->b);
  return NULL;
}

int main(int count, char **arguments) {
  Fuzz fuzz[16] = {0};
  pthread_t threads[16];
  int n = count > 3 ? atoi(arguments[3]) : 0;
  if (n < 1 || n > 16) return 2;
  for (int i = 0; i < n; i++) {
    fuzz[i].seed = strtoull(arguments[2], NULL, 10) + (uint64_t)i;
    fuzz[i].steps = atol(arguments[1]);
    if (n == 1) run(&fuzz[i]);
    else if (pthread_create(&threads[i], NULL, run, &fuzz[i])) return 3;
  }
  for (int i = 0; i < n; i++) {
    if (n > 1) pthread_join(threads[i], NULL);
    printf("%08x %ld %ld\n", (unsigned)fuzz[i].seen, fuzz[i].steps, fuzz[i].refused);
  }
  return 0;
}

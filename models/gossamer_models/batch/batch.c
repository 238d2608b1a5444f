/* Advance many cases of one step model, eight at once: the time loop of gossamer_models/batch.

   Symbols: x state, u inputs, p parameters, y recorded results and, last, the step limit where it is a result, h step [s]:

       init(u, p)       -> (x, y)        once, when a run begins without a saved state
       init(u, p, q)    -> (x, y)        of a model whose displacements at rest q are found elsewhere: they begin x then
       step(x, u, p, h) -> (x_next, y)   u holds at the end of the step

   sizes.h holds the sizes of the model, functions.h the C code of init and step with lanes as numbers, loops.h the tables of
   its mesh and the loops over them. A communication
   step is divided in each lane as gossamer_models/stepper.py divides it; a lane that has finished keeps its numbers while
   the others go on. A lane whose state or results are not finite, or that needs too many internal steps, becomes NaN and
   stays so. Nothing is global but constants, so blocks may run in different threads. */

#include "lanes.h"
#include "sizes.h"

#define casadi_real lanes
#define casadi_int int64_t
#define CASADI_SYMBOL_EXPORT static
#define CASADI_CODEGEN_PREFIX
#define CODEGEN_PREFIX kernel_
static int run_loop(int which, const lanes **arg, lanes **res) __attribute__((noinline)); /* its code is large */
#include "functions.h"
#include "loop.h"
#include "loops.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#define MAX_INTERNAL_STEPS 100000.0

/* An input that varies in time. */
typedef struct {
  int64_t input;        /* place in u */
  int64_t stride;       /* from one case to the next; 0 if all cases have the same */
  const double *values; /* at the end of each step */
} Record;

/* One run. Arrays hold one row per case. */
typedef struct {
  int64_t cases, steps, every, n_records, starts; /* starts: 1 to call init, 0 to go on from x and y */
  double h;
  const Record *records;
  const double *p;
  double *u, *x, *y; /* at the beginning, and in the end of the run */
  double *initial;   /* y at the beginning */
  double *results;   /* (cases, N_RESULTS, steps / every) */
} Run;

typedef struct {
  lanes p[N_P], u[N_U], x[2][N_X], y[2][N_Y];
  lanes w[SIZE_W];
  casadi_int iw[SIZE_IW];
  const lanes *arg[SIZE_ARG];
  lanes *res[SIZE_RES];
} Block;

static void load(lanes *to, const double *from, int n, const int64_t *row) {
  for (int l = 0; l < LANES; l++) {
    for (int i = 0; i < n; i++) to[i][l] = from[row[l] * n + i];
  }
}

static void store(double *to, const lanes *from, int n, const int64_t *row, int used) {
  for (int l = 0; l < used; l++) {
    for (int i = 0; i < n; i++) to[row[l] * n + i] = from[i][l];
  }
}

static mask all_finite(const lanes *x, const lanes *y) {
  mask m = (mask)(-1);
  for (int i = 0; i < N_STATES; i++) m &= is_finite(x[i]);
  for (int i = 0; i < N_CHECKED; i++) m &= is_finite(y[i]);
  return m;
}

static void forget(lanes *x, lanes *y, mask lost) {
  for (int i = 0; i < N_STATES; i++) x[i] = where(lost, NAN, x[i]);
  for (int i = 0; i < N_Y; i++) y[i] = where(lost, NAN, y[i]);
}

static lanes limit_of(const Block *b, const lanes *y) {
  if (LIMIT_RESULT >= 0) return y[LIMIT_RESULT];
  if (LIMIT_INPUT >= 0) return b->u[LIMIT_INPUT];
  if (LIMIT_PARAMETER >= 0) return b->p[LIMIT_PARAMETER];
  return INFINITY;
}

/* Count the equal internal steps, none longer than limit [s], that make up h [s]; NaN where they are too many. */
static lanes divide(lanes h, lanes limit) {
  lanes ratio = h / limit * (1.0 - 1e-12);
  return where(ratio <= MAX_INTERNAL_STEPS, fmax(ceil(ratio), (lanes)(1.0)), NAN);
}

/* Carry all lanes over h [s]; returns which of x[2] and y[2] holds the end. Lost lanes are not a number there. */
static int integrate(Block *b, int now, double h) {
  lanes remaining = divide(h, limit_of(b, b->y[now]));
  mask lost = ~(all_finite(b->x[now], b->y[now]) & is_finite(remaining));
  lanes part = where(lost, h, h / remaining);
  mask active = ~lost;
  for (int i = N_STATES - N_RESTARTED; i < N_STATES; i++) b->x[now][i] = (lanes)(0.0); /* counts from here */
  while (__builtin_reduce_or(active)) {
    int next = 1 - now;
    b->arg[0] = b->x[now];
    b->arg[1] = b->u;
    b->arg[2] = b->p;
    b->arg[3] = &part;
    b->res[0] = b->x[next];
    b->res[1] = b->y[next];
    mask well = step(b->arg, b->res, b->iw, b->w, 0) ? (mask)(0) : all_finite(b->x[next], b->y[next]);
    if (!__builtin_reduce_and(active)) { /* lanes that have finished keep their numbers */
      for (int i = 0; i < N_STATES; i++) b->x[next][i] = where(active, b->x[next][i], b->x[now][i]);
      for (int i = 0; i < N_Y; i++) b->y[next][i] = where(active, b->y[next][i], b->y[now][i]);
    }
    now = next;
    remaining -= where(active, 1.0, 0.0);
    lost |= active & ~well;
    active &= well & (remaining != 0.0);
    if (LIMIT_RESULT >= 0) {
      lanes limit = b->y[now][LIMIT_RESULT], rest = part * remaining, count = divide(rest, limit);
      mask shorter = active & (part > limit);
      lost |= shorter & ~is_finite(count);
      active &= ~lost;
      shorter &= active;
      remaining = where(shorter, count, remaining);
      part = where(shorter, rest / count, part);
    }
  }
  if (__builtin_reduce_or(lost)) forget(b->x[now], b->y[now], lost);
  return now;
}

static void run_block(const Run *run, Block *b, int64_t first) {
  int64_t row[LANES], recorded = run->steps / run->every;
  int used = run->cases - first < LANES ? (int)(run->cases - first) : LANES;
  int now = 0;
  for (int l = 0; l < LANES; l++) row[l] = first + (l < used ? l : used - 1); /* the last case fills the block */
  load(b->p, run->p, N_PARAMETERS, row);
  load(b->u, run->u, N_INPUTS, row);
  if (run->starts) {
    load(b->x[1 - now], run->x, N_STATES, row);
    b->arg[0] = b->u;
    b->arg[1] = b->p;
    b->arg[2] = b->x[1 - now];
    b->res[0] = b->x[now];
    b->res[1] = b->y[now];
    mask well = init(b->arg, b->res, b->iw, b->w, 0) ? (mask)(0) : all_finite(b->x[now], b->y[now]);
    forget(b->x[now], b->y[now], ~well);
  } else {
    load(b->x[now], run->x, N_STATES, row);
    load(b->y[now], run->y, N_Y, row);
  }
  store(run->initial, b->y[now], N_Y, row, used);
  for (int64_t k = 0; k < run->steps; k++) {
    for (int64_t i = 0; i < run->n_records; i++) {
      const Record *r = &run->records[i];
      for (int l = 0; l < LANES; l++) b->u[r->input][l] = r->values[row[l] * r->stride + k];
    }
    now = integrate(b, now, run->h);
    if ((k + 1) % run->every == 0) {
      int64_t column = (k + 1) / run->every - 1;
      for (int l = 0; l < used; l++) {
        double *results = run->results + row[l] * N_RESULTS * recorded + column;
        for (int i = 0; i < N_RESULTS; i++) results[i * recorded] = b->y[now][i][l];
      }
    }
  }
  store(run->u, b->u, N_INPUTS, row, used);
  store(run->x, b->x[now], N_STATES, row, used);
  store(run->y, b->y[now], N_Y, row, used);
}

/* Bytes of memory that run_blocks needs, of any alignment. */
EXPORT int64_t memory_size(void) { return sizeof(Block) + sizeof(lanes); }

/* Run the blocks of eight cases from number begin up to, not including, number end. */
EXPORT void run_blocks(const Run *run, char *memory, int64_t begin, int64_t end) {
  uintptr_t address = (uintptr_t)memory + sizeof(lanes) - 1;
  Block *b = (Block *)(address - address % sizeof(lanes));
  for (int64_t i = begin; i < end; i++) run_block(run, b, i * LANES);
}

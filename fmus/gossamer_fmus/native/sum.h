/* A sum over the elements of a mesh for one set of instructions; loop.h includes this once for each.

   elements.h holds each element's function, written by CasADi with lanes as numbers, and the table of loops: lane l is one
   element, and holds the same bits as that element alone. Elements lie in the tables in blocks of BLOCK, one beside the other;
   the last block repeats its last element, whose results are left out.

   Symbols: x positions of all nodes, d what elements share (a column per combination), own what one element has alone. */

#include "elements.h"

/* of a loop that is known where it is compiled, so that all its sizes are constants */
static inline __attribute__((always_inline)) int CASADI_PREFIX(sum)(const Loop *loop, const double **arg, double **res) {
  const double *x = arg[0], *d = arg[1], *own = tables + loop->numbers;
  const int32_t *places = (const int32_t *)(tables + N_NUMBERS) + loop->places;
  const int m = loop->nodes, n = loop->elements;
  /* too large for the stack of some hosts' threads; aligned here, as not every system aligns it */
  static _Thread_local double space[LANES * (6 * MOST_NODES + MOST_SHARED + MOST_OWN + MOST_W + 1)];
  lanes *const xl = (lanes *)(((uintptr_t)space + sizeof(lanes) - 1) / sizeof(lanes) * sizeof(lanes));
  lanes *const fl = xl + 3 * MOST_NODES, *const dl = fl + 3 * MOST_NODES, *const gl = dl + MOST_SHARED, *const w = gl + MOST_OWN;
  lanes rl[MOST_REDUCTIONS], all[MOST_REDUCTIONS][BLOCK / LANES]; /* as many as a block has elements, whatever LANES */
  const lanes *argl[MOST_ARG];
  lanes *resl[MOST_RES];
  casadi_int iw[MOST_IW];
  double *f = loop->forces ? res[0] : NULL, **reduced = res + (loop->forces > 0);
  if (f) memset(f, 0, loop->n_f * sizeof(double));
  for (int k = 0; loop->reductions[k]; k++) {
    for (int l = 0; l < BLOCK / LANES; l++) all[k][l] = (lanes)(loop->reductions[k] == 'l' ? -INFINITY : 0.0);
  }
  for (int begin = 0; begin < n; begin += LANES) {
    const int valid = n - begin < LANES ? n - begin : LANES, block = begin / BLOCK * BLOCK, first = begin % BLOCK;
    const int32_t *at = places + block * (m + 1) + first;
    const double *alone = own + block * loop->own + first;
    for (int i = 0; i < m; i++) {
      lanes place[3]; /* gathered in registers: what is stored by lanes cannot be loaded at once */
      for (int l = 0; l < LANES; l++) {
        const double *node = x + at[i * BLOCK + l];
        for (int a = 0; a < 3; a++) LANE(place[a], l) = node[a];
      }
      for (int a = 0; a < 3; a++) xl[a * m + i] = place[a];
    }
    for (int k = 0; k < loop->shared && (begin == 0 || loop->columns > 1); k++) {
      for (int l = 0; l < LANES; l++) LANE(dl[k], l) = d[at[m * BLOCK + l] + k];
    }
    for (int k = 0; k < loop->own; k++) {
      for (int l = 0; l < LANES; l++) LANE(gl[k], l) = alone[k * BLOCK + l];
    }
    argl[0] = xl, argl[1] = dl, argl[2] = gl;
    resl[0] = fl;
    for (int k = 0; loop->reductions[k]; k++) resl[(loop->forces > 0) + k] = &rl[k];
    if (loop->element(argl, resl, iw, w, 0)) return 1;
    if (f) {
      for (int i = 0; i < loop->forces; i++) {
        for (int l = 0; l < valid; l++) {
          double *node = f + at[i * BLOCK + l];
          node[0] += LANE(fl[i], l);
          node[1] += LANE(fl[loop->forces + i], l);
          node[2] += LANE(fl[2 * loop->forces + i], l);
        }
      }
    }
    for (int k = 0; loop->reductions[k]; k++) {
      lanes *so_far = &all[k][first / LANES];
      if (loop->reductions[k] == 's') {
        for (int l = valid; l < LANES; l++) LANE(rl[k], l) = 0.0;
        *so_far += rl[k];
        continue;
      }
      *so_far = where((*so_far >= rl[k]) | (*so_far != *so_far), *so_far, rl[k]); /* NaN stays */
    }
  }
  for (int k = 0; loop->reductions[k]; k++) {
    if (!reduced[k]) continue;
    double one = LANE(all[k][0], 0);
    if (loop->reductions[k] == 's') one += 0.0;
    for (int l = 1; l < BLOCK; l++) {
      double other = LANE(all[k][l / LANES], l % LANES);
      if (loop->reductions[k] == 's') one += other;
      else if (!(one >= other) && one == one) one = other;
    }
    *reduced[k] = one;
  }
  return 0;
}

static int CASADI_PREFIX(run)(int which, const double **arg, double **res) {
  switch (which) {
#define LOOP(k) case k: return CASADI_PREFIX(sum)(&CASADI_PREFIX(loops)[k], arg, res);
    EACH_LOOP
#undef LOOP
  }
  return 1;
}

/* Sums over the elements of a mesh, four elements at once; after functions.h, whose stand-ins call run_loop.

   elements.h holds each element's function, written by CasADi with lanes as numbers: lane l is one element, and holds the
   same bits as that element alone. Elements lie in the tables block by block, a lane per element; the last block repeats
   its last element, whose results are left out.

   Symbols: x positions of all nodes, d what elements share (a column per combination), own what one element has alone. */

#include "lanes.h"
#undef casadi_real
#define casadi_real lanes
#undef CODEGEN_PREFIX
#define CODEGEN_PREFIX elements_
#include "elements.h"

typedef struct {
  int (*element)(const lanes **arg, lanes **res, casadi_int *iw, lanes *w, int mem);
  int elements, nodes, shared, own; /* numbers of each */
  bool forces;                      /* the first result is forces */
  const char *reductions;           /* of each further result: l largest, s sum */
  size_t numbers, places;           /* where its part of the tables begins */
} Loop;

#include "loops.h" /* static const Loop LOOPS[], and the largest sizes of all */

static int run_loop(int which, const double **arg, double **res) {
  const Loop *loop = &LOOPS[which];
  const double *x = arg[0], *d = arg[1], *own = tables + loop->numbers;
  const int32_t *places = (const int32_t *)(tables + N_NUMBERS) + loop->places;
  const int m = loop->nodes, n = loop->elements;
  /* too large for the stack of some hosts' threads */
  static _Thread_local lanes xl[3 * MOST_NODES], dl[MOST_SHARED], gl[MOST_OWN], fl[3 * MOST_NODES], w[MOST_W];
  lanes rl[MOST_REDUCTIONS];
  const lanes *argl[MOST_ARG];
  lanes *resl[MOST_RES];
  casadi_int iw[MOST_IW];
  double *f = loop->forces ? res[0] : NULL, **reduced = res + loop->forces;
  if (f) memset(f, 0, N_POSITIONS * sizeof(double));
  for (int k = 0; loop->reductions[k]; k++) {
    if (reduced[k]) *reduced[k] = loop->reductions[k] == 'l' ? -INFINITY : 0.0;
  }
  for (int begin = 0; begin < n; begin += LANES, places += (m + 1) * LANES, own += loop->own * LANES) {
    const int valid = n - begin < LANES ? n - begin : LANES;
    for (int i = 0; i < m; i++) {
      for (int l = 0; l < LANES; l++) {
        const double *node = x + places[i * LANES + l];
        xl[i][l] = node[0];
        xl[m + i][l] = node[1];
        xl[2 * m + i][l] = node[2];
      }
    }
    for (int k = 0; k < loop->shared; k++) {
      for (int l = 0; l < LANES; l++) dl[k][l] = d[places[m * LANES + l] + k];
    }
    for (int k = 0; k < loop->own; k++) {
      for (int l = 0; l < LANES; l++) gl[k][l] = own[k * LANES + l];
    }
    argl[0] = xl, argl[1] = dl, argl[2] = gl;
    resl[0] = fl;
    for (int k = 0; loop->reductions[k]; k++) resl[loop->forces + k] = &rl[k];
    if (loop->element(argl, resl, iw, w, 0)) return 1;
    if (f) {
      for (int i = 0; i < m; i++) {
        for (int l = 0; l < valid; l++) {
          double *node = f + places[i * LANES + l];
          node[0] += fl[i][l];
          node[1] += fl[m + i][l];
          node[2] += fl[2 * m + i][l];
        }
      }
    }
    for (int k = 0; loop->reductions[k]; k++) {
      for (int l = 0; l < valid && reduced[k]; l++) {
        double value = rl[k][l];
        if (loop->reductions[k] == 's') *reduced[k] += value;
        else if (!(value <= *reduced[k]) && *reduced[k] == *reduced[k]) *reduced[k] = value; /* NaN stays */
      }
    }
  }
  return 0;
}

/* the names of C's functions again */
#undef exp
#undef expm1
#undef log
#undef log1p
#undef log10
#undef sin
#undef cos
#undef tan
#undef asin
#undef acos
#undef atan
#undef sinh
#undef cosh
#undef tanh
#undef asinh
#undef acosh
#undef atanh
#undef erf
#undef pow
#undef fmod
#undef atan2
#undef hypot
#undef fabs
#undef sqrt
#undef floor
#undef ceil
#undef copysign
#undef fmax
#undef fmin

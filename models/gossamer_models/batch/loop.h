/* Sums over the elements of a mesh where a lane is a case: what functions.h calls run_loop.

   All lanes share the nodes of an element and what it has alone. Positions and forces of a node lie side by side, so that
   each is one load or store of a whole vector. loops.h holds the tables and calls sum_over with numbers, so that the compiler
   writes the loop around the code of its element.

   Symbols: x positions of all nodes, d what elements share (a column per combination), f forces. */

static inline __attribute__((always_inline)) int sum_over(
    int (*element)(const lanes **arg, lanes **res, casadi_int *iw, lanes *w, int mem), int elements, int nodes, int own,
    int forces, int n_f, const char *reductions, const int32_t *places, const double *numbers, const lanes **arg, lanes **res) {
  static _Thread_local lanes work[MOST_W]; /* too large for the stack of some threads */
  casadi_int iw[MOST_IW];
  const lanes *x = arg[0], *d = arg[1], *of_element[MOST_ARG];
  lanes xe[3 * nodes], fe[3 * nodes], alone[own], each[MOST_REDUCTIONS], *to[MOST_RES];
  lanes *f = forces ? res[0] : NULL, **reduced = res + (forces > 0);
  for (int i = 0; f && i < n_f; i++) f[i] = (lanes)(0.0);
  for (int k = 0; reductions[k]; k++) {
    if (reduced[k]) *reduced[k] = (lanes)(reductions[k] == 'l' ? -INFINITY : 0.0);
  }
  for (int e = 0; e < elements; e++) {
    const int32_t *at = places + (int64_t)e * (nodes + 1);
    for (int i = 0; i < nodes; i++) {
      for (int a = 0; a < 3; a++) xe[a * nodes + i] = x[at[i] + a];
    }
    for (int k = 0; k < own; k++) alone[k] = (lanes)(numbers[(int64_t)e * own + k]);
    of_element[0] = xe, of_element[1] = d + at[nodes], of_element[2] = alone;
    to[0] = fe;
    for (int k = 0; reductions[k]; k++) to[(forces > 0) + k] = &each[k];
    if (element(of_element, to, iw, work, 0)) return 1;
    for (int i = 0; f && i < forces; i++) {
      for (int a = 0; a < 3; a++) f[at[i] + a] += fe[a * forces + i];
    }
    for (int k = 0; reductions[k]; k++) {
      lanes *total = reduced[k];
      if (!total) continue;
      if (reductions[k] == 's') *total += each[k];
      else *total = where((each[k] <= *total) | (*total != *total), *total, each[k]); /* NaN stays */
    }
  }
  return 0;
}

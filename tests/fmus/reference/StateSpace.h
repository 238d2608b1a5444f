/* x' = A x + B u, y = C x + D u; sizes m, n, r of u, x, y are structural parameters. Arrays are stored row by row. */
#define STEP 1e-3
#define MOST 5
typedef struct {
  uint64_t m, n, r;
  double A[MOST * MOST], B[MOST * MOST], C[MOST * MOST], D[MOST * MOST], x0[MOST], u[MOST], y[MOST], x[MOST];
} Model;
static void outputs(Model *s) {
  for (uint64_t i = 0; i < s->r; i++) {
    s->y[i] = 0.0;
    for (uint64_t j = 0; j < s->n; j++) s->y[i] += s->C[i * s->n + j] * s->x[j];
    for (uint64_t j = 0; j < s->m; j++) s->y[i] += s->D[i * s->m + j] * s->u[j];
  }
}
static void resize(Model *s) {   /* identities, and x0 = u = 1, 2, 3, .. */
  for (uint64_t i = 0; i < MOST * MOST; i++) s->A[i] = s->B[i] = s->C[i] = s->D[i] = 0.0;
  for (uint64_t i = 0; i < MOST; i++) {
    if (i < s->n) s->A[i * s->n + i] = 1.0;
    if (i < s->n && i < s->m) s->B[i * s->m + i] = 1.0;
    if (i < s->r && i < s->n) s->C[i * s->n + i] = 1.0;
    if (i < s->r && i < s->m) s->D[i * s->m + i] = 1.0;
    s->x0[i] = i + 1.0;
    s->u[i] = 0.0;
  }
}
static void start(Model *s) { *s = (Model){.m = 3, .n = 3, .r = 3}; resize(s); }
#define NEEDS_SIZES
static void begin(Model *s) { memcpy(s->x, s->x0, sizeof s->x); outputs(s); }
static void advance(Model *s, double time) {
  (void)time;
  double d[MOST] = {0.0};
  for (uint64_t i = 0; i < s->n; i++) {
    for (uint64_t j = 0; j < s->n; j++) d[i] += s->A[i * s->n + j] * s->x[j];
    for (uint64_t j = 0; j < s->m; j++) d[i] += s->B[i * s->m + j] * s->u[j];
  }
  for (uint64_t i = 0; i < s->n; i++) s->x[i] += STEP * d[i];
  outputs(s);
}
static bool event(const Model *m, double time) { (void)m; (void)time; return false; }
static void update(Model *m) { (void)m; }
static bool ended(const Model *m) { (void)m; return false; }
static const Variable variables[] = {
  {1, U64, STRUCTURAL, AT(m)}, {2, U64, STRUCTURAL, AT(n)}, {3, U64, STRUCTURAL, AT(r)},
  {4, F64, TUNABLE, AT(A)}, {5, F64, TUNABLE, AT(B)}, {6, F64, TUNABLE, AT(C)}, {7, F64, TUNABLE, AT(D)},
  {8, F64, PARAMETER, AT(x0)}, {9, F64, INPUT, AT(u)}, {10, F64, OUTPUT, AT(y)}, {11, F64, OUTPUT, AT(x)},
};
static size_t count(const Model *s, const void *v) {
  const uint64_t sizes[] = {1, 1, 1, s->n * s->n, s->n * s->m, s->r * s->n, s->r * s->m, s->n, s->m, s->r, s->n};
  return sizes[((const Variable *)v)->reference - 1];
}

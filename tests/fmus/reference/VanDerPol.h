/* x0' = x1, x1' = mu (1 - x0^2) x1 - x0 */
#define STEP 1e-2
#define NX 2
#define NZ 0
typedef struct { double x0, x1, d0, d1, mu; } Model;
static void start(Model *m) { *m = (Model){.x0 = 2.0, .mu = 1.0}; }
static void derivatives(Model *m) {
  m->d0 = m->x1;
  m->d1 = m->mu * ((1.0 - m->x0 * m->x0) * m->x1) - m->x0;
}
static void indicators(const Model *m, double *z) { (void)m; (void)z; }
static bool event(const Model *m, double time) { (void)m; (void)time; return false; }
static void update(Model *m) { (void)m; }
static bool ended(const Model *m) { (void)m; return false; }
static size_t count(const Model *m, const void *v) { (void)m; (void)v; return 1; }
static const Variable variables[] = {
  {1, F64, OUTPUT, AT(x0)}, {2, F64, OUTPUT, AT(d0)}, {3, F64, OUTPUT, AT(x1)}, {4, F64, OUTPUT, AT(d1)},
  {5, F64, PARAMETER, AT(mu)},
};

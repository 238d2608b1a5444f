/* A ball falls from 1 m and bounces with 70 % of its speed until it rests. */
#define STEP 1e-3
#define NX 2
#define NZ 1
typedef struct { double h, v, dh, dv, g, e, v_min; bool rests; } Model;
static void start(Model *m) { *m = (Model){.h = 1.0, .g = -9.81, .e = 0.7, .v_min = 0.1}; }
static void derivatives(Model *m) {
  m->dh = m->v;
  m->dv = m->rests ? 0.0 : m->g;
}
static void indicators(const Model *m, double *z) { z[0] = m->rests ? 1.0 : m->h; }
static bool event(const Model *m, double time) { (void)time; return m->h <= 0.0 && m->v < 0.0; }
static void update(Model *m) {
  if (!event(m, 0.0)) return;
  m->h = 1.17549435e-38;  /* above zero, so that the same bounce is not seen twice */
  m->v *= -m->e;
  if (m->v < m->v_min) { m->v = 0.0; m->rests = true; }
}
static bool ended(const Model *m) { (void)m; return false; }
static size_t count(const Model *m, const void *v) { (void)m; (void)v; return 1; }
static const Variable variables[] = {
  {1, F64, OUTPUT, AT(h)}, {2, F64, OUTPUT, AT(dh)}, {3, F64, OUTPUT, AT(v)}, {4, F64, OUTPUT, AT(dv)},
  {5, F64, PARAMETER, AT(g)},
  {6, F64, TUNABLE, AT(e)}, {7, F64, PARAMETER, AT(v_min)}, {8, F64, OUTPUT, AT(h)},
};

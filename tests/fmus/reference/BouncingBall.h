/* A ball falls from 1 m and bounces with 70 % of its speed until it rests. */
#define STEP 1e-3
typedef struct { double h, v, g, e, v_min; bool rests; } Model;
static void start(Model *m) { *m = (Model){.h = 1.0, .g = -9.81, .e = 0.7, .v_min = 0.1}; }
static void advance(Model *m, double time) {
  (void)time;
  double h = m->h + STEP * m->v;
  m->v += STEP * (m->rests ? 0.0 : m->g);
  m->h = h;
}
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
  {1, F64, OUTPUT, AT(h)}, {3, F64, OUTPUT, AT(v)}, {5, F64, PARAMETER, AT(g)},
  {6, F64, TUNABLE, AT(e)}, {7, F64, PARAMETER, AT(v_min)},
};

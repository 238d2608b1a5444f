/* A mass on a spring from a place L, and on one from a place u: x' = v, v' = -k (x - L) - c (x - u), y = x + D u, at rest
   at 0 first. The side is 1 where x has passed 0.5, which is an event; where the input 'stiff' is 1, k is four times as large. */
#define STEP 1e-3
#define NX 2
#define NZ 1
typedef struct { double x, v, dx, dv, u, k, c, D, L, y, z; int32_t side, stiff; } Model;
static void start(Model *m) { *m = (Model){.k = 1.0, .c = 0.5}; }
static void derivatives(Model *m) {
  m->dx = m->v;
  m->dv = -(m->stiff ? 4.0 : 1.0) * m->k * (m->x - m->L) - m->c * (m->x - m->u);
  m->z = m->x - 0.5;
  m->y = m->x + m->D * m->u;
}
static void indicators(const Model *m, double *z) { z[0] = m->x - 0.5; }
static bool event(const Model *m, double time) {
  (void)time;
  return m->side ? m->x < 0.5 + 1e-9 && m->v < 0.0 : m->x > 0.5 - 1e-9 && m->v > 0.0;
}
static void update(Model *m) { m->side = !m->side; }
static bool ended(const Model *m) { (void)m; return false; }
static size_t count(const Model *m, const void *v) { (void)m; (void)v; return 1; }
static const Variable variables[] = {
  {1, F64, OUTPUT, AT(x)}, {2, F64, OUTPUT, AT(v)}, {3, F64, OUTPUT, AT(dx)}, {4, F64, OUTPUT, AT(dv)},
  {5, F64, INPUT, AT(u)}, {6, F64, PARAMETER, AT(k)}, {7, F64, PARAMETER, AT(c)}, {8, F64, PARAMETER, AT(D)},
  {9, F64, OUTPUT, AT(y)}, {10, I32, OUTPUT, AT(side)}, {11, I32, INPUT, AT(stiff)},
  {12, F64, PARAMETER, AT(L)}, {13, F64, OUTPUT, AT(z)},
};

/* Clocks of every kind that has times of its own, each with a counter and the input u or the time as it was at the last tick:
   1 constant, 0.1 s from 0.05 s on, takes u; 2 fixed, every p; 3 tunable, every q, which falls to half of it at the fifth tick;
   4 changing, after 0.1, 0.2, 0.3 s .. ; 5 countdown, 0.03 s after v has passed 0.5, 1.5 ..: v' = 1. */
#define STEP 1e-3
#define CLOCKED 5
#define NX 1
#define NZ 1
typedef struct { double v, dv, z, u, p, q, level, arm, y[6]; int32_t n[6]; bool said; Text text; } Model;
static void start(Model *m) { *m = (Model){.p = 0.25, .q = 0.2, .level = 0.5, .arm = -1}; strcpy(m->text.text, "none"); }
static void derivatives(Model *m) { m->dv = 1.0; m->z = m->v - m->level; }
static void indicators(const Model *m, double *z) { *z = m->v - m->level; }
static bool event(const Model *m, double time) { (void)time; return m->v >= m->level - 1e-9; }
static void update(Model *m) { m->level += 1.0; m->arm = 0.03; }
static bool ended(const Model *m) { (void)m; return false; }
static size_t count(const Model *m, const void *v) { (void)m; (void)v; return 1; }
static void tick(Model *m, int clock, double time) {
  m->y[clock] = clock == 1 ? m->u : time;
  m->n[clock]++;
  if (clock == 3 && m->n[3] == 5) { m->q *= 0.5; m->said = false; }
  snprintf(m->text.text, sizeof m->text, "tick %d", clock);
}
/* The interval of a clock [s], and 0 if it is not known, 1 if it is known already, 2 if it is new. */
static int interval(Model *m, int clock, double *T) {
  if (clock == 2) { *T = m->p; return 1; }
  if (clock == 3) {
    *T = m->q;
    if (m->said) return 1;
    m->said = true;
    return 2;
  }
  if (clock == 4) { *T = 0.1 * (m->n[4] + 1); return 2; }
  *T = m->arm;
  m->arm = -1;
  return *T < 0 ? 0 : 2;
}
static double shift(const Model *m, int clock) { return clock == 2 ? m->p / 2 : 0.0; }
static int clock_of(unsigned reference) { return reference == 20 ? 1 : reference == 30 ? 4 : reference > 100 ? reference % 10 : 0; }
static const Variable variables[] = {
  {10, F64, OUTPUT, AT(v)}, {11, F64, OUTPUT, AT(dv)}, {12, F64, OUTPUT, AT(z)}, {20, F64, INPUT, AT(u)}, {21, F64, PARAMETER, AT(p)}, {22, F64, TUNABLE, AT(q)},
  {30, STR, OUTPUT, AT(text)},
  {101, F64, OUTPUT, AT(y[1])}, {102, F64, OUTPUT, AT(y[2])}, {103, F64, OUTPUT, AT(y[3])}, {104, F64, OUTPUT, AT(y[4])},
  {105, F64, OUTPUT, AT(y[5])},
  {201, I32, OUTPUT, AT(n[1])}, {202, I32, OUTPUT, AT(n[2])}, {203, I32, OUTPUT, AT(n[3])}, {204, I32, OUTPUT, AT(n[4])},
  {205, I32, OUTPUT, AT(n[5])},
};

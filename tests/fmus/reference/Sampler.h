/* x' = 1; y takes x every 0.1 s, at times that are summed up, and x falls by 'drop' there; x falls to 0 when it has passed 1.5;
   u above 5 ends it. */
#define STEP 1e-2
#define NX 1
#define NZ 0
typedef struct { double x, dx, y, next, u, drop; } Model;
static void start(Model *m) { *m = (Model){.next = 0.1}; }
static void derivatives(Model *m) { m->dx = 1.0; }
static void indicators(const Model *m, double *z) { (void)m; (void)z; }
static bool event(const Model *m, double time) { return time >= m->next || m->x > 1.5; }
static void update(Model *m) {
  if (m->x > 1.5) { m->x = 0.0; return; }
  m->y = m->x;
  m->x -= m->drop;
  m->next += 0.1;
}
#define TIME_EVENTS
static double next_event(const Model *m) { return m->next; }
#define STEP_EVENTS
static bool step_event(const Model *m) { return m->x > 1.5; }
static bool ended(const Model *m) { return m->u > 5.0; }
static size_t count(const Model *m, const void *v) { (void)m; (void)v; return 1; }
static const Variable variables[] = {
  {1, F64, OUTPUT, AT(x)}, {2, F64, OUTPUT, AT(dx)}, {3, F64, OUTPUT, AT(y)}, {4, F64, INPUT, AT(u)},
  {5, F64, PARAMETER, AT(drop)},
};

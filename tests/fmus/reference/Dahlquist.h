/* x' = -k x */
#define STEP 0.1
#define NX 1
#define NZ 0
typedef struct { double x, dx, k; } Model;
static void start(Model *m) { *m = (Model){.x = 1.0, .k = 1.0}; }
static void derivatives(Model *m) { m->dx = -m->k * m->x; }
static void indicators(const Model *m, double *z) { (void)m; (void)z; }
static bool event(const Model *m, double time) { (void)m; (void)time; return false; }
static void update(Model *m) { (void)m; }
static bool ended(const Model *m) { (void)m; return false; }
static size_t count(const Model *m, const void *v) { (void)m; (void)v; return 1; }
static const Variable variables[] = {{1, F64, OUTPUT, AT(x)}, {2, F64, OUTPUT, AT(dx)}, {3, F64, PARAMETER, AT(k)}};

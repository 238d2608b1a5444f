/* x' = -k x */
#define STEP 0.1
typedef struct { double x, k; } Model;
static void start(Model *m) { *m = (Model){.x = 1.0, .k = 1.0}; }
static void advance(Model *m, double time) { (void)time; m->x += STEP * (-m->k * m->x); }
static bool event(const Model *m, double time) { (void)m; (void)time; return false; }
static void update(Model *m) { (void)m; }
static bool ended(const Model *m) { (void)m; return false; }
static size_t count(const Model *m, const void *v) { (void)m; (void)v; return 1; }
static const Variable variables[] = {{1, F64, OUTPUT, AT(x)}, {3, F64, PARAMETER, AT(k)}};

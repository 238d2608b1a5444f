/* A counter beside an input clock, which nothing here ticks. */
#define STEP 0.1
typedef struct { int32_t ticks; } Model;
static void start(Model *m) { *m = (Model){0}; }
static void advance(Model *m, double time) { (void)time; m->ticks++; }
static bool event(const Model *m, double time) { (void)m; (void)time; return false; }
static void update(Model *m) { (void)m; }
static bool ended(const Model *m) { (void)m; return false; }
static size_t count(const Model *m, const void *v) { (void)m; (void)v; return 1; }
static const Variable variables[] = {{2, I32, OUTPUT, AT(ticks)}};

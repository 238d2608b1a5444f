/* A counter that grows by one every second and ends the simulation when it is 10. */
#define STEP 0.2
typedef struct { int32_t counter; double next; } Model;
static void start(Model *m) { *m = (Model){.counter = 1, .next = 1.0}; }
static void advance(Model *m, double time) { (void)m; (void)time; }
static bool event(const Model *m, double time) { return time >= m->next - 1e-6; }
static void update(Model *m) { m->counter++; m->next += 1.0; }
static bool ended(const Model *m) { return m->counter >= 10; }
#define TIME_EVENTS
static double next_event(const Model *m) { return m->next; }
static size_t count(const Model *m, const void *v) { (void)m; (void)v; return 1; }
static const Variable variables[] = {{1, I32, OUTPUT, AT(counter)}};

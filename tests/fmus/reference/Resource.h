/* y is the first character of resources/y.txt; fmi2.c and fmi3.c fill in folder. */
#define STEP 1.0
#define NEEDS_FOLDER
typedef struct { int32_t y; } Model;
static void start(Model *m) { *m = (Model){0}; }
static void open_folder(Model *m, const char *folder) {
  char path[4096];
  snprintf(path, sizeof path, "%s/y.txt", folder);
  FILE *file = fopen(path, "r");
  if (file) { m->y = fgetc(file); fclose(file); }
}
static void advance(Model *m, double time) { (void)m; (void)time; }
static bool event(const Model *m, double time) { (void)m; (void)time; return false; }
static void update(Model *m) { (void)m; }
static bool ended(const Model *m) { (void)m; return false; }
static size_t count(const Model *m, const void *v) { (void)m; (void)v; return 1; }
static const Variable variables[] = {{1, I32, OUTPUT, AT(y)}};

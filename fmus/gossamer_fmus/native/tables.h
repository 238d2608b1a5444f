/* Arrays that a model reads from the FMU's resources, shared by all instances of a process; before functions.h.

   The file holds N_NUMBERS doubles and N_PLACES 32-bit integers, little-endian as every platform here is: long lists of
   constants in functions.h; or what the last input of init and step holds, what each element has alone, and where its nodes
   are, see gossamer_models/element_loop.py.
   The first instance reads it, the last one frees it. */

#include "resources.h"

#include <stdatomic.h>

#define TABLES_SIZE ((size_t)N_NUMBERS * sizeof(double) + (size_t)N_PLACES * sizeof(int32_t))

static double *tables;
static int tables_users;
static atomic_flag tables_busy = ATOMIC_FLAG_INIT;

#if defined(_WIN32)
#include <windows.h>
static FILE *tables_file(const char *path) { /* UTF-8, which fopen does not take on Windows */
  wchar_t wide[4096];
  return MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, 4096) ? _wfopen(wide, L"rb") : NULL;
}
#else
static FILE *tables_file(const char *path) { return fopen(path, "rb"); }
#endif

static const char *tables_read(const char *resources) {
  char path[4096];
  size_t read;
  FILE *file;
  if (!resources || !resource_path(resources, TABLES_FILE, path, sizeof path)) {
    return "model '" MODEL_NAME "' reads numbers from the FMU's resources, and the host does not say where they are";
  }
  if (!(file = tables_file(path))) {
    return "model '" MODEL_NAME "' cannot open " TABLES_FILE " in the FMU's resources. Unpack the whole FMU, and pass the "
           "location of its resources";
  }
  if (!(tables = malloc(TABLES_SIZE + 1))) {
    fclose(file);
    return "there is no memory for the tables of model '" MODEL_NAME "'";
  }
  read = fread(tables, 1, TABLES_SIZE + 1, file);
  fclose(file);
  if (read != TABLES_SIZE || crc32((const uint8_t *)tables, TABLES_SIZE) != TABLES_CHECKSUM) {
    free(tables);
    tables = NULL;
    return "model '" MODEL_NAME "': " TABLES_FILE " in the FMU's resources is damaged or of another FMU. Build it again";
  }
  return NULL;
}

/* Make the tables ready for one more instance; return why that failed, if it did. */
static const char *tables_open(const char *resources) {
  const char *refusal;
  while (atomic_flag_test_and_set(&tables_busy)) continue;
  refusal = tables ? NULL : tables_read(resources);
  if (!refusal) tables_users++;
  atomic_flag_clear(&tables_busy);
  return refusal;
}

static void tables_close(void) {
  while (atomic_flag_test_and_set(&tables_busy)) continue;
  if (--tables_users == 0) {
    free(tables);
    tables = NULL;
  }
  atomic_flag_clear(&tables_busy);
}

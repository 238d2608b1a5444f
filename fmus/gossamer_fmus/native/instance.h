/* Where instances lie; after Instance. They are allocated. Where the environment has GOSSAMER_FIXED_ADDRESS, the first one lies in
   the binary, so that an A2L file can say where its values are (FMI-LS-XCP, see a2l.py): not always, since the host Ecos 0.7
   takes the values of one instance for those of others then. */

#include <stdatomic.h>
#include <stddef.h>
#include <stdlib.h>

#if defined(_WIN32)
__declspec(dllexport)
#elif defined(__ELF__)
__attribute__((visibility("protected"))) /* another FMU of the same model in the process has its own */
#else
__attribute__((visibility("default")))
#endif
Instance FIRST_INSTANCE;
_Static_assert(offsetof(Instance, stepper.state.values) == VALUES_OFFSET, "where the A2L file has the values");
static atomic_flag first_is_in_use = ATOMIC_FLAG_INIT;

static Instance *instance_new(void) {
  static bool used;
  if (!getenv("GOSSAMER_FIXED_ADDRESS") || atomic_flag_test_and_set(&first_is_in_use)) return calloc(1, sizeof(Instance));
  if (used) memset(&FIRST_INSTANCE, 0, sizeof FIRST_INSTANCE);
  used = true;
  return &FIRST_INSTANCE;
}

static void instance_free(Instance *m) {
  if (!m) return;
  MODEL_END(&m->stepper);
  tables_close();
  if (m == &FIRST_INSTANCE) {
    atomic_flag_clear(&first_is_in_use);
  } else {
    free(m);
  }
}

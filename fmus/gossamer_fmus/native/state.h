/* Save, restore, write and read what a stepper remembers; after stepper.h.

   A written state is the magic, the model's digest, a checksum, and the state as it lies in memory. */

#define STATE_HEAD (sizeof STATE_MAGIC + 4)
#define STATE_SIZE (STATE_HEAD + sizeof(State))
static const uint8_t STATE_MAGIC[24] = {'G', 'O', 'S', 'S', 'A', 'M', 'E', 'R', MODEL_DIGEST};

/* Copy the state into *saved, which is allocated if it is NULL. */
static bool state_save(Stepper *s, void **saved) {
  if (!MODEL_CAN_BE_SAVED) return refuse(s, "the state of model '%s' is elsewhere and cannot be saved", MODEL_NAME);
  if (!*saved && !(*saved = malloc(sizeof(State)))) {
    return refuse(s, "there is no memory for a state of model '%s'", MODEL_NAME);
  }
  memcpy(*saved, &s->state, sizeof(State));
  return true;
}

static void state_restore(Stepper *s, const void *saved) {
  memcpy(&s->state, saved, sizeof(State));
  s->checked = s->results_known = false;
}

static void state_free(void **saved) {
  free(*saved);
  *saved = NULL;
}

/* Write a saved state as STATE_SIZE bytes. */
static void state_write(const void *saved, uint8_t *bytes) {
  uint32_t crc;
  memcpy(bytes, STATE_MAGIC, sizeof STATE_MAGIC);
  memcpy(bytes + STATE_HEAD, saved, sizeof(State));
  crc = crc32(bytes + STATE_HEAD, sizeof(State));
  memcpy(bytes + sizeof STATE_MAGIC, &crc, sizeof crc);
}

/* Read what state_write wrote, of the same model, into a new *saved. */
static bool state_read(Stepper *s, const uint8_t *bytes, size_t size, void **saved) {
  uint32_t crc;
  int64_t mode; /* the first member of a state */
  if (size != STATE_SIZE || memcmp(bytes, STATE_MAGIC, sizeof STATE_MAGIC) != 0) {
    return refuse(s, "this is no saved state of model '%s', which is %zu bytes and begins with its digest", MODEL_NAME,
                  STATE_SIZE);
  }
  memcpy(&crc, bytes + sizeof STATE_MAGIC, sizeof crc);
  if (crc != crc32(bytes + STATE_HEAD, sizeof(State))) {
    return refuse(s, "this saved state of model '%s' is damaged: its checksum does not fit", MODEL_NAME);
  }
  memcpy(&mode, bytes + STATE_HEAD, sizeof mode);
  if (mode < INSTANTIATED || mode > TERMINATED) {
    return refuse(s, "this saved state of model '%s' is forged", MODEL_NAME);
  }
  if (!(*saved = malloc(sizeof(State)))) {
    return refuse(s, "there is no memory for a state of model '%s'", MODEL_NAME);
  }
  memcpy(*saved, bytes + STATE_HEAD, sizeof(State));
  return true;
}

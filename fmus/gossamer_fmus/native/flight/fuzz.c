/* Anything for an input, and any state that its CRC passes, from states of the golden vectors: a step ends, and what it calls
   valid is finite and in range. Compile with sanitizers.

       fuzz [calls] */

#include "component.c"
#include "golden.h"

#include <stdio.h>
#include <stdlib.h>

#define KEPT 16U

static component c, kept[KEPT];
static component_work work;
static uint64_t seed = 1U;

static uint32_t draw(void) {
  seed = seed * 6364136223846793005U + 1442695040888963407U;
  return (uint32_t)(seed >> 32U);
}

/* A number of any bits, or one that is likely to pass. */
static component_real number(component_real usual) {
  static const component_real some[] = {0, 1, -1, (component_real)1e-30, (component_real)1e30, (component_real)0.3};
  const uint32_t kind = draw() % 8U;
  component_real value = usual;
  if (kind == 0U) {
    const uint64_t bits = ((uint64_t)draw() << 32U) | draw();
    (void)memcpy(&value, &bits, sizeof value);
  } else if (kind == 1U) {
    value = some[draw() % 6U];
  } else if (kind == 2U) {
    value *= (component_real)(draw() % 4096U) / (component_real)2048;
  } else {
    /* as usual */
  }
  return value;
}

/* A state that nobody could reach. */
static void disturb(void) {
  component_block *b = &c.first;
  const uint32_t changes = draw() % 8U == 0U ? COMPONENT_N_STATES : 3U;
  for (uint32_t i = 0U; i < changes; i++) {
    component_real *x = &b->state[draw() % COMPONENT_N_STATES];
    *x = number(*x);
  }
  b->parameters[draw() % COMPONENT_N_PARAMETERS] = number(b->parameters[draw() % COMPONENT_N_PARAMETERS]);
  b->period = number(b->period);
  b->next_list = draw();
  b->health = draw();
#ifdef COMPONENT_N_SLICES
  const uint32_t slice = 1U + draw() % COMPONENT_N_SLICES;
  const component_part *s = &COMPONENT_PARTS[slice % COMPONENT_N_SLICES];
  b->judging.slice = draw() % 8U == 0U ? draw() : slice;
  b->judging.part = draw() % 8U == 0U ? draw() : draw() % s->parts;
  for (uint32_t i = 0U; i < s->takes + s->gives; i++) {
    const component_value *value = &COMPONENT_VALUES[s->first_value + i];
    component_real *x = &c.live[value->place + draw() % value->size];
    *x = number(*x);
  }
  for (uint32_t i = 0U; i < s->takes + s->gives; i++) {
    const component_value *value = &COMPONENT_VALUES[s->first_value + i];
    b->judging.folds[value->fold] = folded_value(&c, value);
  }
#endif
  b->crc = crc_block(b);
}

int main(int argc, char **argv) {
  const long calls = argc > 1 ? atol(argv[1]) : 100000;
  component_inputs u;
  component_outputs y;
  component_parameters p;
  component_real in[COMPONENT_N_INPUTS], numbers[COMPONENT_N_RESULTS], given[COMPONENT_N_PARAMETERS];
  long valid = 0, used = 0;
  for (int i = 0; i < COMPONENT_N_PARAMETERS; i++) given[i] = (component_real)GOLDEN_PARAMETERS[i];
  component_to_parameters(given, &p);
  for (uint32_t k = 0U; k <= GOLDEN_STEPS; k++) {
    for (int i = 0; i < COMPONENT_N_INPUTS; i++) in[i] = (component_real)GOLDEN_INPUTS[k][i];
    component_to_inputs(in, &u);
    u.sequence = k;
    component_seal(&u);
    if (k == 0U) {
      (void)component_init(&c, &p, (component_real)GOLDEN_PERIOD, &u, &work);
    } else {
      (void)component_step(&c, &u, &y, &work);
    }
    kept[(uint64_t)k * KEPT / (GOLDEN_STEPS + 1U)] = c;
  }
  for (long k = 0; k < calls; k++) {
    if (draw() % 8U == 0U) c = kept[draw() % KEPT];
    const double *usual = GOLDEN_INPUTS[(c.first.sequence + 1U) % GOLDEN_STEPS];
    if (draw() % 4U == 0U) disturb();
    const bool any = draw() % 2U == 0U;
    for (int i = 0; i < COMPONENT_N_INPUTS; i++) in[i] = any ? number((component_real)usual[i]) : (component_real)usual[i];
    component_to_inputs(in, &u);
    u.sequence = c.first.sequence + (draw() % 8U == 0U ? draw() : 1U);
    component_seal(&u);
    const uint32_t health = component_step(&c, &u, &y, &work);
    component_from_outputs(&y, numbers);
    used += (health & (COMPONENT_INVALID & ~COMPONENT_UNEXPLAINED)) == 0U;
    if ((health & COMPONENT_INVALID) == 0U) {
      valid++;
      if (!in_range(numbers, FIRST_RESULT, COMPONENT_N_RESULTS)) {
        (void)printf("call %ld is valid and out of range\n", k);
        return 1;
      }
    }
    if (!component_is_sealed(&y) || component_health(&c) != ((health & COMPONENT_LOST) != 0U ? COMPONENT_LOST : health)) {
      (void)printf("call %ld is not sealed\n", k);
      return 1;
    }
  }
  (void)printf("%ld calls, %ld used, %ld valid\n", calls, used, valid);
  return used > calls / 100 ? 0 : 1; /* else it has tried nothing */
}

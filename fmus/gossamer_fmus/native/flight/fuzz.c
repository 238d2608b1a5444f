/* Anything for an input, and any state that its CRC passes: a step ends, and what it calls valid is finite and in range. Compile
   with sanitizers.

       fuzz [calls] */

#include "component.c"

#include <stdio.h>
#include <stdlib.h>

static component c;
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

int main(int argc, char **argv) {
  const long calls = argc > 1 ? atol(argv[1]) : 100000;
  component_inputs u = component_start_inputs;
  component_outputs y;
  component_real in[COMPONENT_N_INPUTS], usual[COMPONENT_N_INPUTS];
  long valid = 0;
  component_from_inputs(&u, usual);
  component_seal(&u);
  (void)component_init(&c, &component_start_parameters, (component_real)3e-4, &u, &work);
  const component begin = c;
  for (long k = 0; k < calls; k++) {
    if (draw() % 8U == 0U) c = begin;
    if (draw() % 4U == 0U) { /* a state that nobody could reach */
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
      b->crc = crc_block(b);
    }
    for (int i = 0; i < COMPONENT_N_INPUTS; i++) in[i] = number(usual[i]);
    component_to_inputs(in, &u);
    u.sequence = c.first.sequence + (draw() % 8U == 0U ? draw() : 1U);
    component_seal(&u);
    const uint32_t health = component_step(&c, &u, &y, &work);
    component_from_outputs(&y, work.w);
    if ((health & COMPONENT_INVALID) == 0U) {
      valid++;
      if (!in_range(work.w, FIRST_RESULT, COMPONENT_N_RESULTS)) {
        (void)printf("call %ld is valid and out of range\n", k);
        return 1;
      }
    }
    if (!component_is_sealed(&y) || component_health(&c) != ((health & COMPONENT_LOST) != 0U ? COMPONENT_LOST : health)) {
      (void)printf("call %ld is not sealed\n", k);
      return 1;
    }
  }
  (void)printf("%ld calls, %ld valid\n", calls, valid);
  return valid > calls / 100 ? 0 : 1;
}

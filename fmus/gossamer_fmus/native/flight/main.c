/* An example: one component at a fixed rate. Replace the two functions by those of your board. */

#include "component.h"

#include <stdio.h>

#define PERIOD ((component_real)3e-4) /* [s] */
#define SAMPLES 1000U

/* Read the latest sample and number it: one more for each period that has passed, also if the converter did not answer. */
static void read_sample(component_inputs *u, uint32_t period) {
  *u = component_start_inputs;
  u->sequence = period;
  component_seal(u); /* as early as can be: what is damaged later is refused */
}

static void wait_for_the_next_period(void) {}

int main(void) {
  static component sensor; /* here, so that it has a place of its own; it may lie anywhere */
  static component_work work; /* may be shared by components that run one after another */
  component_inputs u;
  component_outputs y;
  component_parameters p = component_start_parameters; /* or those that the ground has sent */
  read_sample(&u, 0U);
  uint32_t health = component_init(&sensor, &p, PERIOD, &u, &work);
  for (uint32_t k = 1U; k <= SAMPLES; k++) {
    wait_for_the_next_period();
    read_sample(&u, k);
    health = component_step(&sensor, &u, &y, &work);
    if ((health & (COMPONENT_LOST | COMPONENT_GAP)) != 0U) { /* begin again where the strain is known, or restore a block */
      health = component_init(&sensor, &p, PERIOD, &u, &work);
    }
  }
  (void)printf("health 0x%lx after %lu samples; results are %s\n", (unsigned long)health, (unsigned long)SAMPLES,
               ((health & COMPONENT_INVALID) == 0U) ? "valid" : "not valid");
  return ((health & COMPONENT_INVALID) == 0U) ? 0 : 1;
}

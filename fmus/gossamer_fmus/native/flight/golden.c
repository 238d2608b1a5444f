/* Run the golden vectors and print how far the results are from them, over the largest of each result; and what a step
   costs where the board counts (BOARD_COUNT, of board.h): there, and in states that random samples lead to from some of
   theirs, at and beyond the ranges of inputs, with samples missing, and with a bit of the state flipped. */

#include "component.h"
#include "golden.h"

#include <math.h>
#include <stdio.h>

#ifdef BOARD
#include "board.h"
#else
#define BOARD_COUNT() 0U
#define BOARD_PASSED(begin, end) ((end) - (begin))
#endif

#define KEPT 8U

static uint32_t seed = 1U;

static uint32_t draw(uint32_t below) {
  seed = seed * 1664525U + 1013904223U;
  return (seed >> 8U) % below;
}

/* A number of a golden sample, or an end of its range, or one beyond, or none. */
static component_real any_input(int i) {
  const uint32_t kind = draw(64U);
  double value = GOLDEN_INPUTS[draw(GOLDEN_STEPS)][i];
  if (kind < 8U) value = GOLDEN_RANGES[i][kind % 2U];
  if (kind == 8U) value = 2.0 * fabs(GOLDEN_RANGES[i][1]) + 1.0;
  if (kind == 9U) value = (double)NAN;
  return (component_real)value;
}

int main(void) {
  static component c;
  static component kept[KEPT];
  static component_work work;
  static double largest[COMPONENT_N_RESULTS], error[COMPONENT_N_RESULTS];
  component_inputs u;
  component_outputs y;
  component_parameters p;
  uint32_t most = 0U, random = 0U, total = 0U, health = 0U;
  int different = 0;
  double worst = 0.0;
  component_real numbers[COMPONENT_N_RESULTS];
  component_real given[COMPONENT_N_PARAMETERS];
  for (int i = 0; i < COMPONENT_N_PARAMETERS; i++) given[i] = (component_real)GOLDEN_PARAMETERS[i];
  component_to_parameters(given, &p);
  for (int k = 0; k <= GOLDEN_STEPS; k++) {
    component_real in[COMPONENT_N_INPUTS];
    for (int i = 0; i < COMPONENT_N_INPUTS; i++) in[i] = (component_real)GOLDEN_INPUTS[k][i];
    component_to_inputs(in, &u);
    u.sequence = (uint32_t)k;
    component_seal(&u);
    if (k == 0) {
      health |= component_init(&c, &p, (component_real)GOLDEN_PERIOD, &u, &work);
      for (int i = 0; i < COMPONENT_N_RESULTS; i++) numbers[i] = c.first.results[i];
    } else {
      const uint32_t begin = BOARD_COUNT();
      health |= component_step(&c, &u, &y, &work);
      const uint32_t passed = BOARD_PASSED(begin, BOARD_COUNT());
      total += passed / GOLDEN_STEPS;
      most = passed > most ? passed : most;
      component_from_outputs(&y, numbers);
    }
    kept[(uint32_t)k * KEPT / (GOLDEN_STEPS + 1U)] = c;
    for (int i = 0; i < COMPONENT_N_RESULTS; i++) {
      const double expected = GOLDEN_RESULTS[k][i], found = (double)numbers[i];
      different += found != expected;
      error[i] = !(fabs(found - expected) <= error[i]) ? fabs(found - expected) : error[i]; /* also what is no number */
      largest[i] = fmax(largest[i], fabs(expected));
    }
  }
  for (int k = 0; k < GOLDEN_STEPS; k++) {
    component_real in[COMPONENT_N_INPUTS];
    if (draw(16U) == 0U || k == 0) c = kept[draw(KEPT)];
    if (draw(16U) == 0U) ((unsigned char *)&c.first)[draw(sizeof c.first)] ^= (unsigned char)(1U << draw(8U));
    for (int i = 0; i < COMPONENT_N_INPUTS; i++) in[i] = any_input(i);
    component_to_inputs(in, &u);
    u.sequence = c.second.sequence + (draw(16U) == 0U ? draw(12U) : 1U);
    component_seal(&u);
    const uint32_t begin = BOARD_COUNT();
    (void)component_step(&c, &u, &y, &work);
    const uint32_t passed = BOARD_PASSED(begin, BOARD_COUNT());
    random = passed > random ? passed : random;
  }
  for (int i = 0; i < COMPONENT_N_RESULTS; i++) {
    const double relative = error[i] / fmax(largest[i], 1e-12);
    worst = !(relative <= worst) ? relative : worst;
    (void)printf("error %s %.17g\n", GOLDEN_NAMES[i], relative);
  }
  (void)printf("different %d\nworst %.17g\nhealth %lu\nmost %lu\nmean %lu\nrandom %lu\n", different, worst,
               (unsigned long)(health & (COMPONENT_INVALID & ~COMPONENT_UNEXPLAINED)), (unsigned long)most, (unsigned long)total,
               (unsigned long)random);
  (void)printf("ram %lu\nwork %lu\n", (unsigned long)sizeof c, (unsigned long)sizeof work);
#ifdef BOARD
  (void)printf("stack %lu\n", (unsigned long)board_stack());
#endif
  return (worst <= GOLDEN_TOLERANCE) && ((health & (COMPONENT_INVALID & ~COMPONENT_UNEXPLAINED)) == 0U) ? 0 : 1;
}

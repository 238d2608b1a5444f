/* Bits that flip: one at a time, in the state, in the constants of a step, or in a sample on its way, at any sample of the
   golden vectors; then up to GOLDEN_WINDOW samples are run on, or until all is again as in the healthy run, bit by bit. A result
   has moved where it is off by a thousandth of its largest value; it is wrong where it is off by a tenth and is no deviation, which
   a sample that is lost changes. It is valid where health says so, or, but for a sample that is lost, says what it says in a
   healthy run that is never valid. Prints how many flips did what; fails where one was not seen.

       upsets [flips] */

#define COMPONENT_CONST /* constants that can be written */
#include "component.c"
#include "golden.h"

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

typedef enum { IN_STATE, IN_CONSTANTS, IN_SAMPLE, N_PLACES } Place;

typedef struct {
  uint32_t crc; /* of the state after a sample that was flipped */
  int moved, wrong;
} End;

static End known[GOLDEN_STEPS + 1];
static component clean[GOLDEN_STEPS + 1];
static component_outputs right[GOLDEN_STEPS + 1];
static component_work work;
static uint64_t seed = 1U;

static uint32_t draw(uint32_t below) {
  seed = seed * 6364136223846793005U + 1442695040888963407U;
  return (uint32_t)((seed >> 33U) % below);
}

static void sample(int k, component_inputs *u) {
  component_real in[COMPONENT_N_INPUTS];
  for (int i = 0; i < COMPONENT_N_INPUTS; i++) in[i] = (component_real)GOLDEN_INPUTS[k][i];
  component_to_inputs(in, u);
  u->sequence = (uint32_t)k;
  component_seal(u);
}

static void flip(void *object, uint32_t size) {
  ((unsigned char *)object)[draw(size)] ^= (unsigned char)(1U << draw(8U));
}

/* Whether two components go on alike: all but what they have counted. */
static int alike(const component *one, const component *other) {
  int same = memcmp(&one->first, &other->first, offsetof(component_block, counts)) == 0;
#ifdef COMPONENT_N_SLICES
  same = same && memcmp(one->live, other->live, sizeof one->live) == 0;
#endif
  return same;
}

/* Whether the step to a sample reads a list of constants; true where that is not known. */
static int reads(int k, uint32_t number) {
#ifdef COMPONENT_N_SLICES
  uint32_t slice = clean[k - 1].first.judging.slice;
  int found = number < COMPONENT_N_STEP_LISTS;
  while (slice < COMPONENT_N_SLICES && !found) {
    const component_part *s = &COMPONENT_PARTS[slice];
    for (uint32_t i = 0U; i < s->lists; i++) found = found || COMPONENT_SLICE_LISTS[s->first_list + i] == number;
    slice = slice == clean[k].first.judging.slice ? COMPONENT_N_SLICES : s->next;
  }
  return found;
#else
  (void)number;
  return k > 0;
#endif
}

int main(int argc, char **argv) {
  const int flips = argc > 1 ? atoi(argv[1]) : 1000;
  static const char *const names[N_PLACES] = {"state", "constants", "sample"};
  double largest[COMPONENT_N_RESULTS] = {0};
  component_real p_numbers[COMPONENT_N_PARAMETERS], a[COMPONENT_N_RESULTS], b[COMPONENT_N_RESULTS];
  component_parameters p;
  component_inputs u;
  component_outputs y;
  int silent_of_all = 0, wrong_of_all = 0, is_ever_valid = 0;
  for (int i = 0; i < COMPONENT_N_PARAMETERS; i++) p_numbers[i] = (component_real)GOLDEN_PARAMETERS[i];
  component_to_parameters(p_numbers, &p);
  sample(0, &u);
  component c;
  (void)component_init(&c, &p, (component_real)GOLDEN_PERIOD, &u, &work);
  clean[0] = c;
  for (int k = 1; k <= GOLDEN_STEPS; k++) {
    sample(k, &u);
    (void)component_step(&c, &u, &right[k], &work);
    clean[k] = c;
    is_ever_valid = is_ever_valid || (right[k].health & COMPONENT_INVALID) == 0U;
    for (int i = 0; i < COMPONENT_N_RESULTS; i++) largest[i] = fmax(largest[i], fabs((double)c.first.results[i]));
  }
  for (int place = 0; place < N_PLACES; place++) {
    int moved = 0, seen = 0, silent = 0, wrong = 0, healed = 0;
    for (int trial = 0; trial < flips; trial++) {
      uint32_t crc = 0U;
      int begin = (int)draw(GOLDEN_STEPS - 1);
      const int end = begin + GOLDEN_WINDOW < GOLDEN_STEPS ? begin + GOLDEN_WINDOW : GOLDEN_STEPS;
      int has_moved = 0, is_seen = 0, is_wrong = 0;
      unsigned char *byte = NULL, mask = (unsigned char)(1U << draw(8U));
      if (place == IN_CONSTANTS) {
        const uint32_t number = draw(COMPONENT_N_USED_LISTS);
        const component_list list = COMPONENT_LISTS[number];
        byte = (unsigned char *)list.begin + draw(list.words * 4U);
        while (begin < end && !reads(begin + 1, number)) begin++; /* until then all is as in the healthy run */
        *byte ^= mask;
      }
      c = clean[begin];
      if (place == IN_STATE) flip(&c, sizeof c);
      uint32_t health = 0U;
      for (int k = begin + 1; k <= end; k++) {
        if ((health & COMPONENT_CONSTANTS) == 0U) { /* else it stays, and so do the results */
          sample(k, &u);
          if (place == IN_SAMPLE && k == begin + 1) flip(&u, sizeof u);
          health = component_step(&c, &u, &y, &work);
        }
        is_seen = is_seen || (health & ~right[k].health) != 0U;
        healed += (health & COMPONENT_HEALED) != 0U;
        component_from_outputs(&y, a);
        component_from_outputs(&right[k], b);
        const uint32_t usual = (is_ever_valid || place == IN_SAMPLE) ? 0U : right[k].health;
        for (int i = 0; i < COMPONENT_N_RESULTS; i++) {
          const double off = fabs((double)a[i] - (double)b[i]);
          has_moved = has_moved || !(off <= 1e-3 * largest[i]);
          const int is_answer = strstr(GOLDEN_NAMES[i], "deviation") == NULL;
          is_wrong = is_wrong || (is_answer && (health & COMPONENT_INVALID & ~usual) == 0U && !(off <= 0.1 * largest[i]));
        }
        if (byte == NULL && alike(&c, &clean[k])) break;
        if (place == IN_SAMPLE && k == begin + 1) { /* another bit has led here, to the same state and with it to the same end */
          if (known[begin].crc == c.first.crc) {
            has_moved = has_moved || known[begin].moved;
            is_wrong = is_wrong || known[begin].wrong;
            break;
          }
          crc = c.first.crc;
        }
      }
      if (place == IN_SAMPLE && crc != 0U) known[begin] = (End){crc, has_moved, is_wrong};
      if (byte) *byte ^= mask;
      moved += has_moved;
      seen += is_seen;
      silent += has_moved && !is_seen;
      wrong += is_wrong;
    }
    (void)printf("%s: %d flips, %d seen, %d healed, %d moved a result, %d of these not seen, %d valid and wrong\n", names[place],
                 flips, seen, healed, moved, silent, wrong);
    silent_of_all += silent;
    wrong_of_all += wrong;
  }
  return silent_of_all || wrong_of_all ? 1 : 0;
}

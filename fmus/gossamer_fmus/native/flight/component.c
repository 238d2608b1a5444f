/* One component for a flight processor: the C twin of gossamer_models/stepper.py, without a host.

   The mathematics (component_math.h) is what a native FMU runs, without derivatives. Around it: samples are sealed, in range
   and in order, or they are refused; what is remembered lies there twice, each under a CRC; constants are checked. There is
   no allocation, no recursion, no mutable global, no pointer to a function; every loop has a constant bound. */

#include "component.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "component_math.h"
#include "component_table.h"

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "numbers that are none must be seen: leave out -ffast-math and -ffinite-math-only"
#endif

_Static_assert(sizeof(component_real) == ((uint32_t)COMPONENT_FLOAT / 8U), "the width of numbers");
_Static_assert(sizeof(int) == 4U, "the width of indices");
_Static_assert(sizeof(component_parameters) == ((uint32_t)COMPONENT_N_PARAMETERS * sizeof(component_real)), "no gaps");

#define FIRST_INPUT COMPONENT_N_PARAMETERS
#define FIRST_RESULT (COMPONENT_N_PARAMETERS + COMPONENT_N_INPUTS)

/* CRC-32 of ISO 3309, as zlib has it, of numbers with their lowest byte first, whatever the order of the processor is. */
static uint32_t crc_word(uint32_t crc, uint32_t word) {
  const uint32_t c = crc ^ word;
  return CRC_TABLE[3][c & 0xFFU] ^ CRC_TABLE[2][(c >> 8U) & 0xFFU] ^ CRC_TABLE[1][(c >> 16U) & 0xFFU] ^
         CRC_TABLE[0][c >> 24U];
}

static uint32_t crc_numbers(uint32_t crc, const component_real *numbers, uint32_t count) {
  uint32_t c = crc;
  for (uint32_t i = 0U; i < count; i++) {
    COMPONENT_BITS bits;
    (void)memcpy(&bits, &numbers[i], sizeof bits);
    c = crc_word(c, (uint32_t)bits);
#if COMPONENT_FLOAT == 64
    c = crc_word(c, (uint32_t)(bits >> 32U));
#endif
  }
  return c;
}

static uint32_t crc_block(const component_block *b) {
  uint32_t c = crc_numbers(~0U, b->parameters, COMPONENT_N_PARAMETERS);
  c = crc_numbers(c, b->results, COMPONENT_N_RESULTS);
  c = crc_numbers(c, b->state, COMPONENT_N_STATES);
  c = crc_numbers(c, &b->period, 1U);
  c = crc_word(c, b->version);
  c = crc_word(c, b->sequence);
  c = crc_word(c, b->health);
  c = crc_word(c, b->next_list);
#ifdef COMPONENT_N_SLICES
  c = crc_word(c, b->judging.slice);
  c = crc_word(c, b->judging.part);
  c = crc_word(c, b->judging.unjudged);
  c = crc_word(c, b->judging.folded);
  for (uint32_t i = 0U; i < COMPONENT_N_FOLDS; i++) {
    c = crc_word(c, b->judging.folds[i]);
  }
#endif
  for (uint32_t i = 0U; i < COMPONENT_N_COUNTS; i++) {
    c = crc_word(c, b->counts[i]);
  }
  return ~c;
}

static uint32_t crc_inputs(const component_inputs *u) {
  component_real numbers[COMPONENT_N_INPUTS];
  component_from_inputs(u, numbers);
  return ~crc_word(crc_numbers(~0U, numbers, COMPONENT_N_INPUTS), u->sequence);
}

static uint32_t crc_outputs(const component_outputs *y) {
  component_real numbers[COMPONENT_N_RESULTS];
  component_from_outputs(y, numbers);
  return ~crc_word(crc_word(crc_numbers(~0U, numbers, COMPONENT_N_RESULTS), y->sequence), y->health);
}

void component_seal(component_inputs *u) { u->crc = crc_inputs(u); }

bool component_is_sealed(const component_outputs *y) { return y->crc == crc_outputs(y); }

/* Where a list lies, hidden from the compiler, which may take a constant for what it was when it compiled it. */
static const unsigned char *place_of(const component_list *list) {
  const unsigned char *volatile place = list->begin;
  return place;
}

static uint32_t word_at(const unsigned char *from) {
  uint32_t word;
  (void)memcpy(&word, from, sizeof word);
  return word;
}

/* Words, folded: one bit that flips is seen, whatever the order of bytes is. */
static uint32_t folded_words(const unsigned char *begin, uint32_t words) {
  const unsigned char *from = begin;
  uint32_t left = words;
  uint32_t sum = 0U;
  for (; left >= 8U; left -= 8U) { /* eight at once: a loop costs as much as a word */
    sum ^= word_at(from) ^ word_at(&from[4]) ^ word_at(&from[8]) ^ word_at(&from[12]);
    sum ^= word_at(&from[16]) ^ word_at(&from[20]) ^ word_at(&from[24]) ^ word_at(&from[28]);
    from = &from[32];
  }
  for (; left > 0U; left--) {
    sum ^= word_at(from);
    from = &from[4];
  }
  return sum;
}

static uint32_t folded(const component_list *list) { return folded_words(place_of(list), list->words); }

/* Whether some lists that a step reads are as they were compiled. */
static bool lists_hold(uint32_t first, uint32_t count) {
  bool hold = true;
  for (uint32_t k = 0U; k < count; k++) {
    const component_list *list = &COMPONENT_LISTS[(first + k) % COMPONENT_N_STEP_LISTS];
    hold = hold && (folded(list) == list->folded);
  }
  return hold;
}

bool component_constants_hold(void) {
  uint32_t c = ~0U;
  bool hold = true;
  for (uint32_t k = 0U; k < COMPONENT_N_LISTS; k++) {
    const component_list *list = &COMPONENT_LISTS[k];
    hold = hold && (folded(list) == list->folded);
    if (list->is_of_numbers != 0U) {
      c = crc_numbers(c, (const void *)place_of(list), list->words / (sizeof(component_real) / 4U));
    } else {
      for (uint32_t i = 0U; i < list->words; i++) {
        c = crc_word(c, word_at(&place_of(list)[4U * i]));
      }
    }
  }
  return hold && (~c == COMPONENT_CONSTANTS_CRC);
}

static bool in_range(const component_real *numbers, uint32_t first, uint32_t count) {
  bool within = true;
  for (uint32_t i = 0U; i < count; i++) { /* a number that is not one is in no range */
    within = within && (numbers[i] >= COMPONENT_LIMITS[first + i][0]) && (numbers[i] <= COMPONENT_LIMITS[first + i][1]);
  }
  return within;
}

static bool all_finite(const component_real *numbers, uint32_t count) {
  bool finite = true;
  for (uint32_t i = 0U; i < count; i++) {
    finite = finite && (numbers[i] >= -COMPONENT_LARGEST) && (numbers[i] <= COMPONENT_LARGEST);
  }
  return finite;
}

/* What the results say of themselves. */
static uint32_t judged(const component_real *results) {
  uint32_t health = in_range(results, FIRST_RESULT, COMPONENT_N_RESULTS) ? 0U : COMPONENT_OUT_OF_RANGE;
#if COMPONENT_JUDGEMENT >= 0
  if (results[COMPONENT_JUDGEMENT] != COMPONENT_GOOD) {
    health |= COMPONENT_UNEXPLAINED;
  }
#endif
  return health;
}

static void count_up(uint32_t *count) {
  if (*count < UINT32_MAX) {
    *count += 1U;
  }
}

static void seal_both(component *c) {
  c->second.crc = crc_block(&c->second);
  c->first = c->second;
}

static bool is_whole(const component_block *b) {
  return (b->crc == crc_block(b)) && (b->version == COMPONENT_VERSION);
}

/* The first copy, which was true last, or the second one where that is damaged; none where both are. */
static const component_block *whole_of(const component *c) {
  const component_block *found = is_whole(&c->first) ? &c->first : NULL;
  if ((found == NULL) && is_whole(&c->second)) {
    found = &c->second;
  }
  return found;
}

/* Make both copies the same and whole; false where neither is. */
static bool heal(component *c, uint32_t *health) {
  const component_block *found = whole_of(c);
  if (found == &c->second) {
    *health |= COMPONENT_HEALED;
    count_up(&c->second.counts[COMPONENT_COUNT_HEALED]);
    seal_both(c);
  } else if (found != NULL) {
    c->second = c->first;
  } else {
    /* lost */
  }
  return found != NULL;
}

uint32_t component_init(component *c, const component_parameters *p, component_real period, const component_inputs *u,
                        component_work *w) {
  component_real inputs[COMPONENT_N_INPUTS];
  component_block *b = &c->second;
  uint32_t health = 0U;
  (void)memset(c, 0, sizeof *c);
  component_from_parameters(p, b->parameters);
  component_from_inputs(u, inputs);
  if (!component_constants_hold()) {
    health |= COMPONENT_CONSTANTS;
  }
  if ((u->crc != crc_inputs(u)) || !in_range(b->parameters, 0U, COMPONENT_N_PARAMETERS) ||
      !in_range(inputs, FIRST_INPUT, COMPONENT_N_INPUTS) || !(period > (component_real)0) || !(period <= COMPONENT_LARGEST)) {
    health |= COMPONENT_REFUSED;
  }
  if (health == 0U) {
    w->arg[0] = inputs;
    w->arg[1] = b->parameters;
    w->res[0] = b->state;
    w->res[1] = b->results;
    if ((COMPONENT_INIT(w->arg, w->res, w->iw, w->w, 0) != 0) || !all_finite(b->state, COMPONENT_N_STATES) ||
        !all_finite(b->results, COMPONENT_N_RESULTS)) {
      health |= COMPONENT_FAILED;
    }
  }
  if (health == 0U) {
    b->period = period;
    b->version = COMPONENT_VERSION;
    b->sequence = u->sequence;
    health = judged(b->results);
    b->health = health;
    seal_both(c);
  } else {
    health |= COMPONENT_LOST;
    (void)memset(c, 0, sizeof *c); /* no block: every step says that it is lost */
  }
  return health;
}

#ifdef COMPONENT_N_SLICES
/* A window that has ended is judged in slices, one in each step. What they give each other is in c->live, each value under a
   fold in the sealed block; constants are checked where they are used. */

#define WORDS ((uint32_t)sizeof(component_real) / 4U)

static uint32_t folded_value(const component *c, const component_value *value) {
  return folded_words((const void *)&c->live[value->place], value->size * WORDS);
}

static bool values_hold(const component *c, uint32_t first, uint32_t count) {
  bool hold = true;
  for (uint32_t i = 0U; i < count; i++) {
    const component_value *value = &COMPONENT_VALUES[first + i];
    hold = hold && (folded_value(c, value) == c->second.judging.folds[value->fold]);
  }
  return hold;
}

static void fold_values(component *c, const component_part *s) {
  for (uint32_t i = 0U; i < s->gives; i++) {
    const component_value *value = &COMPONENT_VALUES[s->first_value + s->takes + i];
    c->second.judging.folds[value->fold] = folded_value(c, value);
  }
}

/* A part of a product with a constant, in the order of CasADi's: some terms of all sums where the constant is on the left, some
   columns where it is on the right. Its words are folded meanwhile. */
static void multiply(component *c, const component_part *s) {
  component_judging *judging = &c->second.judging;
  const component_list *list = &COMPONENT_LISTS[COMPONENT_SLICE_LISTS[s->first_list]];
  const component_real *constant = (const void *)place_of(list);
  const component_real *value = &c->live[COMPONENT_VALUES[s->first_value].place];
  component_real *result = &c->live[COMPONENT_VALUES[s->first_value + 1U].place];
  const bool is_left = s->kind == COMPONENT_LEFT;
  const uint32_t all = is_left ? s->terms : s->columns;
  const uint32_t length = is_left ? s->rows : s->terms; /* of a column of the constant */
  const uint32_t begin = judging->part * s->each;
  const uint32_t end = ((all - begin) > s->each) ? (begin + s->each) : all;
  const uint32_t first_term = is_left ? begin : 0U;
  const uint32_t last_term = is_left ? end : s->terms;
  for (uint32_t i = is_left ? 0U : begin; i < (is_left ? s->columns : end); i++) {
    for (uint32_t j = 0U; j < s->rows; j++) {
      component_real sum = (first_term == 0U) ? (component_real)0 : result[(i * s->rows) + j];
      if (is_left) {
        for (uint32_t k = first_term; k < last_term; k++) {
          sum += constant[(k * s->rows) + j] * value[(i * s->terms) + k];
        }
      } else {
        for (uint32_t k = first_term; k < last_term; k++) {
          sum += value[(k * s->rows) + j] * constant[(i * s->terms) + k];
        }
      }
      result[(i * s->rows) + j] = sum;
    }
  }
  judging->folded ^= folded_words((const void *)&constant[begin * length], (end - begin) * length * WORDS);
}

/* Run a part of a slice; false where its constants are damaged. */
static bool ran(component *c, const component_part *s, component_work *w) {
  bool hold = true;
  if (s->kind == COMPONENT_FUNCTION) {
    for (uint32_t i = 0U; i < s->lists; i++) {
      const component_list *list = &COMPONENT_LISTS[COMPONENT_SLICE_LISTS[s->first_list + i]];
      hold = hold && (folded(list) == list->folded);
    }
    for (uint32_t i = 0U; i < s->takes; i++) {
      w->arg[i] = &c->live[COMPONENT_VALUES[s->first_value + i].place];
    }
    for (uint32_t i = 0U; i < s->gives; i++) {
      w->res[i] = &c->live[COMPONENT_VALUES[s->first_value + s->takes + i].place];
    }
    hold = hold && (component_call(c->second.judging.slice, w->arg, w->res, w->iw, w->w) == 0);
  } else if (s->kind != COMPONENT_NOTHING) {
    multiply(c, s);
    hold = ((c->second.judging.part + 1U) < s->parts) ||
           (c->second.judging.folded == COMPONENT_LISTS[COMPONENT_SLICE_LISTS[s->first_list]].folded);
  } else {
    /* as many slices for each window */
  }
  fold_values(c, s);
  return hold;
}

static void lose_window(component_judging *judging) {
  judging->slice = 0U;
  judging->unjudged = 1U;
}

/* Judge a window further by one slice; returns COMPONENT_CONSTANTS where a constant of it is damaged. */
static uint32_t judged_further(component *c, component_work *w) {
  component_judging *judging = &c->second.judging;
  uint32_t health = 0U;
  if ((judging->slice > 0U) && (judging->slice < COMPONENT_N_SLICES)) {
    const component_part *s = &COMPONENT_PARTS[judging->slice];
    /* a product that has begun also takes what it gave */
    if ((judging->part >= s->parts) ||
        !values_hold(c, s->first_value, s->takes + ((judging->part > 0U) ? s->gives : 0U))) {
      lose_window(judging);
    } else if (!ran(c, s, w)) {
      lose_window(judging);
      health = COMPONENT_CONSTANTS;
    } else {
      judging->part++;
      if (judging->part == s->parts) {
        judging->part = 0U;
        judging->folded = 0U;
        judging->slice = s->next;
      }
      if ((judging->slice == COMPONENT_N_SLICES) && !all_finite(c->live, COMPONENT_N_RESULTS)) {
        lose_window(judging);
      }
    }
  }
  return health;
}

/* Keep what the window needs that ends with a step from x over h [s]. */
static void begin_window(component *c, const component_real *x, const component_real *inputs, const component_real *h,
                         component_real window) {
  component_judging *judging = &c->second.judging;
  if ((window >= (component_real)0) && (window < (component_real)COMPONENT_N_WINDOWS)) {
    const uint32_t begin = COMPONENT_WINDOWS[(uint32_t)window];
    const component_part *s = &COMPONENT_PARTS[begin];
    if (judging->slice != 0U) {
      judging->unjudged = 1U; /* it ended before that of the last one was judged */
    }
    for (uint32_t i = 0U; i < s->takes; i++) {
      const component_value *from = &COMPONENT_VALUES[s->first_value + i];
      const component_real *numbers = (from->place == 0U) ? x : (from->place == 1U) ? inputs :
                                      (from->place == 2U) ? c->first.parameters : h;
      component_real *to = &c->live[COMPONENT_VALUES[s->first_value + s->takes + i].place];
      (void)memcpy(to, numbers, from->size * sizeof *to);
    }
    fold_values(c, s);
    judging->slice = s->next;
    judging->part = 0U;
    judging->folded = 0U;
  }
}

/* Whether there are results of a window, which the next step takes. */
static component_real is_judged(component *c) {
  component_judging *judging = &c->second.judging;
  bool is = judging->slice == COMPONENT_N_SLICES;
  if (is) {
    const component_value value = {0U, COMPONENT_N_RESULTS, 0U};
    is = folded_value(c, &value) == judging->folds[0];
    judging->slice = 0U;
    judging->unjudged = is ? 0U : 1U;
  }
  return is ? (component_real)1 : (component_real)0;
}
#endif

/* Carry the state over h [s] in equal parts that the model can take; says whether a window has ended. */
static bool advance(component *c, const component_real *inputs, component_real h, bool *has_ended, component_work *w) {
  component_block *next = &c->second;
  uint32_t parts = 1U;
  bool done = true;
#if COMPONENT_STEP_LIMIT >= 0
  const component_real ratio = (h / c->first.parameters[COMPONENT_STEP_LIMIT]) * COMPONENT_NEARLY_ONE;
  done = ratio <= (component_real)COMPONENT_MOST_PARTS;
  while (done && ((component_real)parts < ratio)) {
    parts++;
  }
#endif
  const component_real part = h / (component_real)parts;
#ifdef COMPONENT_N_SLICES
  component_real has_results = is_judged(c);
  component_real window = (component_real)-1;
#else
  (void)has_ended;
#endif
  w->arg[0] = c->first.state;
  for (uint32_t i = 0U; done && (i < parts); i++) {
    w->arg[1] = inputs;
    w->arg[2] = c->first.parameters;
    w->arg[3] = &part;
    w->res[0] = next->state;
    w->res[1] = next->results;
#ifdef COMPONENT_N_SLICES
    w->arg[4] = c->live;
    w->arg[5] = &has_results;
    w->res[2] = &window;
#endif
    done = (COMPONENT_STEP(w->arg, w->res, w->iw, w->w, 0) == 0) && all_finite(next->state, COMPONENT_N_STATES) &&
           all_finite(next->results, COMPONENT_N_RESULTS);
#ifdef COMPONENT_N_SLICES
    if (done && (window >= (component_real)0)) {
      begin_window(c, w->arg[0], inputs, &part, window);
      *has_ended = true;
    }
    has_results = (component_real)0;
#endif
#if COMPONENT_STEP_LIMIT >= 0
    (void)memcpy(w->x, next->state, sizeof w->x);
    w->arg[0] = w->x;
#endif
  }
  return done;
}

/* Whether a sample can be used, and how many periods it is after the last one. */
static uint32_t admitted(const component_block *b, const component_inputs *u, const component_real *inputs,
                         uint32_t *periods) {
  uint32_t health = 0U;
  *periods = u->sequence - b->sequence; /* numbers of samples may run over */
  if ((u->crc != crc_inputs(u)) || !in_range(inputs, FIRST_INPUT, COMPONENT_N_INPUTS)) {
    health = COMPONENT_REFUSED;
  } else if ((*periods == 0U) || (*periods > (UINT32_MAX / 2U))) {
    health = COMPONENT_REPEATED;
  } else if (*periods > COMPONENT_LONGEST_GAP) {
    health = COMPONENT_MISSED | COMPONENT_GAP;
    *periods = COMPONENT_LONGEST_GAP;
  } else if (*periods > 1U) {
    health = COMPONENT_MISSED;
  } else {
    /* the next one, as it should be */
  }
  return health;
}

/* Whether the results of a step may count: where its lists are too many for every step, all are checked before results that
   differ from the last ones, as at the end of a window. */
static bool may_count(const component *c) {
#if COMPONENT_LISTS_PER_STEP < COMPONENT_N_REAL_LISTS
  bool same = true;
  for (uint32_t i = 0U; i < COMPONENT_N_RESULTS; i++) {
    same = same && (c->first.results[i] == c->second.results[i]);
  }
  return same || lists_hold(COMPONENT_N_INDEX_LISTS, COMPONENT_N_REAL_LISTS);
#else
  (void)c;
  return true;
#endif
}

/* Let the second copy be where the first one is, but for what it has counted. */
static void take_back(component *c, bool has_ended) {
  component_block *next = &c->second;
  (void)memcpy(next->state, c->first.state, sizeof next->state);
  (void)memcpy(next->results, c->first.results, sizeof next->results);
#ifdef COMPONENT_N_SLICES
  next->judging = c->first.judging;
  if (has_ended) { /* what slices give each other is of another window now */
    lose_window(&next->judging);
  }
#else
  (void)has_ended;
#endif
}

/* Take a sample into the second copy, from the first. */
static uint32_t taken(component *c, const component_inputs *u, component_work *w) {
  component_real inputs[COMPONENT_N_INPUTS];
  component_block *next = &c->second;
  uint32_t periods = 0U;
  bool has_ended = false;
  uint32_t health = c->first.health & COMPONENT_STAYS;
  const uint32_t list = next->next_list % COMPONENT_N_REAL_LISTS;
  if (!lists_hold(0U, COMPONENT_N_INDEX_LISTS) || !lists_hold(COMPONENT_N_INDEX_LISTS + list, COMPONENT_LISTS_PER_STEP)) {
    health |= COMPONENT_CONSTANTS; /* indices before every step: a wrong one writes elsewhere */
  }
  next->next_list = (list + COMPONENT_LISTS_PER_STEP) % COMPONENT_N_REAL_LISTS;
  component_from_inputs(u, inputs);
  health |= admitted(&c->first, u, inputs, &periods);
  if ((health & (COMPONENT_REFUSED | COMPONENT_REPEATED | COMPONENT_CONSTANTS)) != 0U) {
    count_up(&next->counts[COMPONENT_COUNT_REFUSED]);
  } else if (!advance(c, inputs, c->first.period * (component_real)periods, &has_ended, w)) {
    take_back(c, has_ended);
    count_up(&next->counts[COMPONENT_COUNT_FAILED]);
    health |= COMPONENT_FAILED;
  } else if (!may_count(c)) {
    take_back(c, has_ended);
    count_up(&next->counts[COMPONENT_COUNT_REFUSED]);
    health |= COMPONENT_CONSTANTS;
  } else {
    next->sequence = u->sequence;
    count_up(&next->counts[COMPONENT_COUNT_STEPS]);
    if ((health & COMPONENT_MISSED) != 0U) {
      count_up(&next->counts[COMPONENT_COUNT_MISSED]);
    }
  }
#ifdef COMPONENT_N_SLICES
  /* so many that a window is judged before the next one ends, whatever the period is */
  const component_real h = c->first.period * (((health & COMPONENT_MISSED) != 0U) ? (component_real)periods : (component_real)1);
  const component_real left = c->first.parameters[COMPONENT_WINDOW_LENGTH] - (h + h); /* it ends within a step, and begins so */
  const component_real all = (component_real)COMPONENT_N_PARTS;
  const component_real enough = (left > (component_real)0) ? ((all * h) / left) : all;
  for (uint32_t i = has_ended ? 1U : 0U; (i < (uint32_t)COMPONENT_N_PARTS) && ((component_real)i <= enough); i++) {
    health |= ((health & COMPONENT_CONSTANTS) == 0U) ? judged_further(c, w) : 0U;
  }
  health |= (next->judging.unjudged != 0U) ? COMPONENT_UNJUDGED : 0U;
#endif
  return health | judged(next->results);
}

#ifdef COMPONENT_N_SLICES
uint32_t component_slice(component *c, component_work *w) {
  uint32_t health = 0U;
  if (heal(c, &health)) {
    health |= c->first.health | (lists_hold(0U, COMPONENT_N_INDEX_LISTS) ? 0U : COMPONENT_CONSTANTS);
    health |= ((health & COMPONENT_CONSTANTS) == 0U) ? judged_further(c, w) : 0U;
    health |= (c->second.judging.unjudged != 0U) ? COMPONENT_UNJUDGED : 0U;
    c->second.health = health;
    seal_both(c);
  } else {
    health = COMPONENT_LOST;
  }
  return health;
}
#endif

uint32_t component_step(component *c, const component_inputs *u, component_outputs *y, component_work *w) {
  uint32_t health = 0U;
  if (heal(c, &health)) {
    health |= taken(c, u, w);
    c->second.health = health;
    seal_both(c);
    component_to_outputs(c->first.results, y);
    y->sequence = c->first.sequence;
  } else {
    health = COMPONENT_LOST;
    (void)memset(y, 0, sizeof *y);
  }
  y->health = health;
  y->crc = crc_outputs(y);
  return health;
}

uint32_t component_health(const component *c) {
  const component_block *found = whole_of(c);
  uint32_t health = COMPONENT_LOST;
  if (found != NULL) {
    health = found->health | ((found == &c->second) ? COMPONENT_HEALED : 0U);
  }
  return health;
}

uint32_t component_restore(component *c, const component_block *saved, uint32_t sequence) {
  uint32_t health = COMPONENT_LOST;
  (void)memset(c, 0, sizeof *c);
  if (is_whole(saved) && component_constants_hold()) {
    c->second = *saved;
    c->second.sequence = sequence;
    c->second.health &= ~COMPONENT_STAYS;
#ifdef COMPONENT_N_SLICES
    if (c->second.judging.slice != 0U) { /* what slices gave each other was not saved */
      lose_window(&c->second.judging);
      c->second.health |= COMPONENT_UNJUDGED;
    }
#endif
    seal_both(c);
    health = c->first.health;
  }
  return health;
}

bool component_save(const component *c, component_block *saved) {
  const component_block *found = whole_of(c);
  *saved = (found != NULL) ? *found : c->first;
  return found != NULL;
}

/* What a small test FMU is made of, for FMI 2.0 and 3.0. A model header defines

     STEP                        inner step [s]
     Model                       its variables, as plain memory
     start(m)                    sets the start values
     advance(m, time)            does an inner step, which ends at time [s]
     event(m, time)              tells whether an event is due
     update(m)                   handles it
     ended(m)                    tells whether the simulation shall end
     count(m, variable)          number of elements of a variable
     variables                   the table of its variables

   or, with continuous states, NX of them, which are the first doubles of Model and stand before their derivatives,

     derivatives(m)              computes the derivatives
     NZ, indicators(m, z)        number of event indicators, and their values

   in place of advance, and where events happen at known times

     next_event(m)               when the next one is [s]

   or only after a step of the integrator

     step_event(m)               tells whether one is due

   and fmi2.c or fmi3.c the functions of the standard around it. The state of an instance is the bytes of Instance. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef enum { F64, F32, I8, U8, I16, U16, I32, U32, I64, U64, BOOL, STR, BIN } Type;
typedef enum { PARAMETER, TUNABLE, STRUCTURAL, INPUT, OUTPUT } Kind;

typedef struct { char text[64]; } Text;
typedef struct { size_t size; uint8_t data[64]; } Bytes;

typedef struct {
  unsigned reference;
  Type type;
  Kind kind;
  size_t place;   /* in Model */
} Variable;

static const size_t SIZES[] = {8, 4, 1, 1, 2, 2, 4, 4, 8, 8, sizeof(bool), sizeof(Text), sizeof(Bytes)};

#define AT(member) offsetof(Model, member)
#include MODEL_HEADER

#ifdef NX
static void advance(Model *m, double time) {
  (void)time;
  double *x = (double *)m;
  derivatives(m);
  for (int i = 0; i < NX; i++) x[i] += STEP * x[NX + i];
}
#else
#define NX 0
#define NZ 0
static void derivatives(Model *m) { (void)m; }
static void indicators(const Model *m, double *z) { (void)m; (void)z; }
#endif
#ifndef STEP_EVENTS
static bool step_event(const Model *m) { (void)m; return false; }
#endif
#ifndef TIME_EVENTS
static double next_event(const Model *m) { (void)m; return INFINITY; }
#endif

typedef enum { BEFORE, CONFIGURING, INITIALIZING, RUNNING, EVENTS, OVER } Phase;

typedef struct {
  Model model;
  double time;        /* [s] */
  Phase phase;
  double begin;       /* start of the run [s] */
  long steps;         /* inner steps done */
  bool over;          /* the model has ended the simulation */
  bool exchange;      /* for model exchange: the host sets time and states */
} Core;

/* The independent variable, which stands behind the model. */
static const Variable TIME = {0, F64, OUTPUT, offsetof(Core, time) - offsetof(Core, model)};

static const Variable *find(unsigned reference, Type type) {
  if (reference == 0 && type == F64) return &TIME;
  for (size_t i = 0; i < sizeof variables / sizeof *variables; i++)
    if (variables[i].reference == reference && variables[i].type == type) return &variables[i];
  return NULL;
}

static bool may_set(const Core *c, const Variable *v) {
  switch (v->kind) {
    case OUTPUT: return false;
    case STRUCTURAL: return c->phase == CONFIGURING;
    case PARAMETER: return c->phase <= INITIALIZING;
    default: return c->phase != OVER;
  }
}

static size_t many(const Core *c, const Variable *v) { return v == &TIME ? 1 : count(&c->model, v); }

static double now(const Core *c) { return c->exchange ? c->time : c->begin + c->steps * STEP; }

static void one_step(Core *c) {
  c->steps++;
  c->time = now(c);
  advance(&c->model, c->time);
}

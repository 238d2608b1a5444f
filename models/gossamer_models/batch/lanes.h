/* Numbers for eight cases at once, or as many as LANES says: casadi_real in the C code that CasADi writes.

   A lane is one case. Arithmetic, comparisons and functions act on each lane as the C operators and functions act on a
   double, so a lane holds the same bits as that case alone. A truth value is 1 or 0, as in CasADi. code.py replaces what
   the operators of C cannot do with vectors (!, <, &&, ?: and tables that are looked up) by the functions here. */

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#pragma STDC FP_CONTRACT OFF /* no fused multiply-add: the same numbers everywhere */
#pragma clang diagnostic ignored "-Wunused-function"
#pragma clang diagnostic ignored "-Wpsabi"

#ifndef LANES
#define LANES 8
#endif
typedef double lanes __attribute__((ext_vector_type(LANES)));
typedef int64_t mask __attribute__((ext_vector_type(LANES))); /* each lane -1 or 0 */

#define INLINE static inline __attribute__((always_inline))

INLINE lanes truth(mask m) { return (lanes)(m & (mask)(lanes)(1.0)); }
INLINE mask holds(lanes a) { return a != 0.0; }
INLINE lanes is_less(lanes a, lanes b) { return truth(a < b); }
INLINE lanes is_at_most(lanes a, lanes b) { return truth(a <= b); }
INLINE lanes is_equal(lanes a, lanes b) { return truth(a == b); }
INLINE lanes is_different(lanes a, lanes b) { return truth(a != b); }
INLINE lanes both(lanes a, lanes b) { return truth(holds(a) & holds(b)); }
INLINE lanes either(lanes a, lanes b) { return truth(holds(a) | holds(b)); }
INLINE lanes is_not(lanes a) { return truth(a == 0.0); }
INLINE lanes where(mask m, lanes yes, lanes no) { return m ? yes : no; }
INLINE lanes where_holds(lanes a, lanes yes) { return where(holds(a), yes, (lanes)(0.0)); }
INLINE mask is_finite(lanes a) { return a - a == 0.0; }

/* table[(int) place], not a number outside the table */
INLINE lanes looked_up(const lanes *table, int size, lanes place) {
  lanes found;
  for (int l = 0; l < LANES; l++) {
    double at = place[l];
    found[l] = at > -1.0 && at < size ? table[(int)at][l] : NAN;
  }
  return found;
}

#define EACH_LANE(function)                                              \
  INLINE lanes lanes_##function(lanes a) {                               \
    lanes result;                                                        \
    for (int l = 0; l < LANES; l++) result[l] = function(a[l]);          \
    return result;                                                       \
  }
#define EACH_PAIR(function)                                              \
  INLINE lanes lanes_##function(lanes a, lanes b) {                      \
    lanes result;                                                        \
    for (int l = 0; l < LANES; l++) result[l] = function(a[l], b[l]);    \
    return result;                                                       \
  }
EACH_LANE(exp)
EACH_LANE(expm1)
EACH_LANE(log)
EACH_LANE(log1p)
EACH_LANE(log10)
EACH_LANE(sin)
EACH_LANE(cos)
EACH_LANE(tan)
EACH_LANE(asin)
EACH_LANE(acos)
EACH_LANE(atan)
EACH_LANE(sinh)
EACH_LANE(cosh)
EACH_LANE(tanh)
EACH_LANE(asinh)
EACH_LANE(acosh)
EACH_LANE(atanh)
EACH_LANE(erf)
EACH_PAIR(pow)
EACH_PAIR(fmod)
EACH_PAIR(atan2)
EACH_PAIR(hypot)
INLINE lanes lanes_sign(lanes a) { return where(a < 0.0, -1.0, where(a > 0.0, 1.0, a)); }

/* from here on the names of C's functions take lanes */
#define exp lanes_exp
#define expm1 lanes_expm1
#define log lanes_log
#define log1p lanes_log1p
#define log10 lanes_log10
#define sin lanes_sin
#define cos lanes_cos
#define tan lanes_tan
#define asin lanes_asin
#define acos lanes_acos
#define atan lanes_atan
#define sinh lanes_sinh
#define cosh lanes_cosh
#define tanh lanes_tanh
#define asinh lanes_asinh
#define acosh lanes_acosh
#define atanh lanes_atanh
#define erf lanes_erf
#define pow lanes_pow
#define fmod lanes_fmod
#define atan2 lanes_atan2
#define hypot lanes_hypot
#define fabs __builtin_elementwise_abs
#define sqrt __builtin_elementwise_sqrt
#define floor __builtin_elementwise_floor
#define ceil __builtin_elementwise_ceil
#define copysign __builtin_elementwise_copysign
#define fmax __builtin_elementwise_max
#define fmin __builtin_elementwise_min

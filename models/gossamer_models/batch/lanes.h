/* Numbers for eight cases at once, or as many as LANES says: casadi_real in the C code that CasADi writes.

   A lane is one case. Arithmetic, comparisons and functions act on each lane as the C operators and functions act on a
   double, so a lane holds the same bits as that case alone. A truth value is 1 or 0, as in CasADi. code.py replaces what
   the operators of C cannot do with vectors (!, <, &&, ?: and tables that are looked up) by what stands here: macros, since a
   function that takes a vector is of one set of instructions, and the loops of FMUs are compiled for two. */

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF /* no fused multiply-add: the same numbers everywhere */
#pragma clang diagnostic ignored "-Wpsabi"
#endif

#ifndef LANES
#define LANES 8
#endif
#if LANES == 1 /* for compilers that have no vectors as clang has them */
typedef double lanes;
#define truth(m) ((double)(m))
#define LANE(a, l) (*(&(a) + (l)))
#else
typedef double lanes __attribute__((ext_vector_type(LANES)));
typedef int64_t mask __attribute__((ext_vector_type(LANES))); /* each lane -1 or 0 */
#define truth(m) ((lanes)((m) & (mask)(lanes)(1.0)))
#define LANE(a, l) ((a)[l])
#endif

#define holds(a) ((a) != 0.0)
#define is_less(a, b) truth((a) < (b))
#define is_at_most(a, b) truth((a) <= (b))
#define is_equal(a, b) truth((a) == (b))
#define is_different(a, b) truth((a) != (b))
#define holds_both(a, b) truth(holds(a) & holds(b))
#define either(a, b) truth(holds(a) | holds(b))
#define is_not(a) truth((a) == 0.0)
#define where(m, yes, no) ((m) ? (lanes)(yes) : (lanes)(no))
#define where_holds(a, yes) where(holds(a), yes, 0.0)
#define is_finite(a) ((a) - (a) == 0.0)

/* table[(int) place], not a number outside the table */
#define looked_up(table, size, place)                                                               \
  ({                                                                                                \
    lanes at_ = (place), found_;                                                                    \
    for (int l_ = 0; l_ < LANES; l_++) {                                                            \
      double place_ = LANE(at_, l_);                                                                \
      LANE(found_, l_) = place_ > -1.0 && place_ < (size) ? LANE((table)[(int)place_], l_) : NAN;   \
    }                                                                                               \
    found_;                                                                                         \
  })
#define lanes_sign(a)                                                                               \
  ({                                                                                                \
    lanes sign_ = (a);                                                                              \
    where(sign_ < 0.0, -1.0, where(sign_ > 0.0, 1.0, sign_));                                       \
  })

#if LANES > 1
#define EACH_LANE(function, a)                                                                      \
  ({                                                                                                \
    lanes a_ = (a), result_;                                                                        \
    for (int l_ = 0; l_ < LANES; l_++) result_[l_] = function(a_[l_]);                              \
    result_;                                                                                        \
  })
#define EACH_PAIR(function, a, b)                                                                   \
  ({                                                                                                \
    lanes a_ = (a), b_ = (b), result_;                                                              \
    for (int l_ = 0; l_ < LANES; l_++) result_[l_] = function(a_[l_], b_[l_]);                      \
    result_;                                                                                        \
  })

/* from here on the names of C's functions take lanes; within its own macro a name is the function */
#define exp(a) EACH_LANE(exp, a)
#define expm1(a) EACH_LANE(expm1, a)
#define log(a) EACH_LANE(log, a)
#define log1p(a) EACH_LANE(log1p, a)
#define log10(a) EACH_LANE(log10, a)
#define sin(a) EACH_LANE(sin, a)
#define cos(a) EACH_LANE(cos, a)
#define tan(a) EACH_LANE(tan, a)
#define asin(a) EACH_LANE(asin, a)
#define acos(a) EACH_LANE(acos, a)
#define atan(a) EACH_LANE(atan, a)
#define sinh(a) EACH_LANE(sinh, a)
#define cosh(a) EACH_LANE(cosh, a)
#define tanh(a) EACH_LANE(tanh, a)
#define asinh(a) EACH_LANE(asinh, a)
#define acosh(a) EACH_LANE(acosh, a)
#define atanh(a) EACH_LANE(atanh, a)
#define erf(a) EACH_LANE(erf, a)
#define pow(a, b) EACH_PAIR(pow, a, b)
#define fmod(a, b) EACH_PAIR(fmod, a, b)
#define atan2(a, b) EACH_PAIR(atan2, a, b)
#define hypot(a, b) EACH_PAIR(hypot, a, b)
#define fabs __builtin_elementwise_abs
#define sqrt __builtin_elementwise_sqrt
#define floor __builtin_elementwise_floor
#define ceil __builtin_elementwise_ceil
#define copysign __builtin_elementwise_copysign
#define fmax __builtin_elementwise_max
#define fmin __builtin_elementwise_min
#endif

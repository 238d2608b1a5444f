/* Sums over the elements of a mesh, for two sets of instructions; what functions.h calls run_loop.

   sum.h is compiled for every processor of the platform and, on x86-64, for those with AVX2: the same operations in the same
   order, so the same bits. Which one runs is chosen when the library is loaded. ONE_INSTRUCTION_SET leaves the second out.
   Last in fmi2.c and fmi3.c, as the names of C's functions take lanes from here on. */

#if defined(__clang__)
#define LANES BLOCK
#else
#define LANES 1 /* element by element */
#endif
#include "lanes.h"
#undef casadi_real
#define casadi_real lanes

typedef struct {
  int (*element)(const lanes **arg, lanes **res, casadi_int *iw, lanes *w, int mem);
  int elements, nodes, shared, columns, own; /* numbers of each, and of columns of shared numbers */
  int forces, n_f;                  /* on how many of an element's nodes the first result is forces, its length in all */
  const char *reductions;           /* of each further result: l largest, s sum */
  size_t numbers, places;           /* where its part of the tables begins */
} Loop;

#include "loops.h" /* the largest sizes of all loops, prefixes of names, constants */

#undef CODEGEN_PREFIX
#define CODEGEN_PREFIX BASELINE
#include "sum.h"

#if defined(__x86_64__) && LANES > 1 && !defined(ONE_INSTRUCTION_SET)
#include <cpuid.h>
#undef CODEGEN_PREFIX
#define CODEGEN_PREFIX AVX2
#pragma clang attribute push(__attribute__((target("avx2"))), apply_to = function)
#include "sum.h"
#pragma clang attribute pop

static bool has_avx2(void) { /* the processor has it, and the system saves its registers */
  unsigned a, b, c, d, saved, high;
  if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE)) return false;
  __asm__("xgetbv" : "=a"(saved), "=d"(high) : "c"(0));
  return (saved & 6) == 6 && __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & bit_AVX2);
}

static int (*run_loop)(int which, const double **arg, double **res) = CASADI_NAMESPACE_CONCAT(BASELINE, run);

__attribute__((constructor)) static void choose_loop(void) {
  if (has_avx2()) run_loop = CASADI_NAMESPACE_CONCAT(AVX2, run);
}
#else
static int (*run_loop)(int which, const double **arg, double **res) = CASADI_PREFIX(run);
#endif

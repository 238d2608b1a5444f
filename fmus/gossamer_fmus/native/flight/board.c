/* Start of an MPS2 AN500 (Cortex-M7) without an operating system; printf goes to the host by semihosting. */
#include "board.h"

#include <stdlib.h>

#define PAINT 0xA5A5A5A5U

extern uint32_t __bss_start__[], __bss_end__[], __stack_limit[], __stack_top[];
extern int main(void);
extern void initialise_monitor_handles(void);

static void stop(void) { exit(99); }

void reset(void) {
  *(volatile uint32_t *)0xE000ED88U |= 0xFU << 20; /* floating point on */
  __asm volatile("dsb\n isb");
  for (uint32_t *p = __bss_start__; p < __bss_end__; p++) *p = 0U;
  for (uint32_t *p = __stack_limit; p < (uint32_t *)__builtin_frame_address(0) - 16; p++) *p = PAINT;
  *(volatile uint32_t *)0xE000E014U = 0xFFFFFFU; /* SysTick: reload, clear, processor's clock */
  *(volatile uint32_t *)0xE000E018U = 0U;
  *(volatile uint32_t *)0xE000E010U = 5U;
  initialise_monitor_handles();
  exit(main());
}

uint32_t board_stack(void) {
  const uint32_t *p = __stack_limit;
  while (*p == PAINT) p++;
  return (uint32_t)(__stack_top - p) * 4U;
}

__attribute__((section(".vectors"), used)) static const void *const VECTORS[] = {
    __stack_top, (const void *)reset, (const void *)stop, (const void *)stop, (const void *)stop, (const void *)stop, (const void *)stop,
};

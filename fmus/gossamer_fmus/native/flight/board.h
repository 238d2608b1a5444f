/* MPS2 AN500, a Cortex-M7: instructions by SysTick under `qemu-system-arm -icount shift=0`, where one takes 1 ns. */
#include <stdint.h>

#define SYST_CVR (*(volatile uint32_t *)0xE000E018U)
#define BOARD_COUNT() SYST_CVR
/* SysTick counts 25 MHz down from 2^24 - 1: 40 instructions each */
#define BOARD_PASSED(begin, end) ((((begin) - (end)) & 0xFFFFFFU) * 40U)

uint32_t board_stack(void); /* most of the stack that was in use so far [byte] */

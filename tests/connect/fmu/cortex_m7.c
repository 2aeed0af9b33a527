/* Startup of the emulated board mps2-an500, and what a step of the steering takes.
 *
 * The linker lets the example call the function __wrap_steering_step. SysTick counts at 25 MHz, and under -icount
 * shift=0 an instruction takes 1 ns: a tick is 40 instructions. */

#include <stdint.h>
#include <stdio.h>

#include "steering.h"

enum { INSTRUCTIONS_PER_TICK = 40, RELOAD = 0xFFFFFF, PAINTED = 2048 /* words */, PAINT = 0xA5A5A5A5 };
#define REGISTER(address) (*(volatile uint32_t *)(address))
#define SYST_CSR REGISTER(0xE000E010)
#define SYST_RVR REGISTER(0xE000E014)
#define SYST_CVR REGISTER(0xE000E018)

void _start(void);
void reset(void);
int __real_steering_step(struct steering *s);

__attribute__((section(".vectors"), used)) static void (*const vectors[])(void) = {(void (*)(void))0x400000, reset};

/* The coprocessors 10 and 11 are the floating-point unit; CPACR of the ARMv7-M Architecture Reference Manual, B3.2.20. */
__attribute__((naked)) void reset(void)
{
    __asm__("ldr r0, =0xE000ED88\n ldr r1, [r0]\n orr r1, r1, #0xF00000\n str r1, [r0]\n dsb\n isb\n b _start\n");
}

__attribute__((noinline)) int __wrap_steering_step(struct steering *s)
{
    static double samples, sum, most, deepest;
    volatile uint32_t *top = (volatile uint32_t *)__builtin_frame_address(0) - 32, *p;
    for (p = top - PAINTED; p < top; p++)
        *p = PAINT;
    SYST_RVR = RELOAD;
    SYST_CSR = 5; /* enabled, at the clock of the processor */
    uint32_t before = SYST_CVR;
    int finite = __real_steering_step(s);
    double taken = INSTRUCTIONS_PER_TICK * (double)((before - SYST_CVR) & RELOAD);
    for (p = top - PAINTED; *p == PAINT; p++)
        ;
    double depth = 4.0 * (double)(top - p);
    samples++, sum += taken, most = taken > most ? taken : most, deepest = depth > deepest ? depth : deepest;
    printf("%.17g %.17g %.17g ", sum / samples, most, deepest); /* in front of the line that the example prints */
    return finite;
}

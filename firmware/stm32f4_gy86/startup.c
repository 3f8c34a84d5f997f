/* What runs before main: memory as C wants it, and the table of the interrupts. */
#include <stdint.h>

#include "registers.h"

extern uint32_t data_load, data_begin, data_end, bss_begin, bss_end, stack_top;

int main(void);
void usart2_interrupt(void);
void reset(void);

/* A fault starts the device anew; its announcement with another number tells so. */
static void fault(void)
{
    *(volatile uint32_t *)0xE000ED0C = 0x05FA0004;
    for (;;)
        ;
}

void reset(void)
{
    for (uint32_t *from = &data_load, *to = &data_begin; to < &data_end;)
        *to++ = *from++;
    for (uint32_t *to = &bss_begin; to < &bss_end;)
        *to++ = 0;
    main();
    fault();
}

typedef void (*vector)(void);

#define FAULTS 15
__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    vector core[FAULTS];
    vector interrupts[USART2_INTERRUPT + 1];
} vectors = {
    &stack_top,
    {reset, fault, fault, fault, fault, fault, 0, 0, 0, 0, fault, fault, 0, fault, fault},
    {[USART2_INTERRUPT] = usart2_interrupt},
};

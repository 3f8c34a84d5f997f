/* The STM32F4's clock, serial line and I2C bus, as device/board.h wants them. */
#ifndef STM32F4_H
#define STM32F4_H

#include <stdint.h>

/* Starts clocks, line and bus. */
void stm32f4_start(void);

/* Another number after each reset: counted in a register that a reset leaves alone, from noise on when the supply was away. */
uint8_t stm32f4_start_number(void);

void stm32f4_bus_start(void);

/* Of the buses that feed USART 2, I2C 1 and timer 2, Hz. */
extern uint32_t stm32f4_bus_clock;

#endif

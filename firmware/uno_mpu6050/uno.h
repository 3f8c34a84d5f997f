/* The Arduino Uno's clock, serial line and I2C bus, as device/board.h wants them. */
#ifndef UNO_H
#define UNO_H

#include <stdint.h>

/* Starts clock, line and bus, and lets interrupts come. */
void uno_start(void);

/* Another number after each reset: counted in the EEPROM. */
uint8_t uno_start_number(void);

void uno_bus_start(void);

#endif

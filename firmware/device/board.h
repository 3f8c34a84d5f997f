/* What a board supplies: a clock, an I2C bus, a serial line. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

/* How long a tick of the clock is, ns: a whole part of a millisecond. */
extern const uint32_t board_tick_ns;

/* Ticks since the start, modulo 2^32. */
uint32_t board_ticks(void);

/* Sends a whole frame, or, if the line is behind, nothing: then false. Returns at once. */
bool board_send(const uint8_t *bytes, uint16_t n);

/* Whether the computer has asked for the announcement, by a byte 0, since this was last called. Returns at once. */
bool board_asked(void);

/* What came of a transfer on the bus. None takes longer than a few milliseconds, whatever the bus does. */
enum bus {
    BUS_OK,
    BUS_NO_ANSWER, /* nothing acknowledges the address, or a byte */
    BUS_STUCK      /* the bus does not go on: a line is held low, or a wire is loose */
};

/* Writes one register of the device at an address. */
enum bus board_write(uint8_t address, uint8_t reg, uint8_t value);
/* Reads n >= 1 registers on end. */
enum bus board_read(uint8_t address, uint8_t reg, uint8_t *values, uint8_t n);
/* Frees a bus that a device holds: clocks it until it lets go, then a stop. */
void board_free_bus(void);

#endif

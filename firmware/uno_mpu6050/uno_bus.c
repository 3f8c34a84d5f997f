/* I2C master at 400 kHz: SDA is A4 (PC4), SCL is A5 (PC5). The module has its own pull-ups, to 3.3 V. */
#include <avr/io.h>
#include <util/delay.h>
#include <util/twi.h>

#include "../device/board.h"
#include "uno.h"

#define SDA _BV(PC4)
#define SCL _BV(PC5)
#define LONGEST_WAIT 250 /* ticks, 1 ms: a byte takes 23 us */
#define GO (_BV(TWINT) | _BV(TWEN))

void uno_bus_start(void)
{
    /* No pull-ups to 5 V. */
    PORTC &= (uint8_t) ~(SDA | SCL);
    DDRC &= (uint8_t) ~(SDA | SCL);
    TWSR = 0;
    TWBR = 12;
    TWCR = _BV(TWEN);
}

/* Lets the bus do one thing; whether it came to the state that is wanted. */
static enum bus act(uint8_t control, uint8_t wanted)
{
    TWCR = control;
    uint32_t begin = board_ticks();
    while (!(TWCR & _BV(TWINT)))
        if (board_ticks() - begin > LONGEST_WAIT)
            return BUS_STUCK;
    uint8_t came = TW_STATUS;
    if (came == wanted)
        return BUS_OK;
    return came == TW_MT_SLA_NACK || came == TW_MR_SLA_NACK || came == TW_MT_DATA_NACK ? BUS_NO_ANSWER : BUS_STUCK;
}

static enum bus send(uint8_t byte, uint8_t wanted)
{
    TWDR = byte;
    return act(GO, wanted);
}

static enum bus stop(enum bus bus)
{
    TWCR = GO | _BV(TWSTO);
    uint32_t begin = board_ticks();
    while (TWCR & _BV(TWSTO))
        if (board_ticks() - begin > LONGEST_WAIT)
            return BUS_STUCK;
    return bus;
}

/* Start, address, number of a register. */
static enum bus select(uint8_t address, uint8_t reg)
{
    enum bus bus = act(GO | _BV(TWSTA), TW_START);
    if (bus == BUS_OK)
        bus = send((uint8_t)(address << 1 | TW_WRITE), TW_MT_SLA_ACK);
    if (bus == BUS_OK)
        bus = send(reg, TW_MT_DATA_ACK);
    return bus;
}

enum bus board_write(uint8_t address, uint8_t reg, uint8_t value)
{
    enum bus bus = select(address, reg);
    if (bus == BUS_OK)
        bus = send(value, TW_MT_DATA_ACK);
    return stop(bus);
}

enum bus board_read(uint8_t address, uint8_t reg, uint8_t *values, uint8_t n)
{
    enum bus bus = select(address, reg);
    if (bus == BUS_OK)
        bus = act(GO | _BV(TWSTA), TW_REP_START);
    if (bus == BUS_OK)
        bus = send((uint8_t)(address << 1 | TW_READ), TW_MR_SLA_ACK);
    for (uint8_t k = 0; k < n && bus == BUS_OK; k++) {
        /* The last byte is not acknowledged: then the sensor lets go of the bus. */
        bus = k + 1 < n ? act(GO | _BV(TWEA), TW_MR_DATA_ACK) : act(GO, TW_MR_DATA_NACK);
        values[k] = TWDR;
    }
    return stop(bus);
}

/* A line is let go or pulled low, and given time: 100 kHz. */
static void line(uint8_t mask, bool high)
{
    if (high)
        DDRC &= (uint8_t)~mask;
    else
        DDRC |= mask;
    _delay_us(5);
}

void board_free_bus(void)
{
    TWCR = 0;
    /* A sensor in the middle of a byte holds SDA for nine clocks at most. */
    for (uint8_t k = 0; k < 9; k++) {
        line(SCL, false);
        line(SCL, true);
    }
    line(SCL, false);
    line(SDA, false);
    line(SCL, true);
    line(SDA, true);
    uno_bus_start();
}

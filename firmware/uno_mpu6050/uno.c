#include "uno.h"

#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "../device/board.h"
#include "../device/ring.h"

#define BAUD_REGISTER 16 /* 115200 with U2X at 16 MHz: 2.1 % fast, as the Uno's USB side is with the same divider */

/* Timer 1 at 16 MHz / 64. */
const uint32_t board_tick_ns = 4000;

static volatile uint16_t overflows;
static struct ring line;

ISR(TIMER1_OVF_vect)
{
    overflows++;
}

ISR(USART_UDRE_vect)
{
    uint8_t byte;
    if (ring_take(&line, &byte))
        UDR0 = byte;
    else
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
}

void uno_start(void)
{
    TCCR1A = 0;
    TCCR1B = _BV(CS11) | _BV(CS10);
    TIMSK1 = _BV(TOIE1);
    UCSR0A = _BV(U2X0);
    UBRR0 = BAUD_REGISTER;
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(TXEN0) | _BV(RXEN0);
    uno_bus_start();
    sei();
}

uint8_t uno_start_number(void)
{
    uint8_t *const place = (uint8_t *)0;
    uint8_t number = (uint8_t)(eeprom_read_byte(place) + 1);
    eeprom_write_byte(place, number);
    return number;
}

uint32_t board_ticks(void)
{
    uint16_t high, low;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        low = TCNT1;
        high = overflows;
        /* It has overflowed, but its interrupt waits for this block. */
        if ((TIFR1 & _BV(TOV1)) && low < 0x8000)
            high++;
    }
    return (uint32_t)high << 16 | low;
}

bool board_asked(void)
{
    bool asked = false;
    uint8_t state;
    while ((state = UCSR0A) & _BV(RXC0)) {
        uint8_t byte = UDR0;
        /* A line that is held low is no byte. */
        asked |= byte == 0 && !(state & _BV(FE0));
    }
    return asked;
}

bool board_send(const uint8_t *bytes, uint16_t n)
{
    bool put = ring_put(&line, bytes, n);
    UCSR0B |= _BV(UDRIE0);
    return put;
}

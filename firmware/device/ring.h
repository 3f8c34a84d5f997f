/* Bytes on their way to the serial line: one function puts frames in, one interrupt takes bytes out. */
#ifndef RING_H
#define RING_H

#include <stdbool.h>
#include <stdint.h>

/* 256 bytes, so that a place is a byte: it is read and written at once on every processor, and begins anew by itself. */
struct ring {
    uint8_t bytes[256];
    volatile uint8_t in;  /* where the next byte goes: changed only by the one who puts */
    volatile uint8_t out; /* where the next one stands: changed only by the one who takes */
};

/* Puts all n bytes in, or, if they have no room, none: then false. */
static inline bool ring_put(struct ring *ring, const uint8_t *bytes, uint16_t n)
{
    uint8_t in = ring->in;
    uint8_t free = (uint8_t)(ring->out - in - 1);
    if (n > free)
        return false;
    for (uint16_t k = 0; k < n; k++)
        ring->bytes[in++] = bytes[k];
    /* The compiler must have written the bytes before the other side may see them. */
    __asm__ volatile("" ::: "memory");
    ring->in = in;
    return true;
}

/* Takes a byte; false if there is none. */
static inline bool ring_take(struct ring *ring, uint8_t *byte)
{
    uint8_t out = ring->out;
    if (out == ring->in)
        return false;
    *byte = ring->bytes[out];
    ring->out = (uint8_t)(out + 1);
    return true;
}

#endif

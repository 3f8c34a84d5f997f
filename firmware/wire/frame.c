#include "frame.h"

/* The longest run that one length can tell: 254 bytes and no 0 behind them. */
#define LONGEST_RUN 0xFF

uint16_t frame_check(uint16_t check, uint8_t byte)
{
    /* Eight steps of the polynomial 0x1021 at once, without a table: the remainder of a byte x is
       x' = x ^ (x >> 4) times 2^12 + 2^5 + 1. */
    uint16_t x = check >> 8 ^ byte;
    x ^= x >> 4;
    return (uint16_t)(check << 8 ^ x << 12 ^ x << 5 ^ x);
}

static void put(struct frame *frame, uint8_t byte)
{
    if (frame->n < FRAME_ROOM)
        frame->bytes[frame->n++] = byte;
    else
        frame->too_long = true;
}

/* Ends a run and begins the next one. */
static void next_run(struct frame *frame)
{
    if (frame->too_long)
        return;
    frame->bytes[frame->run] = (uint8_t)(frame->n - frame->run);
    frame->run = frame->n;
    put(frame, 0);
}

static void stuff(struct frame *frame, uint8_t byte)
{
    if (frame->too_long)
        return;
    /* Only before a further byte, so that a run of 254 at the end is not followed by an empty one. */
    if (frame->n - frame->run == LONGEST_RUN)
        next_run(frame);
    if (byte == 0)
        next_run(frame);
    else
        put(frame, byte);
}

void frame_begin(struct frame *frame, uint8_t kind, uint8_t start, uint16_t sequence)
{
    frame->n = 1;
    frame->run = 0;
    frame->check = 0xFFFF;
    frame->too_long = false;
    frame_byte(frame, kind);
    frame_byte(frame, start);
    frame_byte(frame, (uint8_t)sequence);
    frame_byte(frame, (uint8_t)(sequence >> 8));
}

void frame_byte(struct frame *frame, uint8_t byte)
{
    frame->check = frame_check(frame->check, byte);
    stuff(frame, byte);
}

void frame_bytes(struct frame *frame, const uint8_t *bytes, uint16_t n)
{
    for (uint16_t k = 0; k < n; k++)
        frame_byte(frame, bytes[k]);
}

void frame_u32(struct frame *frame, uint32_t number)
{
    for (uint8_t k = 0; k < 4; k++, number >>= 8)
        frame_byte(frame, (uint8_t)number);
}

void frame_float(struct frame *frame, float number)
{
    union {
        float number;
        uint32_t bits;
    } both = {.number = number};
    frame_u32(frame, both.bits);
}

bool frame_end(struct frame *frame)
{
    uint16_t check = frame->check;
    stuff(frame, (uint8_t)check);
    stuff(frame, (uint8_t)(check >> 8));
    if (!frame->too_long)
        frame->bytes[frame->run] = (uint8_t)(frame->n - frame->run);
    put(frame, 0);
    if (frame->too_long)
        frame->n = 0;
    return !frame->too_long;
}

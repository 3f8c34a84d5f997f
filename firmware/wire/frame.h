/* One frame of the wire protocol, docs/wire.md: its check sum and its stuffing are worked out while it is written. */
#ifndef FRAME_H
#define FRAME_H

#include <stdbool.h>
#include <stdint.h>

/* Bytes of room for a frame as it stands on the wire. The protocol allows 1024 and the end. */
#ifndef FRAME_ROOM
#define FRAME_ROOM 128
#endif

struct frame {
    uint8_t bytes[FRAME_ROOM];
    uint16_t n;    /* bytes that stand there */
    uint16_t run;  /* where the length of the present run of bytes other than 0 is to stand */
    uint16_t check; /* CRC-16 so far */
    bool too_long; /* something had no room */
};

/* CRC-16/IBM-3740 of one more byte; it begins with 0xFFFF. */
uint16_t frame_check(uint16_t check, uint8_t byte);

/* Begins a frame: kind, number of the device's start, number of the frame. */
void frame_begin(struct frame *frame, uint8_t kind, uint8_t start, uint16_t sequence);

/* Adds to the payload; numbers go low byte first. */
void frame_byte(struct frame *frame, uint8_t byte);
void frame_bytes(struct frame *frame, const uint8_t *bytes, uint16_t n);
void frame_u32(struct frame *frame, uint32_t number);
void frame_float(struct frame *frame, float number);

/* Adds check sum and end. frame->bytes[0] to [n - 1] go onto the wire; false, and n = 0, if it had no room. */
bool frame_end(struct frame *frame);

#endif

/* What a device sends: announcements, samples and messages of the wire protocol, docs/wire.md.

   A payload is begun, filled and ended; then wire.frame holds the frame. Each frame that is begun has a number, so that one
   that could not be sent is missed. */
#ifndef WIRE_H
#define WIRE_H

#include "frame.h"

#define WIRE_VERSION 1

struct wire {
    uint8_t start;     /* number of the device's start, another one after each reset */
    uint16_t sequence; /* number of the next frame */
    struct frame frame;
};

/* Kinds of numbers in a stream of counts. */
enum wire_number { WIRE_I16 = 0, WIRE_I32 = 1, WIRE_F32 = 2 };

void wire_start(struct wire *wire, uint8_t start);

/* An announcement: its head, then each stream, then wire_end. */
void wire_announcement(struct wire *wire, const char *name, uint32_t tick_ns, uint8_t streams);
void wire_mpu6050(struct wire *wire, float rate, const uint8_t registers[4]);
void wire_hmc5883l(struct wire *wire, float rate, const uint8_t registers[3]);
/* A stream of any other sensor: its head, then each channel. */
void wire_counts(struct wire *wire, float rate, enum wire_number number, uint8_t channels);
void wire_channel(struct wire *wire, const char *name, float scale, float offset, float range);

/* A sample: its head, then the bytes of the streams that `held` has a bit for, then wire_end. */
void wire_sample(struct wire *wire, uint32_t stamp, uint8_t held);
void wire_bytes(struct wire *wire, const uint8_t *bytes, uint8_t n);

/* A message: its beginning, then more of it, then wire_end. */
void wire_message(struct wire *wire, const char *text);
void wire_more(struct wire *wire, const char *text);

/* Ends the frame; false if it had no room. */
bool wire_end(struct wire *wire);

#endif

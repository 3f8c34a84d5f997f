#include "wire.h"

enum { ANNOUNCEMENT = 1, SAMPLE = 2, MESSAGE = 3 };
enum { FORM_COUNTS = 0, FORM_MPU6050 = 1, FORM_HMC5883L = 2 };

static void begin(struct wire *wire, uint8_t kind)
{
    frame_begin(&wire->frame, kind, wire->start, wire->sequence++);
}

static void name(struct wire *wire, const char *text)
{
    uint8_t n = 0;
    while (text[n] != 0 && n < 255)
        n++;
    frame_byte(&wire->frame, n);
    frame_bytes(&wire->frame, (const uint8_t *)text, n);
}

static void stream(struct wire *wire, uint8_t form, float rate)
{
    frame_byte(&wire->frame, form);
    frame_float(&wire->frame, rate);
}

void wire_start(struct wire *wire, uint8_t start)
{
    wire->start = start;
    wire->sequence = 0;
}

void wire_announcement(struct wire *wire, const char *device, uint32_t tick_ns, uint8_t streams)
{
    begin(wire, ANNOUNCEMENT);
    frame_byte(&wire->frame, WIRE_VERSION);
    frame_u32(&wire->frame, tick_ns);
    name(wire, device);
    frame_byte(&wire->frame, streams);
}

void wire_mpu6050(struct wire *wire, float rate, const uint8_t registers[4])
{
    stream(wire, FORM_MPU6050, rate);
    frame_bytes(&wire->frame, registers, 4);
}

void wire_hmc5883l(struct wire *wire, float rate, const uint8_t registers[3])
{
    stream(wire, FORM_HMC5883L, rate);
    frame_bytes(&wire->frame, registers, 3);
}

void wire_counts(struct wire *wire, float rate, enum wire_number number, uint8_t channels)
{
    stream(wire, FORM_COUNTS, rate);
    frame_byte(&wire->frame, (uint8_t)number);
    frame_byte(&wire->frame, channels);
}

void wire_channel(struct wire *wire, const char *column, float scale, float offset, float range)
{
    name(wire, column);
    frame_float(&wire->frame, scale);
    frame_float(&wire->frame, offset);
    frame_float(&wire->frame, range);
}

void wire_sample(struct wire *wire, uint32_t stamp, uint8_t held)
{
    begin(wire, SAMPLE);
    frame_u32(&wire->frame, stamp);
    frame_byte(&wire->frame, held);
}

void wire_bytes(struct wire *wire, const uint8_t *bytes, uint8_t n)
{
    frame_bytes(&wire->frame, bytes, n);
}

void wire_message(struct wire *wire, const char *text)
{
    begin(wire, MESSAGE);
    wire_more(wire, text);
}

void wire_more(struct wire *wire, const char *text)
{
    for (; *text != 0; text++)
        frame_byte(&wire->frame, (uint8_t)*text);
}

bool wire_end(struct wire *wire)
{
    return frame_end(&wire->frame);
}

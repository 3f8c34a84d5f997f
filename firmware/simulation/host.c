/* A device's program on the computer, as a library: its board are functions of the caller's. For tests. */
#include <setjmp.h>
#include <stddef.h>

#include "../device/board.h"
#include "../wire/wire.h"

int program(void); /* the device's main, by another name */

/* Answers as enum bus; values are to be read, or one to be written. */
typedef int (*transfer)(uint8_t address, uint8_t reg, uint8_t *values, uint8_t n);
typedef bool (*line)(const uint8_t *bytes, uint16_t n);

static transfer reads, writes;
static line sends;
static uint8_t start;
static uint64_t now, end; /* ns */
static uint64_t asks_next, asks_every; /* ns */
static unsigned asks_left;
static jmp_buf out;

const uint32_t board_tick_ns = HOST_TICK_NS;

#define LOOK_NS 10000 /* looking at the clock */
#define BYTE_NS 23000 /* a byte on the bus */

/* Runs the program from its start at a time (s) for some time, or until it returns. */
void host_run(double from, double seconds, uint8_t number, transfer read, transfer write, line send)
{
    reads = read;
    writes = write;
    sends = send;
    start = number;
    now = (uint64_t)(from * 1e9);
    end = now + (uint64_t)(seconds * 1e9);
    if (setjmp(out) == 0)
        program();
}

/* When the computer asks for announcements in the run to come: first, how far apart (s), how often. */
void host_ask(double first, double every, unsigned count)
{
    asks_next = (uint64_t)(first * 1e9);
    asks_every = (uint64_t)(every * 1e9);
    asks_left = count;
}

double host_now(void)
{
    return (double)now * 1e-9;
}

uint32_t board_ticks(void)
{
    now += LOOK_NS;
    if (now >= end)
        longjmp(out, 1);
    return (uint32_t)(now / board_tick_ns);
}

bool board_send(const uint8_t *bytes, uint16_t n)
{
    return sends(bytes, n);
}

bool board_asked(void)
{
    bool asked = asks_left > 0 && now >= asks_next;
    if (asked) {
        asks_next += asks_every;
        asks_left--;
    }
    return asked;
}

enum bus board_read(uint8_t address, uint8_t reg, uint8_t *values, uint8_t n)
{
    now += (uint64_t)(n + 3) * BYTE_NS;
    return (enum bus)reads(address, reg, values, n);
}

enum bus board_write(uint8_t address, uint8_t reg, uint8_t value)
{
    now += 3 * BYTE_NS;
    return (enum bus)writes(address, reg, &value, 1);
}

void board_free_bus(void)
{
    now += 22 * 5000;
}

/* What the boards' own headers promise. */
void uno_start(void) {}
uint8_t uno_start_number(void) { return start; }
void stm32f4_start(void) {}
uint8_t stm32f4_start_number(void) { return start; }

/* The encoder by itself. */
struct wire *host_wire(uint8_t number)
{
    static struct wire wire;
    wire_start(&wire, number);
    return &wire;
}

const uint8_t *host_frame(const struct wire *wire, uint16_t *n)
{
    *n = wire->frame.n;
    return wire->frame.bytes;
}

/* Waiting, by the board's clock. */
#ifndef PAUSE_H
#define PAUSE_H

#include "../device/board.h"

static inline uint32_t ticks_of_ms(uint16_t ms)
{
    return ms * (1000000 / board_tick_ns);
}

static inline void pause_ms(uint16_t ms)
{
    uint32_t begin = board_ticks();
    while (board_ticks() - begin < ticks_of_ms(ms))
        ;
}

#endif

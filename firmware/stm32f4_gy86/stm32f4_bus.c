/* I2C master at 400 kHz: SCL is PB8, SDA is PB7. The GY-86 has its own pull-ups. */
#include "../device/board.h"
#include "registers.h"
#include "stm32f4.h"

#define SDA 7
#define SCL 8
#define LONGEST_WAIT 1000 /* ticks, 1 ms: a byte takes 23 us */
#define FAULTS (I2C_SR1_AF | I2C_SR1_BERR | I2C_SR1_ARLO)

enum mode { OUTPUT = 1, FUNCTION = 2 };

static void pin_mode(unsigned pin, enum mode mode)
{
    GPIOB->moder = (GPIOB->moder & ~(3u << 2 * pin)) | (uint32_t)mode << 2 * pin;
}

void stm32f4_bus_start(void)
{
    GPIOB->otyper |= BIT(SDA) | BIT(SCL); /* open drain */
    GPIOB->afr[0] = (GPIOB->afr[0] & ~(15u << 28)) | 4u << 28;
    GPIOB->afr[1] = (GPIOB->afr[1] & ~15u) | 4u;
    pin_mode(SDA, FUNCTION);
    pin_mode(SCL, FUNCTION);
    I2C1_CR1 = I2C_CR1_SWRST;
    I2C1_CR1 = 0;
    I2C1_CR2 = stm32f4_bus_clock / 1000000;
    /* Low for two parts of a clock, high for one; rounded up, so that it is not faster than 400 kHz. */
    I2C1_CCR = I2C_CCR_FAST | ((stm32f4_bus_clock + 3 * 400000 - 1) / (3 * 400000));
    I2C1_TRISE = stm32f4_bus_clock / 1000000 * 300 / 1000 + 1; /* edges of 300 ns */
    I2C1_CR1 = I2C_CR1_PE;
}

/* Waits until all bits of the mask stand in SR1. */
static enum bus comes(uint32_t mask)
{
    uint32_t begin = board_ticks();
    while ((I2C1_SR1 & mask) != mask) {
        uint32_t faults = I2C1_SR1 & FAULTS;
        if (faults) {
            I2C1_SR1 = ~faults & 0xFFFF;
            return faults & I2C_SR1_AF ? BUS_NO_ANSWER : BUS_STUCK;
        }
        if (board_ticks() - begin > LONGEST_WAIT)
            return BUS_STUCK;
    }
    return BUS_OK;
}

/* Start, and the address with the direction; reading SR2 behind it lets the transfer go on. */
static enum bus address_out(uint8_t byte)
{
    I2C1_CR1 |= I2C_CR1_START;
    enum bus bus = comes(I2C_SR1_SB);
    if (bus == BUS_OK) {
        I2C1_DR = byte;
        bus = comes(I2C_SR1_ADDR);
    }
    return bus;
}

static enum bus send(uint8_t byte)
{
    I2C1_DR = byte;
    return comes(I2C_SR1_BTF);
}

static enum bus select(uint8_t address, uint8_t reg)
{
    uint32_t begin = board_ticks();
    while (I2C1_SR2 & I2C_SR2_BUSY)
        if (board_ticks() - begin > LONGEST_WAIT)
            return BUS_STUCK;
    enum bus bus = address_out((uint8_t)(address << 1));
    if (bus == BUS_OK) {
        (void)I2C1_SR2;
        bus = send(reg);
    }
    return bus;
}

enum bus board_write(uint8_t address, uint8_t reg, uint8_t value)
{
    enum bus bus = select(address, reg);
    if (bus == BUS_OK)
        bus = send(value);
    I2C1_CR1 |= I2C_CR1_STOP;
    return bus;
}

enum bus board_read(uint8_t address, uint8_t reg, uint8_t *values, uint8_t n)
{
    enum bus bus = select(address, reg);
    if (bus == BUS_OK) {
        /* The last byte is not acknowledged: of one byte that has to be said before it begins, of more while the one before the
           last is read, which leaves the 23 us of a byte. */
        if (n > 1)
            I2C1_CR1 |= I2C_CR1_ACK;
        else
            I2C1_CR1 &= ~I2C_CR1_ACK;
        bus = address_out((uint8_t)(address << 1 | 1));
    }
    if (bus == BUS_OK) {
        (void)I2C1_SR2;
        if (n == 1)
            I2C1_CR1 |= I2C_CR1_STOP;
        for (uint8_t k = 0; k < n && bus == BUS_OK; k++) {
            bus = comes(I2C_SR1_RXNE);
            if (bus == BUS_OK && k + 2 == n)
                I2C1_CR1 = (I2C1_CR1 & ~I2C_CR1_ACK) | I2C_CR1_STOP;
            values[k] = (uint8_t)I2C1_DR;
        }
    }
    if (bus != BUS_OK)
        I2C1_CR1 |= I2C_CR1_STOP;
    return bus;
}

static void pause_half_clock(void)
{
    uint32_t begin = board_ticks();
    while (board_ticks() - begin < 5)
        ;
}

static void line(unsigned pin, bool high)
{
    GPIOB->bsrr = high ? BIT(pin) : BIT(pin + 16);
    pause_half_clock();
}

void board_free_bus(void)
{
    I2C1_CR1 = 0;
    GPIOB->bsrr = BIT(SDA) | BIT(SCL);
    pin_mode(SDA, OUTPUT);
    pin_mode(SCL, OUTPUT);
    /* A sensor in the middle of a byte holds SDA for nine clocks at most. */
    for (int k = 0; k < 9; k++) {
        line(SCL, false);
        line(SCL, true);
    }
    line(SCL, false);
    line(SDA, false);
    line(SCL, true);
    line(SDA, true);
    stm32f4_bus_start();
}

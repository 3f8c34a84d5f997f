#include "stm32f4.h"

#include "../device/board.h"
#include "../device/ring.h"
#include "registers.h"

#define BAUD 460800
#define INNER_CLOCK 16000000 /* HSI: on every board, whatever crystal it has */
#define LONGEST_WAIT 100000  /* rounds: far more than any clock takes to start */

const uint32_t board_tick_ns = 1000;
uint32_t stm32f4_bus_clock = INNER_CLOCK;

static struct ring line;

static bool comes(volatile uint32_t *reg, uint32_t mask, uint32_t wanted)
{
    for (uint32_t k = 0; k < LONGEST_WAIT; k++)
        if ((*reg & mask) == wanted)
            return true;
    return false;
}

/* 84 MHz, which both an F401 and an F407 can do: 16 MHz / 16 * 336 / 4. Stays at 16 MHz if the PLL does not start. */
static void start_clock(void)
{
    FLASH_ACR = BIT(9) | BIT(10) | 2; /* caches; two wait states for 84 MHz at 3.3 V */
    RCC_PLLCFGR = 16u | 336u << 6 | 1u << 16 | 7u << 24;
    RCC_CR |= RCC_CR_PLLON;
    if (!comes(&RCC_CR, RCC_CR_PLLRDY, RCC_CR_PLLRDY))
        return;
    RCC_CFGR = RCC_CFGR_PPRE1_2 | RCC_CFGR_SW_PLL;
    if (comes(&RCC_CFGR, RCC_CFGR_SWS, RCC_CFGR_SWS_PLL))
        stm32f4_bus_clock = 42000000;
}

/* The function with this number drives a pin. */
static void give_pin(struct gpio *port, unsigned pin, unsigned function)
{
    port->moder = (port->moder & ~(3u << 2 * pin)) | 2u << 2 * pin;
    port->ospeedr |= 2u << 2 * pin;
    port->afr[pin / 8] = (port->afr[pin / 8] & ~(15u << 4 * (pin % 8))) | function << 4 * (pin % 8);
}

static void start_timer(void)
{
    /* A timer of a bus that is divided runs at twice its clock. */
    uint32_t clock = stm32f4_bus_clock == INNER_CLOCK ? INNER_CLOCK : 2 * stm32f4_bus_clock;
    TIM2_PSC = clock / 1000000 - 1;
    TIM2_ARR = 0xFFFFFFFF;
    TIM2_EGR = 1; /* takes the divider over */
    TIM2_CR1 = 1;
}

static void start_line(void)
{
    give_pin(GPIOA, 2, 7);
    give_pin(GPIOA, 3, 7);
    /* Pulled up: a pin that nothing is wired to receives nothing. */
    GPIOA->pupdr = (GPIOA->pupdr & ~(3u << 2 * 3)) | 1u << 2 * 3;
    USART2_BRR = (stm32f4_bus_clock + BAUD / 2) / BAUD;
    USART2_CR1 = USART_CR1_UE | USART_CR1_TE | USART_CR1_RE;
    NVIC_ISER[USART2_INTERRUPT / 32] = BIT(USART2_INTERRUPT % 32);
}

void stm32f4_start(void)
{
    start_clock();
    RCC_AHB1ENR |= RCC_AHB1ENR_GPIOA | RCC_AHB1ENR_GPIOB;
    RCC_APB1ENR |= RCC_APB1ENR_TIM2 | RCC_APB1ENR_USART2 | RCC_APB1ENR_I2C1 | RCC_APB1ENR_PWR;
    RCC_APB2ENR |= RCC_APB2ENR_ADC1;
    start_timer();
    start_line();
    stm32f4_bus_start();
}

/* Noise of the converter, read from the thermometer. */
static uint8_t noise(void)
{
    uint32_t mixed = board_ticks();
    ADC_CCR = ADC_CCR_TSVREFE | ADC_CCR_QUARTER;
    ADC1_SMPR1 = 0; /* the shortest sampling: the most noise */
    ADC1_SQR3 = ADC_THERMOMETER;
    ADC1_CR2 = ADC_CR2_ADON;
    for (int k = 0; k < 16; k++) {
        ADC1_CR2 = ADC_CR2_ADON | ADC_CR2_SWSTART;
        if (!comes(&ADC1_SR, ADC_SR_EOC, ADC_SR_EOC))
            break;
        mixed = mixed * 31 + ADC1_DR;
    }
    ADC1_CR2 = 0;
    return (uint8_t)(mixed ^ mixed >> 8);
}

uint8_t stm32f4_start_number(void)
{
    PWR_CR |= PWR_CR_DBP;
    /* Bit 8 tells a number that was written from a register that lost its supply. */
    uint32_t before = RTC_BKP0R;
    uint8_t number = before & BIT(8) ? (uint8_t)(before + 1) : noise();
    RTC_BKP0R = BIT(8) | number;
    return number;
}

uint32_t board_ticks(void)
{
    return TIM2_CNT;
}

void usart2_interrupt(void)
{
    uint8_t byte;
    if (!(USART2_SR & USART_SR_TXE))
        return;
    if (ring_take(&line, &byte))
        USART2_DR = byte;
    else
        USART2_CR1 &= ~USART_CR1_TXEIE;
}

bool board_asked(void)
{
    bool asked = false;
    uint32_t state;
    while ((state = USART2_SR) & USART_SR_RXNE) {
        uint8_t byte = (uint8_t)USART2_DR;
        /* A line that is held low is no byte. */
        asked |= byte == 0 && !(state & USART_SR_FE);
    }
    return asked;
}

bool board_send(const uint8_t *bytes, uint16_t n)
{
    bool put = ring_put(&line, bytes, n);
    /* The interrupt may end between reading and writing of CR1: it finds nothing to send then, and ends again. */
    USART2_CR1 |= USART_CR1_TXEIE;
    return put;
}

/* Those registers of an STM32F401 or STM32F407 that this program uses (reference manuals RM0368 and RM0090). */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define BIT(n) (1u << (n))

/* Reset and clocks */
#define RCC_CR REGISTER(0x40023800)
#define RCC_PLLCFGR REGISTER(0x40023804)
#define RCC_CFGR REGISTER(0x40023808)
#define RCC_AHB1ENR REGISTER(0x40023830)
#define RCC_APB1ENR REGISTER(0x40023840)
#define RCC_APB2ENR REGISTER(0x40023844)
#define FLASH_ACR REGISTER(0x40023C00)

#define RCC_CR_HSIRDY BIT(1)
#define RCC_CR_PLLON BIT(24)
#define RCC_CR_PLLRDY BIT(25)
#define RCC_CFGR_SW_PLL 2u
#define RCC_CFGR_SWS 0xCu
#define RCC_CFGR_SWS_PLL 8u
#define RCC_CFGR_PPRE1_2 (4u << 10)
#define RCC_AHB1ENR_GPIOA BIT(0)
#define RCC_AHB1ENR_GPIOB BIT(1)
#define RCC_APB1ENR_TIM2 BIT(0)
#define RCC_APB1ENR_USART2 BIT(17)
#define RCC_APB1ENR_I2C1 BIT(21)
#define RCC_APB1ENR_PWR BIT(28)
#define RCC_APB2ENR_ADC1 BIT(8)

/* Backup domain */
#define PWR_CR REGISTER(0x40007000)
#define PWR_CR_DBP BIT(8)
#define RTC_BKP0R REGISTER(0x40002850)

/* Pins */
struct gpio {
    volatile uint32_t moder, otyper, ospeedr, pupdr, idr, odr, bsrr, lckr, afr[2];
};
#define GPIOA ((struct gpio *)0x40020000)
#define GPIOB ((struct gpio *)0x40020400)

/* Timer 2: 32 bits */
#define TIM2_CR1 REGISTER(0x40000000)
#define TIM2_EGR REGISTER(0x40000014)
#define TIM2_CNT REGISTER(0x40000024)
#define TIM2_PSC REGISTER(0x40000028)
#define TIM2_ARR REGISTER(0x4000002C)

/* USART 2 */
#define USART2_SR REGISTER(0x40004400)
#define USART2_DR REGISTER(0x40004404)
#define USART2_BRR REGISTER(0x40004408)
#define USART2_CR1 REGISTER(0x4000440C)
#define USART_SR_TXE BIT(7)
#define USART_SR_RXNE BIT(5)
#define USART_SR_FE BIT(1)
#define USART_CR1_TE BIT(3)
#define USART_CR1_RE BIT(2)
#define USART_CR1_TXEIE BIT(7)
#define USART_CR1_UE BIT(13)
#define USART2_INTERRUPT 38

/* I2C 1 */
#define I2C1_CR1 REGISTER(0x40005400)
#define I2C1_CR2 REGISTER(0x40005404)
#define I2C1_DR REGISTER(0x40005410)
#define I2C1_SR1 REGISTER(0x40005414)
#define I2C1_SR2 REGISTER(0x40005418)
#define I2C1_CCR REGISTER(0x4000541C)
#define I2C1_TRISE REGISTER(0x40005420)
#define I2C_CR1_PE BIT(0)
#define I2C_CR1_START BIT(8)
#define I2C_CR1_STOP BIT(9)
#define I2C_CR1_ACK BIT(10)
#define I2C_CR1_SWRST BIT(15)
#define I2C_SR1_SB BIT(0)
#define I2C_SR1_ADDR BIT(1)
#define I2C_SR1_BTF BIT(2)
#define I2C_SR1_RXNE BIT(6)
#define I2C_SR1_TXE BIT(7)
#define I2C_SR1_BERR BIT(8)
#define I2C_SR1_ARLO BIT(9)
#define I2C_SR1_AF BIT(10)
#define I2C_SR2_BUSY BIT(1)
#define I2C_CCR_FAST BIT(15)

/* Converter 1 */
#define ADC1_SR REGISTER(0x40012000)
#define ADC1_CR2 REGISTER(0x40012008)
#define ADC1_SMPR1 REGISTER(0x4001200C)
#define ADC1_SQR3 REGISTER(0x40012034)
#define ADC1_DR REGISTER(0x4001204C)
#define ADC_CCR REGISTER(0x40012304)
#define ADC_SR_EOC BIT(1)
#define ADC_CR2_ADON BIT(0)
#define ADC_CR2_SWSTART BIT(30)
#define ADC_CCR_TSVREFE BIT(23)
#define ADC_CCR_QUARTER BIT(16) /* of 84 MHz: 36 are allowed */
#define ADC_THERMOMETER 16 /* channel: its last bits are noise */

/* Interrupts */
#define NVIC_ISER ((volatile uint32_t *)0xE000E100)

#endif

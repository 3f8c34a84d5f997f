/* STM32F4 with a GY-86 board (papers A and C): 1000 samples a second, the field in 75 of them, 460800 baud. */
#include "../device/device.h"
#include "stm32f4.h"

/* One measurement each, 75 Hz if it were continuous; 1.3 gauss. */
static const struct hmc5883l magnetometer = {.registers = {0x18, 0x20, HMC5883L_SINGLE}};

static struct device device = {
    .name = "STM32F4 GY-86",
    /* 1 kHz; filter 184 Hz; 500 deg/s; 4 g. A sample is 27 bytes on the wire, 33 with the field: 27.6 of the line's 46 kB/s. */
    .imu = {.address = 0x68, .bypass = true, .registers = {0, 1, 0x08, 0x08}},
    .magnetometer = &magnetometer,
    .magnetometer_rate = 75,
};

int main(void)
{
    stm32f4_start();
    device_start(&device, stm32f4_start_number());
    for (;;)
        device_step(&device);
}

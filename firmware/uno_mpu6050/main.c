/* Arduino Uno with an MPU6050 (paper B): 200 samples a second on the USB port, 115200 baud. */
#include "../device/device.h"
#include "uno.h"

static struct device device = {
    .name = "Uno MPU6050",
    /* 200 Hz; filter 44 Hz; 250 deg/s; 2 g. A sample is 27 bytes on the wire: 5.4 of the line's 11.5 kB/s. */
    .imu = {.address = 0x68, .registers = {4, 3, 0x00, 0x00}},
};

int main(void)
{
    uno_start();
    device_start(&device, uno_start_number());
    for (;;)
        device_step(&device);
}

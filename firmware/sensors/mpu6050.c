#include "mpu6050.h"

#include "pause.h"

enum {
    SMPLRT_DIV = 0x19,
    INT_PIN_CFG = 0x37,
    INT_ENABLE = 0x38,
    INT_STATUS = 0x3A,
    ACCEL_XOUT_H = 0x3B,
    PWR_MGMT_1 = 0x6B,
    WHO_AM_I = 0x75
};

#define DEVICE_RESET 0x80
#define CLOCK_OF_GYRO 0x01 /* steadier than the oscillator; awake */
#define I2C_BYPASS 0x02
#define DATA_READY 0x01
#define IDENTITY 0x68 /* whatever AD0 is */

static enum mpu6050_fault fault_of(enum bus bus)
{
    return bus == BUS_OK ? MPU6050_OK : bus == BUS_NO_ANSWER ? MPU6050_NO_ANSWER : MPU6050_STUCK;
}

enum mpu6050_fault mpu6050_set_up(const struct mpu6050 *sensor)
{
    uint8_t value = 0;
    enum bus bus = board_read(sensor->address, WHO_AM_I, &value, 1);
    if (bus != BUS_OK)
        return fault_of(bus);
    if (value != IDENTITY)
        return MPU6050_OTHER_CHIP;
    bus = board_write(sensor->address, PWR_MGMT_1, DEVICE_RESET);
    /* Section 4.28 of the register map: 100 ms; and 30 ms until the gyro has started. */
    pause_ms(100);
    if (bus == BUS_OK)
        bus = board_write(sensor->address, PWR_MGMT_1, CLOCK_OF_GYRO);
    pause_ms(50);
    for (uint8_t k = 0; k < 4 && bus == BUS_OK; k++)
        bus = board_write(sensor->address, (uint8_t)(SMPLRT_DIV + k), sensor->registers[k]);
    if (bus == BUS_OK)
        bus = board_write(sensor->address, INT_PIN_CFG, sensor->bypass ? I2C_BYPASS : 0);
    if (bus == BUS_OK)
        bus = board_write(sensor->address, INT_ENABLE, DATA_READY);
    /* What is announced must be what the sensor does. */
    uint8_t set[4];
    if (bus == BUS_OK)
        bus = board_read(sensor->address, SMPLRT_DIV, set, 4);
    for (uint8_t k = 0; k < 4 && bus == BUS_OK; k++)
        if (set[k] != sensor->registers[k])
            return MPU6050_NOT_SET;
    return fault_of(bus);
}

float mpu6050_rate(const struct mpu6050 *sensor)
{
    return 1000.0f / (float)(sensor->registers[0] + 1);
}

enum bus mpu6050_ready(const struct mpu6050 *sensor, bool *ready)
{
    uint8_t status = 0;
    enum bus bus = board_read(sensor->address, INT_STATUS, &status, 1);
    *ready = bus == BUS_OK && (status & DATA_READY) != 0;
    return bus;
}

enum bus mpu6050_read(const struct mpu6050 *sensor, uint8_t values[MPU6050_BYTES])
{
    /* In one transfer, so that all of it is of the same instant. */
    return board_read(sensor->address, ACCEL_XOUT_H, values, MPU6050_BYTES);
}

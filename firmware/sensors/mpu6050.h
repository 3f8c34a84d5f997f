/* MPU6050: accelerometer, thermometer, gyro (register map RM-MPU-6000A-00). */
#ifndef MPU6050_H
#define MPU6050_H

#include "../device/board.h"

#define MPU6050_BYTES 14 /* registers 0x3B to 0x48 */

struct mpu6050 {
    uint8_t address; /* 0x68; 0x69 with pin AD0 high */
    bool bypass;     /* its second bus is joined to the first: for the HMC5883L of a GY-86 */
    /* SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG. CONFIG is 1 to 6: with its filter on, the sensor samples at 1 kHz
       divided by SMPLRT_DIV + 1. */
    uint8_t registers[4];
};

enum mpu6050_fault { MPU6050_OK, MPU6050_NO_ANSWER, MPU6050_STUCK, MPU6050_OTHER_CHIP, MPU6050_NOT_SET };

/* Resets, wakes and sets it; takes 0.15 s. */
enum mpu6050_fault mpu6050_set_up(const struct mpu6050 *sensor);

/* Samples a second. */
float mpu6050_rate(const struct mpu6050 *sensor);

/* Whether it has a sample that was not read yet. Asking takes that back. */
enum bus mpu6050_ready(const struct mpu6050 *sensor, bool *ready);
enum bus mpu6050_read(const struct mpu6050 *sensor, uint8_t values[MPU6050_BYTES]);

#endif

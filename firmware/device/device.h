/* The loop of every device here: reads an MPU6050, and a magnetometer if it has one, and sends what it read. */
#ifndef DEVICE_H
#define DEVICE_H

#include "../sensors/hmc5883l.h"
#include "../sensors/mpu6050.h"
#include "../wire/wire.h"

/* A sensor that stays away is tried again once a second. */
struct presence {
    bool set_up;
    bool tried;
    uint32_t at; /* ticks when it was last tried, or last gave a sample */
};

struct device {
    /* To be filled in by the program. */
    const char *name;
    struct mpu6050 imu;
    const struct hmc5883l *magnetometer; /* none: 0 */
    uint8_t magnetometer_rate;           /* Hz */

    /* The loop's own. */
    struct wire wire;
    struct presence imu_is, magnetometer_is;
    uint32_t announced;
    bool wanted;    /* the computer has asked for an announcement */
    uint32_t asked; /* ticks when the magnetometer was last told to measure */
    bool measuring;
};

/* Begins, with a number that is another one after each reset, by announcing itself. */
void device_start(struct device *device, uint8_t start);

/* Goes round once: sends a sample if the sensor has a new one. To be called on and on. */
void device_step(struct device *device);

#endif

/* An MPU6050 that is tilted: the registers that a program reads and writes. */
#ifndef MPU6050_MODEL_H
#define MPU6050_MODEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Attitude at a time; it swings from one to the next. */
struct pose {
    double t, roll, pitch; /* s, rad */
};

struct mpu6050_model {
    const struct pose *course; /* in the order of time; the first pose holds before it, the last one after it */
    size_t poses;
    uint8_t registers[128];
    uint8_t at;     /* register that comes next */
    bool has_at;    /* it was told which one */
    double awake;   /* time from which it samples, s */
    int64_t sample; /* number of the last sample since then; -1: none */
};

/* As it is when it gets its supply: asleep. */
void model_reset(struct mpu6050_model *model);

/* A transfer begins at time t: the readings stand still until the next one. */
void model_begin(struct mpu6050_model *model, double t);
void model_write(struct mpu6050_model *model, double t, uint8_t byte);
uint8_t model_read(struct mpu6050_model *model);

#endif

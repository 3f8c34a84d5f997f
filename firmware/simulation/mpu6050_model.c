#include "mpu6050_model.h"

#include <math.h>
#include <string.h>

enum {
    SMPLRT_DIV = 0x19,
    CONFIG = 0x1A,
    GYRO_CONFIG = 0x1B,
    ACCEL_CONFIG = 0x1C,
    INT_STATUS = 0x3A,
    ACCEL_XOUT_H = 0x3B,
    PWR_MGMT_1 = 0x6B,
    WHO_AM_I = 0x75
};

#define ADDRESS 0x68
#define RESET 0x80
#define SLEEP 0x40
#define TEMPERATURE 25.0 /* degC */
#define DEGREES (180.0 / M_PI)

void model_reset(struct mpu6050_model *model)
{
    memset(model->registers, 0, sizeof model->registers);
    model->registers[PWR_MGMT_1] = SLEEP;
    model->registers[WHO_AM_I] = ADDRESS;
    model->has_at = false;
    model->sample = -1;
}

/* Samples a second: the gyro's rate, divided. */
static double rate(const struct mpu6050_model *model)
{
    uint8_t filter = model->registers[CONFIG] & 7;
    return (filter == 0 || filter == 7 ? 8000.0 : 1000.0) / (model->registers[SMPLRT_DIV] + 1);
}

/* Pose and its change (1/s) at a time. */
static struct pose pose(const struct mpu6050_model *model, double t, struct pose *change)
{
    const struct pose *course = model->course;
    size_t k = 0;
    while (k < model->poses && course[k].t <= t)
        k++;
    *change = (struct pose){0};
    if (k == 0 || k == model->poses)
        return course[k == 0 ? 0 : k - 1];
    struct pose a = course[k - 1], b = course[k];
    /* Half a swing, so that it begins and ends at rest. */
    double span = b.t - a.t, phase = M_PI * (t - a.t) / span;
    double part = (1 - cos(phase)) / 2, speed = M_PI / 2 * sin(phase) / span;
    change->roll = (b.roll - a.roll) * speed;
    change->pitch = (b.pitch - a.pitch) * speed;
    return (struct pose){t, a.roll + part * (b.roll - a.roll), a.pitch + part * (b.pitch - a.pitch)};
}

static void put(struct mpu6050_model *model, uint8_t reg, double value)
{
    long count = lround(value);
    count = count > INT16_MAX ? INT16_MAX : count < INT16_MIN ? INT16_MIN : count;
    model->registers[reg] = (uint8_t)(count >> 8);
    model->registers[reg + 1] = (uint8_t)count;
}

/* Readings at a time: with z up, as the board lies on a table, roll and pitch 0 read (0, 0, 1) g. */
static void measure(struct mpu6050_model *model, double t)
{
    struct pose change;
    struct pose now = pose(model, t, &change);
    double force[3] = {-sin(now.pitch), cos(now.pitch) * sin(now.roll), cos(now.pitch) * cos(now.roll)};
    double turn[3] = {change.roll, change.pitch * cos(now.roll), -change.pitch * sin(now.roll)};
    double g = 16384 >> (model->registers[ACCEL_CONFIG] >> 3 & 3);
    /* LSB/(deg/s) of the data sheet; halves would be 32.75 and 16.375. */
    static const double SENSITIVITIES[] = {131.0, 65.5, 32.8, 16.4};
    double degree = SENSITIVITIES[model->registers[GYRO_CONFIG] >> 3 & 3];
    for (uint8_t axis = 0; axis < 3; axis++) {
        put(model, (uint8_t)(ACCEL_XOUT_H + 2 * axis), force[axis] * g);
        put(model, (uint8_t)(ACCEL_XOUT_H + 8 + 2 * axis), turn[axis] * DEGREES * degree);
    }
    put(model, ACCEL_XOUT_H + 6, (TEMPERATURE - 36.53) * 340.0);
}

void model_begin(struct mpu6050_model *model, double t)
{
    model->has_at = false;
    if (model->registers[PWR_MGMT_1] & SLEEP)
        return;
    int64_t sample = (int64_t)floor((t - model->awake) * rate(model));
    if (sample > model->sample) {
        model->sample = sample;
        measure(model, model->awake + (double)sample / rate(model));
        model->registers[INT_STATUS] |= 1;
    }
}

void model_write(struct mpu6050_model *model, double t, uint8_t byte)
{
    if (!model->has_at) {
        model->at = byte & 127;
        model->has_at = true;
        return;
    }
    uint8_t reg = model->at;
    model->at = (model->at + 1) & 127;
    if (reg == PWR_MGMT_1 && byte & RESET) {
        model_reset(model);
        return;
    }
    /* Readings, states and the identity cannot be written. */
    if (reg == WHO_AM_I || (reg >= INT_STATUS && reg < ACCEL_XOUT_H + 14))
        return;
    model->registers[reg] = byte;
    if (reg == PWR_MGMT_1 || reg == SMPLRT_DIV || reg == CONFIG) {
        model->awake = t;
        model->sample = 0;
    }
}

uint8_t model_read(struct mpu6050_model *model)
{
    uint8_t reg = model->at;
    uint8_t value = model->registers[reg];
    model->at = (model->at + 1) & 127;
    if (reg == INT_STATUS)
        model->registers[INT_STATUS] = 0;
    return value;
}

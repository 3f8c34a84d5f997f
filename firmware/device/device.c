#include "device.h"

#include "../sensors/pause.h"

#define STREAM_IMU 1
#define STREAM_MAGNETOMETER 2

/* A sensor that has been silent for this long has lost its settings, or its wires. */
#define SILENCE_MS 200
#define AGAIN_MS 1000
#define ANNOUNCE_MS 1000
/* Between two that were asked for: asked without a pause, announcements take 7 % of the line. */
#define WANTED_MS 50
/* A measurement of the HMC5883L takes 6 ms. */
#define MEASUREMENT_MS 6

static bool since(uint32_t ticks, uint16_t ms)
{
    return board_ticks() - ticks >= ticks_of_ms(ms);
}

/* A frame that has no room on the line is left out: its number tells the receiver. */
static void send(struct device *device)
{
    if (wire_end(&device->wire))
        board_send(device->wire.frame.bytes, device->wire.frame.n);
}

static void announce(struct device *device)
{
    device->announced = board_ticks();
    device->wanted = false;
    wire_announcement(&device->wire, device->name, board_tick_ns, device->magnetometer ? 2 : 1);
    wire_mpu6050(&device->wire, mpu6050_rate(&device->imu), device->imu.registers);
    if (device->magnetometer)
        wire_hmc5883l(&device->wire, (float)device->magnetometer_rate, device->magnetometer->registers);
    send(device);
}

static void say(struct device *device, const char *sensor, const char *what)
{
    wire_message(&device->wire, sensor);
    wire_more(&device->wire, what);
    send(device);
}

static const char *words(enum bus bus)
{
    return bus == BUS_NO_ANSWER ? ": no answer; look at its wires, its supply and its address"
                                : ": the bus does not go on; look at SDA and SCL and their pull-ups";
}

/* Says what is wrong, and lets the sensor be set up anew. */
static void lose(struct device *device, struct presence *sensor, const char *name, const char *what)
{
    sensor->set_up = false;
    sensor->tried = true;
    sensor->at = board_ticks();
    say(device, name, what);
    board_free_bus();
}

/* Whether it is time to set a sensor up. */
static bool is_due(const struct presence *sensor)
{
    return !sensor->set_up && (!sensor->tried || since(sensor->at, AGAIN_MS));
}

static void found(struct presence *sensor)
{
    sensor->set_up = true;
    sensor->at = board_ticks();
}

static void set_up_imu(struct device *device)
{
    const char *what = 0;
    switch (mpu6050_set_up(&device->imu)) {
    case MPU6050_OK:
        found(&device->imu_is);
        /* Behind its bypass: reset with it, or not reachable until now. */
        device->magnetometer_is.set_up = device->magnetometer_is.tried = false;
        return;
    case MPU6050_NO_ANSWER:
        what = words(BUS_NO_ANSWER);
        break;
    case MPU6050_STUCK:
        what = words(BUS_STUCK);
        break;
    case MPU6050_OTHER_CHIP:
        what = ": WHO_AM_I is not 0x68: this is another chip";
        break;
    case MPU6050_NOT_SET:
        what = ": does not keep its settings";
        break;
    }
    lose(device, &device->imu_is, "MPU6050", what);
}

static void set_up_magnetometer(struct device *device)
{
    const char *what = 0;
    switch (hmc5883l_set_up(device->magnetometer)) {
    case HMC5883L_OK:
        found(&device->magnetometer_is);
        device->measuring = true;
        device->asked = board_ticks();
        return;
    case HMC5883L_NO_ANSWER:
        what = words(BUS_NO_ANSWER);
        break;
    case HMC5883L_STUCK:
        what = words(BUS_STUCK);
        break;
    case HMC5883L_OTHER_CHIP:
        what = ": identification is not H43: this is another chip";
        break;
    }
    lose(device, &device->magnetometer_is, "HMC5883L", what);
}

/* Reads the magnetometer when it is due; whether there is a field. */
static bool read_magnetometer(struct device *device, uint8_t field[HMC5883L_BYTES])
{
    bool ready = false;
    enum bus bus = BUS_OK;
    if (device->measuring && since(device->asked, MEASUREMENT_MS)) {
        bus = hmc5883l_ready(&ready);
        if (ready)
            bus = hmc5883l_read(field);
        if (ready && bus == BUS_OK) {
            device->measuring = false;
            device->magnetometer_is.at = board_ticks();
        }
    } else if (!device->measuring) {
        uint32_t period = ticks_of_ms(1000) / device->magnetometer_rate;
        if (board_ticks() - device->asked >= period) {
            bus = hmc5883l_measure(device->magnetometer);
            /* From where it was due, so that lateness does not add up; but no burst after a gap. */
            device->asked = board_ticks() - device->asked < 2 * period ? device->asked + period : board_ticks();
            device->measuring = true;
        }
    }
    if (bus != BUS_OK)
        lose(device, &device->magnetometer_is, "HMC5883L", words(bus));
    else if (since(device->magnetometer_is.at, SILENCE_MS))
        lose(device, &device->magnetometer_is, "HMC5883L", ": does not measure");
    return ready && bus == BUS_OK;
}

static void read_imu(struct device *device)
{
    uint8_t values[MPU6050_BYTES], field[HMC5883L_BYTES];
    bool ready, has_field = false;
    enum bus bus = mpu6050_ready(&device->imu, &ready);
    uint32_t stamp = board_ticks();
    if (ready)
        bus = mpu6050_read(&device->imu, values);
    if (bus != BUS_OK) {
        lose(device, &device->imu_is, "MPU6050", words(bus));
        return;
    }
    if (!ready) {
        if (since(device->imu_is.at, SILENCE_MS))
            lose(device, &device->imu_is, "MPU6050", ": no sample for 0.2 s; it is set up anew");
        return;
    }
    device->imu_is.at = stamp;
    if (device->magnetometer_is.set_up)
        has_field = read_magnetometer(device, field);
    wire_sample(&device->wire, stamp, has_field ? STREAM_IMU | STREAM_MAGNETOMETER : STREAM_IMU);
    wire_bytes(&device->wire, values, MPU6050_BYTES);
    if (has_field)
        wire_bytes(&device->wire, field, HMC5883L_BYTES);
    send(device);
}

void device_start(struct device *device, uint8_t start)
{
    device->imu_is = device->magnetometer_is = (struct presence){0};
    device->measuring = false;
    wire_start(&device->wire, start);
    announce(device);
}

void device_step(struct device *device)
{
    device->wanted |= board_asked();
    if (since(device->announced, device->wanted ? WANTED_MS : ANNOUNCE_MS))
        announce(device);
    if (is_due(&device->imu_is))
        set_up_imu(device);
    if (!device->imu_is.set_up)
        return;
    if (device->magnetometer && is_due(&device->magnetometer_is))
        set_up_magnetometer(device);
    read_imu(device);
}

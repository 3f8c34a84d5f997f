/* The Uno without hardware: its program under simavr, an MPU6050 that is tilted on its I2C bus, a pseudo terminal as its
   serial line.

       uno_simulation FIRMWARE.elf [--course FILE] [--away FROM TO] [--seconds S] [--fast]

   Prints the terminal's path, and runs for S simulated seconds or until it is stopped: in real time, or, with --fast, as fast
   as it can. It begins when the terminal is opened; a full one holds it up, so that a slow reader loses nothing. FILE has a line "t roll pitch"
   (s, deg) for each pose; the tilt swings from one to the next. The sensor acknowledges nothing between FROM and TO (s), as if its wires were off, and is as after
   power-up when it comes back. */
#include <avr_twi.h>
#include <avr_uart.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <sim_avr.h>
#include <sim_elf.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "mpu6050_model.h"

#define ADDRESS 0x68
/* Of the ATmega328P's bus. */
enum {
    STATUS_REGISTER = 0xB9,
    CONTROL_REGISTER = 0xBC,
    DONE = 0x80, /* TWINT: 1 when the bus has done what it was told; writing 1 takes it back and tells it to go on */
    ADDRESS_ACKNOWLEDGED = 0x18,
    ADDRESS_REFUSED = 0x20,
    DATA_ACKNOWLEDGED = 0x28,
    DATA_REFUSED = 0x30
};
#define POSES 1000
#define CLOCK 16000000 /* Hz */
#define PATIENCE 1000  /* hundredths of a second for a reader to read the rest */
#define LATE 0.05      /* s of real time behind which it does not try to catch up */

struct simulation {
    avr_t *avr;
    avr_irq_t *bus;
    struct mpu6050_model model;
    struct pose poses[POSES];
    double away_from, away_to;
    double until;
    bool selected;
    bool addressed; /* an address to write to was the last thing on the bus */
    int terminal;
    char path[64]; /* of the reader's end */
};

static void give_up(const char *what)
{
    fprintf(stderr, "uno_simulation: %s\n", what);
    exit(2);
}

/* What simavr says goes where it does not disturb: standard output is for the path. */
static void log_line(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr;
    if (level <= LOG_WARNING)
        vfprintf(stderr, format, arguments);
}

static double now(const struct simulation *simulation)
{
    return (double)simulation->avr->cycle / CLOCK;
}

static bool is_away(const struct simulation *simulation)
{
    double t = now(simulation);
    return t >= simulation->away_from && t < simulation->away_to;
}

/* The processor's bus says something: as a slave, answer. */
static void bus_says(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq;
    struct simulation *s = parameter;
    avr_twi_msg_irq_t message = {.u.v = value};
    uint8_t address = (uint8_t)message.u.twi.addr;
    s->addressed = message.u.twi.msg & TWI_COND_START && !(address & 1);
    if (message.u.twi.msg & TWI_COND_STOP)
        s->selected = false;
    if (is_away(s)) {
        model_reset(&s->model);
        s->selected = false;
        return;
    }
    if (message.u.twi.msg & TWI_COND_START) {
        s->selected = address >> 1 == ADDRESS;
        if (s->selected) {
            bool is_reading = address & 1;
            uint8_t at = s->model.at;
            model_begin(&s->model, now(s));
            /* A read goes on at the register that the write before it named. */
            if (is_reading)
                s->model.at = at;
            avr_raise_irq(s->bus + TWI_IRQ_INPUT, avr_twi_irq_msg(TWI_COND_ACK, address, 1));
        }
    }
    if (!s->selected)
        return;
    if (message.u.twi.msg & TWI_COND_WRITE) {
        avr_raise_irq(s->bus + TWI_IRQ_INPUT, avr_twi_irq_msg(TWI_COND_ACK, address, 1));
        model_write(&s->model, now(s), (uint8_t)message.u.twi.data);
    }
    if (message.u.twi.msg & TWI_COND_READ)
        avr_raise_irq(s->bus + TWI_IRQ_INPUT, avr_twi_irq_msg(TWI_COND_READ, address, model_read(&s->model)));
}

/* simavr 1.6 tells an address to write to, when it is acknowledged or not, by the status of a byte of data. */
static void mend_status(struct avr_irq_t *irq, uint32_t status, void *parameter)
{
    (void)irq;
    const struct simulation *s = parameter;
    if (s->addressed && (status == DATA_ACKNOWLEDGED || status == DATA_REFUSED)) {
        uint8_t *reg = &s->avr->data[STATUS_REGISTER];
        *reg = (uint8_t)((*reg & 7) | (status == DATA_ACKNOWLEDGED ? ADDRESS_ACKNOWLEDGED : ADDRESS_REFUSED));
    }
}

/* simavr 1.6 does not take TWINT back when it is written. */
static void mend_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *parameter)
{
    (void)parameter;
    if (value & DONE)
        avr->data[address] &= (uint8_t)~DONE;
}

/* A hang-up means that nobody has the terminal open. */
static bool has_reader(const struct simulation *s)
{
    struct pollfd state = {.fd = s->terminal};
    return poll(&state, 1, 0) == 0 || !(state.revents & POLLHUP);
}

/* Passes on what the reader says. */
static void line_hears(const struct simulation *s, struct avr_irq_t *input)
{
    struct pollfd state = {.fd = s->terminal, .events = POLLIN};
    uint8_t byte;
    if (poll(&state, 1, 0) == 1 && state.revents & POLLIN && read(s->terminal, &byte, 1) == 1)
        avr_raise_irq(input, byte);
}

/* The serial line sends a byte: to nobody, if nobody listens. */
static void line_says(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq;
    const struct simulation *s = parameter;
    uint8_t byte = (uint8_t)value;
    if (!has_reader(s))
        return;
    while (write(s->terminal, &byte, 1) != 1)
        if (errno != EINTR)
            give_up("the terminal is closed");
}

static void open_terminal(struct simulation *s)
{
    s->terminal = posix_openpt(O_RDWR | O_NOCTTY);
    if (s->terminal < 0 || grantpt(s->terminal) || unlockpt(s->terminal))
        give_up("no pseudo terminal");
    /* The settings are the reader's end's: bytes as they are. */
    struct termios settings;
    if (ptsname_r(s->terminal, s->path, sizeof s->path) || tcgetattr(s->terminal, &settings))
        give_up("the pseudo terminal does not open");
    cfmakeraw(&settings);
    tcsetattr(s->terminal, TCSANOW, &settings);
    /* Until it has been opened and closed it does not tell that nobody has it open. */
    close(open(s->path, O_RDWR | O_NOCTTY));
    printf("%s\n", s->path);
    fflush(stdout);
}

/* What is unread is lost when this end is closed. */
static void wait_until_read(const struct simulation *s)
{
    int other = has_reader(s) ? open(s->path, O_RDWR | O_NOCTTY) : -1;
    /* It stands in two buffers, of which one is asked: twice, so that the other had time to pass its bytes on. */
    for (int k = 0, idle = 0; other >= 0 && k < PATIENCE && idle < 2; k++) {
        int n = 0;
        usleep(10000);
        ioctl(other, FIONREAD, &n);
        idle = n ? 0 : idle + 1;
    }
}

static void read_course(struct simulation *s, const char *name)
{
    FILE *file = fopen(name, "r");
    if (!file)
        give_up("the course cannot be read");
    double t, roll, pitch;
    s->model.poses = 0;
    while (s->model.poses < POSES && fscanf(file, "%lf %lf %lf", &t, &roll, &pitch) == 3)
        s->poses[s->model.poses++] = (struct pose){t, roll * M_PI / 180, pitch * M_PI / 180};
    fclose(file);
    if (s->model.poses == 0)
        give_up("the course has no pose");
}

static double clock_now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + (double)time.tv_nsec * 1e-9;
}

/* Waits until real time is as far; takes it that real time began later if the simulation is far behind. */
static void pace(const struct simulation *s, double *begin)
{
    double ahead = now(s) - (clock_now() - *begin);
    if (ahead < -LATE)
        *begin -= ahead;
    if (ahead > 0)
        usleep((useconds_t)(ahead * 1e6));
}

int main(int count, char **arguments)
{
    static struct simulation s = {.model = {.poses = 1}, .away_from = INFINITY, .until = INFINITY};
    bool fast = false;
    s.model.course = s.poses;
    if (count < 2)
        give_up("which firmware?");
    for (int k = 2; k < count; k++) {
        if (!strcmp(arguments[k], "--fast")) {
            fast = true;
        } else if (!strcmp(arguments[k], "--course") && k + 1 < count) {
            read_course(&s, arguments[++k]);
        } else if (!strcmp(arguments[k], "--away") && k + 2 < count) {
            s.away_from = atof(arguments[++k]);
            s.away_to = atof(arguments[++k]);
        } else if (!strcmp(arguments[k], "--seconds") && k + 1 < count) {
            s.until = atof(arguments[++k]);
        } else {
            give_up("the options are --course FILE, --away FROM TO, --seconds S and --fast");
        }
    }
    avr_global_logger_set(log_line);
    elf_firmware_t firmware = {0};
    if (elf_read_firmware(arguments[1], &firmware))
        give_up("the firmware cannot be read");
    s.avr = avr_make_mcu_by_name("atmega328p");
    if (!s.avr || avr_init(s.avr))
        give_up("simavr does not know the atmega328p");
    firmware.frequency = CLOCK;
    avr_load_firmware(s.avr, &firmware);
    model_reset(&s.model);

    s.bus = avr_io_getirq(s.avr, AVR_IOCTL_TWI_GETIRQ(0), 0);
    avr_irq_register_notify(s.bus + TWI_IRQ_OUTPUT, bus_says, &s);
    avr_irq_register_notify(s.bus + TWI_IRQ_STATUS, mend_status, &s);
    avr_register_io_write(s.avr, CONTROL_REGISTER, mend_control, 0);
    uint32_t flags = 0; /* no copy of the line to standard output */
    avr_ioctl(s.avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(s.avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), line_says, &s);
    struct avr_irq_t *input = avr_io_getirq(s.avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    open_terminal(&s);

    while (!has_reader(&s))
        usleep(1000);
    double begin = clock_now();
    for (avr_cycle_count_t next = 0; now(&s) < s.until;) {
        int state = avr_run(s.avr);
        if (state == cpu_Done || state == cpu_Crashed)
            give_up("the processor has stopped");
        if (s.avr->cycle >= next) {
            line_hears(&s, input);
            if (!fast)
                pace(&s, &begin);
            next = s.avr->cycle + CLOCK / 1000;
        }
    }
    wait_until_read(&s);
    return 0;
}

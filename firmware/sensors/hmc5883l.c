#include "hmc5883l.h"

enum { ADDRESS = 0x1E };
enum { CONFIGURATION_A = 0x00, CONFIGURATION_B = 0x01, MODE = 0x02, DATA = 0x03, STATUS = 0x09, IDENTITY = 0x0A };

#define READY 0x01

enum hmc5883l_fault hmc5883l_set_up(const struct hmc5883l *sensor)
{
    uint8_t who[3] = {0};
    enum bus bus = board_read(ADDRESS, IDENTITY, who, 3);
    if (bus == BUS_OK && (who[0] != 'H' || who[1] != '4' || who[2] != '3'))
        return HMC5883L_OTHER_CHIP;
    if (bus == BUS_OK)
        bus = board_write(ADDRESS, CONFIGURATION_A, sensor->registers[0]);
    if (bus == BUS_OK)
        bus = board_write(ADDRESS, CONFIGURATION_B, sensor->registers[1]);
    if (bus == BUS_OK)
        bus = hmc5883l_measure(sensor);
    return bus == BUS_OK ? HMC5883L_OK : bus == BUS_NO_ANSWER ? HMC5883L_NO_ANSWER : HMC5883L_STUCK;
}

enum bus hmc5883l_measure(const struct hmc5883l *sensor)
{
    return board_write(ADDRESS, MODE, sensor->registers[2]);
}

enum bus hmc5883l_ready(bool *ready)
{
    uint8_t status = 0;
    enum bus bus = board_read(ADDRESS, STATUS, &status, 1);
    *ready = bus == BUS_OK && (status & READY) != 0;
    return bus;
}

enum bus hmc5883l_read(uint8_t values[HMC5883L_BYTES])
{
    return board_read(ADDRESS, DATA, values, HMC5883L_BYTES);
}

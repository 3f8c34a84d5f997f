/* HMC5883L: magnetometer (data sheet HMC5883L, revision E). */
#ifndef HMC5883L_H
#define HMC5883L_H

#include "../device/board.h"

#define HMC5883L_BYTES 6 /* registers 0x03 to 0x08 */

struct hmc5883l {
    /* Configuration registers A and B, and the mode register. It measures once each time that it is asked to: in its
       continuous mode nothing but a further wire tells a new measurement from one that was read before. */
    uint8_t registers[3];
};

#define HMC5883L_SINGLE 0x01 /* mode register: measure once */

enum hmc5883l_fault { HMC5883L_OK, HMC5883L_NO_ANSWER, HMC5883L_STUCK, HMC5883L_OTHER_CHIP };

enum hmc5883l_fault hmc5883l_set_up(const struct hmc5883l *sensor);

/* Begins a measurement, which takes 6 ms. */
enum bus hmc5883l_measure(const struct hmc5883l *sensor);
/* Whether it is done. */
enum bus hmc5883l_ready(bool *ready);
enum bus hmc5883l_read(uint8_t values[HMC5883L_BYTES]);

#endif

/* Mahony's filter, nine axes, as a plain C loop: what the machine can do. Two forms of the same equations.
 *
 * first_order: one Euler step, q += T_q (w_imu - b + k_P w_mes) dt, then onto the unit sphere; the usual way on a
 * microcontroller.
 * exact: what imufit computes: mean rate of both rows, exact exponential, measurement at the new row, correction
 * limited to the error. No rules for gaps, NaN and free fall in either of them. NED, north along x.
 */
#include <math.h>
#include <stddef.h>

static void turn(double q[4], const double r[3])
{
    double angle = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    double c = cos(0.5 * angle), s = angle > 0.0 ? sin(0.5 * angle) / angle : 0.5;
    double x = r[0] * s, y = r[1] * s, z = r[2] * s;
    double p[4] = {
        q[0] * c - q[1] * x - q[2] * y - q[3] * z,
        q[0] * x + q[1] * c + q[2] * z - q[3] * y,
        q[0] * y - q[1] * z + q[2] * c + q[3] * x,
        q[0] * z + q[1] * y - q[2] * x + q[3] * c,
    };
    for (int i = 0; i < 4; i++)
        q[i] = p[i];
}

static void unit(double q[4])
{
    double scale = 1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 4; i++)
        q[i] *= scale;
}

/* Eq. (5) for k_1 and k_2: specific force against up, horizontal field against north. */
static void innovation(const double q[4], const double f[3], const double m[3], double k_1, double k_2, double w[3])
{
    double a = q[0], b = q[1], c = q[2], d = q[3];
    /* rows of R: north, east, down as seen from the body */
    double n[3] = {1.0 - 2.0 * (c * c + d * d), 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)};
    double e[3] = {2.0 * (b * c + a * d), 1.0 - 2.0 * (b * b + d * d), 2.0 * (c * d - a * b)};
    double u[3] = {-2.0 * (b * d - a * c), -2.0 * (c * d + a * b), -1.0 + 2.0 * (b * b + c * c)};
    double length = 0.5 * k_1 / sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    double mn = n[0] * m[0] + n[1] * m[1] + n[2] * m[2];
    double me = e[0] * m[0] + e[1] * m[1] + e[2] * m[2];
    /* v x north = -down * me / |m_h| = up * me / |m_h| */
    double heading = 0.5 * k_2 * me / sqrt(mn * mn + me * me);
    w[0] = (f[1] * u[2] - f[2] * u[1]) * length + u[0] * heading;
    w[1] = (f[2] * u[0] - f[0] * u[2]) * length + u[1] * heading;
    w[2] = (f[0] * u[1] - f[1] * u[0]) * length + u[2] * heading;
}

void first_order(size_t n, const double *t, const double *gyr, const double *acc, const double *mag, const double gains[4],
                 const double start[4], double *out)
{
    double q[4] = {start[0], start[1], start[2], start[3]}, bias[3] = {0.0, 0.0, 0.0}, w[3];
    for (size_t k = 0; k < n; k++) {
        if (k > 0) {
            double dt = t[k] - t[k - 1];
            innovation(q, acc + 3 * k, mag + 3 * k, gains[0], gains[1], w);
            double r[3];
            for (int i = 0; i < 3; i++) {
                bias[i] -= 0.5 * gains[2] * dt * w[i];
                r[i] = 0.5 * dt * (gyr[3 * k + i] - bias[i] + gains[3] * w[i]);
            }
            double p[4] = {
                q[0] - q[1] * r[0] - q[2] * r[1] - q[3] * r[2],
                q[1] + q[0] * r[0] + q[2] * r[2] - q[3] * r[1],
                q[2] + q[0] * r[1] - q[1] * r[2] + q[3] * r[0],
                q[3] + q[0] * r[2] + q[1] * r[1] - q[2] * r[0],
            };
            unit(p);
            for (int i = 0; i < 4; i++)
                q[i] = p[i];
        }
        for (int i = 0; i < 4; i++)
            out[4 * k + i] = q[i];
    }
}

void exact(size_t n, const double *t, const double *gyr, const double *acc, const double *mag, const double gains[4],
           const double start[4], double *out)
{
    double q[4] = {start[0], start[1], start[2], start[3]}, bias[3] = {0.0, 0.0, 0.0}, w[3];
    for (size_t k = 0; k < n; k++) {
        if (k > 0) {
            double dt = t[k] - t[k - 1], r[3];
            for (int i = 0; i < 3; i++)
                r[i] = (0.5 * (gyr[3 * k + i] + gyr[3 * k - 3 + i]) - bias[i]) * dt;
            turn(q, r);
            innovation(q, acc + 3 * k, mag + 3 * k, gains[0], gains[1], w);
            double weight = 0.5 * (gains[0] + gains[1]) * gains[3] * dt;
            double limit = weight > 1.0 ? dt / weight : dt;
            for (int i = 0; i < 3; i++) {
                bias[i] -= 0.5 * gains[2] * limit * w[i];
                r[i] = gains[3] * limit * w[i];
            }
            turn(q, r);
            unit(q);
        }
        for (int i = 0; i < 4; i++)
            out[4 * k + i] = q[i];
    }
}

/* The device as the loop knows it: values beside the generated functions of known_model.h. */

#ifndef KNOWN_H
#define KNOWN_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "sizes.h"

/* The functions of the FMU's own mathematics that effects may call: to the loop an ulp does not matter. */
#define gyro_exp exp
#define gyro_log log
#define gyro_sin sin
#define gyro_cos cos
#define gyro_tan tan
#define gyro_asin asin
#define gyro_acos acos
#define gyro_atan atan
#define gyro_atan2 atan2
#define gyro_sinh sinh
#define gyro_cosh cosh
#define gyro_tanh tanh
#define gyro_floor floor
#define gyro_ceil ceil
#define gyro_fabs fabs
#define gyro_pow pow

#define IN 6
#define PI 3.14159265358979323846

typedef struct {
    double p[NP];   /* estimated: k/m [1/s2] and d/m [1/s] in the order kxx kyy kxy dxx dyy dxy, effects' [SI], 1/m [1/kg] last */
    double c[NC];   /* known parameters [SI], in the order of KnownModel.constants */
    double in[IN];  /* measured: temperature [K], a_x, a_y [m/s2], v_bias [V]; made of it: temperature of structure and circuit [K] */
    double t;       /* time [s] */
} known;

#define INVERSE_MASS (NP - 1)
#define POINTS 4 /* at which the voltages' jets are worked out side by side, by one instruction where the processor has it: both ends of two pieces */

static inline double larger(double a, double b) { return a > b ? a : b; }
static inline double smaller(double a, double b) { return a < b ? a : b; }
/* How strongly a rate couples the velocities, x'' = 2 coupling Omega y' and y'' = -2 coupling Omega x': 1 or the angular gain. Taken from the
   Jacobians of the motion [NS * NS] at rest and at `rate` [rad/s]. */
static inline double rate_coupling(const double *still, const double *turning, double rate)
{
    return 0.25 * (turning[NS + 3] - still[NS + 3] - turning[3 * NS + 1] + still[3 * NS + 1]) / rate;
}
/* Puts `values` [count] in the place of a point in out [count * POINTS]. */
static inline void put_point(double *out, int count, int point, const double *values)
{
    for (int i = 0; i < count; i++) {
        out[i * POINTS + point] = values[i];
    }
}
static inline double unit_step(double a) { return a > 0.0 ? 1.0 : a < 0.0 ? 0.0 : 0.5; }

#endif

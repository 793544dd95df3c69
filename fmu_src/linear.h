/* The motion while every force is linear in it and held: s' = A s + b, of which the solution over a step h is a Taylor series,

       s + h (r + h/2 A (r + h/3 A (r + ...))),  r = A s + b.

   The number of terms follows from the size of A h, so that what is left out is below rounding whatever the stiffness and the rate. */

#ifndef GYRO_LINEAR_H
#define GYRO_LINEAR_H

#include "generated/effects.h"

/* Up to this size of A h the series ends after the power GYRO_FIRST_POWER + i: there (A h)^(n+1)/(n+1)! <= 1e-17. */
enum { GYRO_FIRST_POWER = 4, GYRO_HIGHEST_POWER = 18 };
static const double gyro_reach[GYRO_HIGHEST_POWER - GYRO_FIRST_POWER + 1] = {0.00104, 0.00439, 0.0126, 0.0282, 0.0535, 0.0903, 0.14, 0.202,
                                               0.279,   0.369,   0.472,  0.588,  0.717,  0.858,  1.0};

/* Beyond, the step is divided, up to so many times. */
static const double GYRO_MOST_PARTS = 64.0;

static inline double size_of(double a) { return a < 0.0 ? -a : a; }

/* An upper bound of A in the maximum norm, with velocities in units of w times the displacement, w^2 the largest row of the stiffness:
   rows w and w + damping [1/s]. */
static inline double bound_of(double slope[2][4], double inverse_mass)
{
    const double stiff = larger(size_of(slope[0][0]) + size_of(slope[0][2]), size_of(slope[1][0]) + size_of(slope[1][2]));
    const double damped = larger(size_of(slope[0][1]) + size_of(slope[0][3]), size_of(slope[1][1]) + size_of(slope[1][3]));
    return sqrt(stiff * inverse_mass) + damped * inverse_mass;
}

/* The highest power of the series for A h of this size, at most 1. */
static inline int power_for(double size)
{
    int power = GYRO_FIRST_POWER;
    while (size > gyro_reach[power - GYRO_FIRST_POWER]) {
        power++;
    }
    return power;
}

/* Moves the states by h [s]; gives 0 where the step would have to be divided too often, and then has done nothing. */
static inline int propagate(gyro_view *g, double h)
{
    double slope[2][4], still[2];
    find_slopes(g, slope);
    find_still(g, still);
    const double size = h * bound_of(slope, g->inverse_mass);
    const int possible = size <= GYRO_MOST_PARTS;
    if (possible) {
        const int parts = size > 1.0 ? (int)size + 1 : 1;
        const double part = h / parts, mass = g->inverse_mass;
        const int power = power_for(size / parts);
        const double xx = slope[0][0] * mass, xv = slope[0][1] * mass, xy = slope[0][2] * mass, xw = slope[0][3] * mass;
        const double yx = slope[1][0] * mass, yv = slope[1][1] * mass, yy = slope[1][2] * mass, yw = slope[1][3] * mass;
        const double bx = still[0] * mass, by = still[1] * mass;
        double x = g->s[GYRO_STATE_X], v = g->s[GYRO_STATE_X_DOT], y = g->s[GYRO_STATE_Y], w = g->s[GYRO_STATE_Y_DOT];
        for (int i = 0; i < parts; i++) {
            const double rv = (xx * x + xv * v) + (xy * y + xw * w) + bx;
            const double rw = (yx * x + yv * v) + (yy * y + yw * w) + by;
            double dx = v, dv = rv, dy = w, dw = rw;
            for (int k = power; k > 1; k--) {
                const double f = part / k;
                const double av = (xx * dx + xv * dv) + (xy * dy + xw * dw);
                const double aw = (yx * dx + yv * dv) + (yy * dy + yw * dw);
                dx = v + f * dv;
                dy = w + f * dw;
                dv = rv + f * av;
                dw = rw + f * aw;
            }
            x += part * dx;
            v += part * dv;
            y += part * dy;
            w += part * dw;
        }
        g->s[GYRO_STATE_X] = x;
        g->s[GYRO_STATE_X_DOT] = v;
        g->s[GYRO_STATE_Y] = y;
        g->s[GYRO_STATE_Y_DOT] = w;
    }
    return possible;
}

#endif

/* The motion while every force is linear in it and held: s' = A s + b, of which the solution over a step h is a Taylor series,

       s + h (r + h/2 A (r + h/3 A (r + ...))),  r = A s + b.

   The number of terms follows from the size of A h, so that what is left out is below rounding whatever the stiffness and the rate. Where laws
   change A within the step, taylor.h does it. */

#ifndef GYRO_LINEAR_H
#define GYRO_LINEAR_H

#include "generated/effects.h"
#include "pair.h"

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

/* The force while it is linear: slope (x, x', y, y') + still [N]; slope [N/m, N.s/m]. */
typedef struct {
    double slope[2][4];
    double still[2];
} gyro_linear;

/* That of the view as it is. */
static inline gyro_linear linear_of(const gyro_view *g)
{
    gyro_linear linear;
    find_slopes(g, linear.slope);
    find_still(g, linear.still);
    return linear;
}

/* The linear force of both axes by pairs: how it goes with place and speed, each of the own axis and of the other, and what does not move. */
typedef struct {
    gyro_pair place[2], speed[2], still;
} gyro_linear_pair;

static inline gyro_linear_pair pairs_of(const gyro_linear *linear)
{
    const double *to_x = linear->slope[0], *to_y = linear->slope[1];
    const gyro_linear_pair pairs = {{pair_of(to_x[0], to_y[2]), pair_of(to_x[2], to_y[0])},
                                    {pair_of(to_x[1], to_y[3]), pair_of(to_x[3], to_y[1])},
                                    pair_of(linear->still[0], linear->still[1])};
    return pairs;
}

/* Whether a step h [s] need not be divided too often. */
static inline int is_gentle(gyro_linear *linear, double inverse_mass, double h)
{
    return h * bound_of(linear->slope, inverse_mass) <= GYRO_MOST_PARTS;
}

/* Moves the states by a gentle step h [s]. */
static inline void propagate(gyro_view *g, gyro_linear *linear, double h)
{
    const double size = h * bound_of(linear->slope, g->inverse_mass);
    const int parts = size > 1.0 ? (int)size + 1 : 1, power = power_for(size / parts);
    const double part = h / parts, mass = g->inverse_mass;
    const double *to_x = linear->slope[0], *to_y = linear->slope[1];
    const double xx = to_x[0] * mass, xv = to_x[1] * mass, xy = to_x[2] * mass, xw = to_x[3] * mass;
    const double yx = to_y[0] * mass, yv = to_y[1] * mass, yy = to_y[2] * mass, yw = to_y[3] * mass;
    const double bx = linear->still[0] * mass, by = linear->still[1] * mass;
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

/* Moves the states by h [s], every force being linear and held. Gives 0 where it would have to be divided too often, and then has moved
   nothing. */
static inline int propagate_linear(gyro_view *g, double h)
{
    gyro_linear linear = linear_of(g);
    const int gentle = is_gentle(&linear, g->inverse_mass, h);
    if (gentle) {
        propagate(g, &linear, h);
    }
    return gentle;
}

#endif

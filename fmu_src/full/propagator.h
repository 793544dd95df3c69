/* The motion while every force is linear in it and none but the rate changes how: over a step h

       s(t + h) = s + sum over k of rate^k M_k (s, b)

   with the constant forces b. The matrices are tabulated once for a set of parameters. */

#ifndef GYRO_PROPAGATOR_H
#define GYRO_PROPAGATOR_H

#include "generated/effects.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Powers of the rate 0 .. GYRO_RATE_POWERS - 1; states and constant forces that they act on. */
enum { GYRO_RATE_POWERS = 4, GYRO_MOVED = 4, GYRO_MOVING = 6 };

typedef struct {
    double step;                                            /* s; 0: there is no table */
    double most;                                            /* up to this rate the powers left out are below GYRO_RATE_ERROR, rad/s */
    double part[GYRO_RATE_POWERS][GYRO_MOVING][GYRO_MOVED]; /* by power, then by x, x', y, y' [SI] and the constant forces [N] */
} gyro_propagator;

/* What powers of the rate that are left out may add in one step, over the motion: 2e5 steps a second make 2e-11 rad of it. */
static const double GYRO_RATE_ERROR = 1e-16;

/* The largest rate [rad/s], by powers of two, of which the power GYRO_RATE_POWERS adds less than GYRO_RATE_ERROR in a step [s]: of slopes
   A_1 rate + A_2 rate^2 with the norms `turning` and `flung` at most a^4/24 + a^2 b/2 + b^2/2, a = h |A_1| rate, b = h |A_2| rate^2. */
static inline double gyro_largest_rate(double step, double turning, double flung)
{
    double rate = 1024.0, left;
    do {
        rate *= 0.5;
        const double a = step * turning * rate, b = step * flung * rate * rate;
        left = a * a * a * a / 24.0 + a * a * b / 2.0 + b * b / 2.0;
    } while (left > GYRO_RATE_ERROR);
    return rate;
}

/* Tabulates for a step [s] with the parameters of the view, whose motion is steady. */
void gyro_tabulate(gyro_propagator *table, const gyro_view *view, double step);

/* Whether the table holds for a step [s] at the present rate. */
static inline int gyro_holds(const gyro_propagator *table, const gyro_view *g, double step)
{
    return step == table->step && fabs(g->p[GYRO_OMEGA_Z]) <= table->most;
}

/* Moves the states of the view by the step of the table. */
static inline void gyro_apply(const gyro_propagator *table, gyro_view *g)
{
    const double rate = g->p[GYRO_OMEGA_Z];
    double still[2], change[GYRO_RATE_POWERS][GYRO_MOVED];
    find_still(g, still);
    const double moving[GYRO_MOVING] = {g->s[0], g->s[1], g->s[2], g->s[3], still[0], still[1]};
    for (int k = 0; k < GYRO_RATE_POWERS; k++) {
        for (int i = 0; i < GYRO_MOVED; i++) {
            change[k][i] = table->part[k][0][i] * moving[0];
        }
        for (int j = 1; j < GYRO_MOVING; j++) {
            for (int i = 0; i < GYRO_MOVED; i++) {
                change[k][i] += table->part[k][j][i] * moving[j];
            }
        }
    }
    for (int i = 0; i < GYRO_MOVED; i++) {
        g->s[i] += change[0][i] + rate * (change[1][i] + rate * (change[2][i] + rate * change[3][i]));
    }
}

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

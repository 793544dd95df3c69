/* The linear device at rest, and what voltages see of it. */

#ifndef LINEAR_H
#define LINEAR_H

#include "known.h"

#define MOTION 4 /* positions and velocities come first: x, x', y, y' */

/* Accelerations -kappa q - delta q' + b u and voltages c q + d u, which come late by a delay and a lag. Matrices are [2 * 2], row by row, in the order
   of known_seen. */
typedef struct {
    double c[4], d[4], b[4], kappa[4], delta[4]; /* [V/m], [V/V], [m/s2/V], [1/s2], [1/s] */
    double delay, lag;                           /* [s] */
} linear;

/* The device of `k`, and its derivatives by p. */
void linear_of(const known *k, linear *at, linear by[NP]);

/* Which command goes with a voltage at the angular frequency w [rad/s], and its derivatives by p: real parts of a [2 * 2], then imaginary ones. */
void linear_command(const linear *at, const linear by[NP], double w, double seen[8], double by_p[8][NP]);

#define MOMENTS 7 /* of the commands under way: a delay of a radian of the oscillation is left out to 2e-4 */

/* What voltages will see of a motion z [MOTION] if no more is commanded: (c, c) exp(A t) w, w = (1 + lag A)^-1 (z + what the commands that are under way
   in the delay will add, moved back to now). */
typedef struct {
    const linear *at;
    double before[MOTION][MOTION];      /* 1 + lag A */
    double lagged[MOTION][MOTION];      /* (1 + lag A)^-1 */
    double moments[2 * MOMENTS];        /* integrals of s^i/i! times the command that acts s seconds ahead, over the delay */
    double by_delay[2 * MOMENTS];       /* by a delay that lets each act so much later */
} sight;

/* Commands: the latest one first, `count` of them [2 * count], the earliest of which acts until `rest` [s] from now, each later one a `period` more. */
void sight_form(sight *s, const linear *at, const double *commands, int count, double rest, double period);

/* What is seen of z: y [MOTION], v_x, its slope, v_y, its slope; and how y changes with p, z standing still. */
void sight_see(const sight *s, const linear by[NP], const double z[MOTION], double y[MOTION], double by_p[MOTION][NP]);

/* How y changes with z by `change`. */
void sight_change(const sight *s, const double change[MOTION], double y[MOTION]);

/* The z of which y is seen, and the change of z by which y changes. */
void sight_back(const sight *s, const double y[MOTION], double z[MOTION]);
void sight_change_back(const sight *s, const double y[MOTION], double change[MOTION]);

#endif

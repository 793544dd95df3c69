/* The pattern: an orbit in a plane that turns, z'' + 2 i turn z' + w^2 z = 0 with z = x + i y. */

#ifndef PATTERN_H
#define PATTERN_H

#include <complex.h>

/* A motion in the plane: x + i y [m] and its velocity [m/s]. */
typedef struct {
    double complex z, v;
} orbit;

/* Factors by which the two circular motions that make an orbit go on over a time. */
typedef struct {
    double complex up, down;
} advance;

/* Turn and w in rad/s. */
advance pattern_advance(double turn, double w, double duration);

/* The orbit at the instant at which its circular motions are these. */
orbit pattern_of(double complex up, double complex down, double turn, double w);

/* Orientation of the straight line that an orbit is while the plane turns [rad]. */
double pattern_orientation(orbit o, double turn, double w);

#endif

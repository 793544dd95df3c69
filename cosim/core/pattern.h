/* The pattern: an orbit in a plane that turns, z'' + 2 i turn z' + w^2 z = 0 with z = x + i y. */

#ifndef PATTERN_H
#define PATTERN_H

#include <complex.h>

/* A motion in the plane: x + i y [m] and its velocity [m/s]. */
typedef struct {
    double complex z, v;
} orbit;

/* Factors by which the two circular motions that make an orbit go on over a time; turn and w in rad/s. */
typedef struct {
    double turn, w;
    double complex up, down;
} advance;

advance pattern_advance(double turn, double w, double duration);

/* The orbit later. */
orbit pattern_moved(orbit o, const advance *a);

/* The orbit at the instant at which its circular motions are these. */
orbit pattern_of(double complex up, double complex down, double turn, double w);

/* Orientation of the straight line that an orbit is while the plane turns [rad]. */
double pattern_orientation(orbit o, double turn, double w);

/* Squared deviation of b from a over the square of a's size, but for what amplitude and phase explain. */
double pattern_deviation(orbit a, orbit b, double w);

#endif

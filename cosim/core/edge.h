/* What a step of the rate did to the pattern before the loop knew of it.

   The rate that the observer gives is late by tens of microseconds. Until then the Coriolis force on the motion that the tones force is not
   cancelled, and kicks the pattern. And where the package has no Euler force, positions and velocities go on through the step while what is straight
   for the new rate is another orbit: the pattern turns by up to half the step over the oscillation's angular frequency. Neither is a turn of the
   device. Some milliseconds later the loop knows the rates on both sides. The samples tell when the step was (step_time.h), and the pattern what it has
   turned by beyond that. */

#ifndef EDGE_H
#define EDGE_H

#include "filter.h"
#include "pattern.h"
#include "step_time.h"

#define EDGE_PAST 16384 /* samples kept; a power of two */

/* A sample: the pattern, the forced motion and its part from tones near the oscillation, the rate that the loop acts on and its integral until
   then, k/m, and the angle by which the controller has turned the pattern. */
typedef struct {
    orbit free, forced, near;
    double rate, swept, omega_squared, turned;
} edge_sample;

typedef struct {
    edge_sample past[EDGE_PAST];
    known k;
    double period;    /* [s] */
    int64_t count;    /* samples so far */
    int64_t seen;     /* sample at which a step showed; below zero: none is under review */
    int64_t reviewed; /* sample from which on no step is known */
    double turned;    /* angle by which steps have turned the pattern [rad] */
    double unlikely[SHARES]; /* what steps have told of the package's share of the Euler force */
} edge;

static inline const edge_sample *sample_at(const edge *e, int64_t k) { return &e->past[k & (EDGE_PAST - 1)]; }

/* `values` [NC]: what is known. */
void edge_start(edge *e, const double *values, double period);

/* After the controller at a sample: the estimate; the forced motion x, x', y, y' and its part from tones near the
   oscillation; k/m; the angle that the controller has turned the pattern by; the observer, or NULL where it is another one: then no step is found. */
void edge_follow(edge *e, const double *estimate, const double in[IN], const double forced[4], const double near[4],
                 double omega_squared, double turned, filter *f);

#endif

/* Least squares of the positions around a step of the rate. */

#ifndef EDGE_FIT_H
#define EDGE_FIT_H

#include "edge.h"

#define FITTED 1e-2 /* over which the pattern is fitted before a step [s] */

/* What a position is made of but noise, each with a complex factor: the circular motions of the pattern; these growing with time, by errors of
   rate and frequency and by damping; a constant; and what is wrong of the response to the tones, in position and velocity, by axis and pair. */
#define PATTERN_TERMS 2
#define MOVING_TERMS 4
#define TERMS (MOVING_TERMS + 9)

/* What turns the pattern [rad/s]: `coupling` times the rate, and what the controller adds; in all, `turn`, at the sample that a fit refers to. */
typedef struct {
    double coupling, own, turn;
} turning;

/* Angle by which the rate and the controller turn the pattern from sample `from` to sample `to` [rad]. */
double edge_course(const edge *e, const turning *by, int64_t from, int64_t to);

/* Least squares of the first `count` terms over the samples first .. last - 1, the pattern's at sample `at`; `wrong` is taken out before. */
void edge_fit(const edge *e, int count, int64_t first, int64_t last, int64_t at, const turning *by, double w, double size,
              const double complex wrong[TERMS], double complex found[TERMS]);

#endif

/* When a step of the rate was, as the samples tell it. */

#ifndef STEP_TIME_H
#define STEP_TIME_H

#include "filter.h"

#define SHARES 21 /* shares of the Euler force that a package may have, from none to all of it */

/* When a step was, of what samples leave possible the mean: a sample, of which a fraction counts, below zero where no step explains them; and its
   variance [samples^2]. A step while the position goes through zero changes the motion by the third power of its time only. */
typedef struct {
    double at, variance;
} step_found;

/* When the rate stepped to `after` [rad/s]: between `earliest` and `seen`, by the samples up to `looked`. `unlikely`: twice the negative logarithm of
   the likelihood of each share by the steps so far, to which this one is added. */
step_found step_time(filter *f, int64_t earliest, int64_t seen, int64_t looked, double after, double unlikely[SHARES]);

#endif

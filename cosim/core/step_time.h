/* When a step of the rate was, as the samples tell it. */

#ifndef STEP_TIME_H
#define STEP_TIME_H

#include "filter.h"

/* The sample, of which a fraction counts, at which the rate most likely stepped to `after` [rad/s]: between `earliest` and `seen`, by the samples
   up to `looked`. Below zero where they do not tell, or where no step explains them. */
double step_time(filter *f, int64_t earliest, int64_t seen, int64_t looked, double after);

#endif

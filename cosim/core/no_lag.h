/* A lag that follows a temperature is none from some temperature on. On either side of there the voltages tell of a delay and the lag together, or of the
   delay alone, and the slopes of one side say nothing of the other. Where the lag may end is known to as little as the lag is apart from the delay. */

#ifndef NO_LAG_H
#define NO_LAG_H

#include "filter.h"

/* Changes the `step` of a block's eta, L being the Cholesky factor of its information, so that a lag that comes near its end, and may have reached it,
   is where it ends. Leaves in f->reopened what a block in which it ends must not tell. */
void no_lag_look(filter *f, double L[NP][NP], double step[NP]);

#endif

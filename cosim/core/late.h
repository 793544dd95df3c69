/* Where a start may come to rest though the device is elsewhere.

   A feedthrough makes a step of the voltage when the delayed command changes: where the delay is whole periods the fit has a kink, and a start may end
   beside it on the wrong side. And a delay and a lag stand for each other to the second power of the lag: where the lag is zero nothing tells that it
   should not be. */

#ifndef LATE_H
#define LATE_H

#include "filter.h"

#define LATE_WAYS 2

/* Whether the constants are at such a place; `step`: the change of eta that leads to where the fit should be looked for as well. */
int late_elsewhere(const filter *f, int way, double step[NP]);

#endif

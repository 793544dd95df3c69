/* A feedthrough makes a step of the voltage when the delayed command changes. Where that is at a sample, the delay being whole periods, the fit has a kink,
   and a start may come to rest beside it on the wrong side. */

#ifndef LATE_H
#define LATE_H

#include "filter.h"

/* Whether the delay is nearly whole periods; `step`: the change of eta that leads to their other side, the lag making up for it. */
int late_other_side(const filter *f, double step[NP]);

#endif

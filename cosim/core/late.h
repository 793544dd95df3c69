/* A feedthrough makes a step of the voltage when the delayed command changes. Where that is at a sample, the delay being whole periods, the fit has a kink,
   and a start may come to rest beside it on the wrong side. */

#ifndef LATE_H
#define LATE_H

#include "filter.h"

/* Whether the delay is nearly whole periods; `step`: the change of eta that leads to their other side, the lag making up for it. */
int late_other_side(const filter *f, double step[NP]);

/* The delay stays above whole periods from now on where it stands beside and above them `at` some constants, and may go anywhere else: a step across
   would change what it is told of the feedthrough. */
void late_keep_side(filter *f, const known *at);

#define LATE_LAGS 3 /* other lags that are looked at */
#define LATE_WHOLES 3 /* whole periods of delay that are looked at */

/* Whether the lag is not near that one of LATE_LAGS that the design allows; `step`: the change of eta to there, the delay making up for it. A delay, a lag
   and a feedthrough look alike to the second order in the lag, and a fit along them may have several minima. */
int late_other_lag(const filter *f, int which, double step[NP]);

/* Whether a delay of whole periods, just above them, `which` fewer than delay and lag are together, is not near and leaves a lag that the design allows;
   `step`: the change of eta to there. */
int late_whole_periods(const filter *f, int which, double step[NP]);

#endif

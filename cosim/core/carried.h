/* A mode that the device carries: a strong coupling to it and a weak one with much ringing look alike to a short start, and a fit along them may have
   several minima. */

#ifndef CARRIED_H
#define CARRIED_H

#include "filter.h"

#define CARRIED_SIZES 3 /* other sizes of a coupling that are looked at */

/* Whether constant i moves the states of effects with the axes and is not near that one of CARRIED_SIZES that the design allows; `step`: the change of
   eta to there. */
int carried_other(const filter *f, int i, int which, double step[NP]);

#endif

/* A mode that the device carries: a strong coupling to it and a weak one with much ringing look alike to a short start, and a fit along them may have
   several minima. */

#ifndef CARRIED_H
#define CARRIED_H

#include "filter.h"

#define CARRIED_EACH 3 /* other sizes of a coupling that are looked at */
#define CARRIED_SIZES (NP * CARRIED_EACH)

/* Whether the constant of that one of CARRIED_SIZES moves the states of effects with the axes, is not near it, and the design allows it; `step`: the change
   of eta to there. */
int carried_other(const filter *f, int which, double step[NP]);

#endif

/* The rate as a random walk with a slope that walks, and what is done where it jumps. */

#ifndef RATE_H
#define RATE_H

#include "filter.h"

/* Opens the rate, and the state by what a jump of the rate did in the last `settle` samples. */
void rate_open(filter *f);

/* Leaves out the rows of the samples in which a surprise may have been under way: what they tell is of the rate, not of the constants. */
void rate_drop_recent(filter *f);

/* Lets the walks of the rate and of its slope follow their corrections of the last few calls; every 64 samples. */
void rate_adapt_walk(filter *f);

/* Whether the corrections of the rate have lately gone one way: a step of it too small for any one sample to surprise. */
int rate_strays(const filter *f);

/* The rate has just jumped: what it has done until now is no walk. */
void rate_jumped(filter *f);

#endif

/* How the motion is taken up. */

#ifndef TAKE_UP_H
#define TAKE_UP_H

#include "filter.h"

/* The position from the first sample [V], exactly through the pickoff's curve: what is uncertain of it is the sample's noise and p. */
void filter_take_up(filter *f, const double v[2]);

/* The same where the filter's state is the truth: the first sample is what that shows. */
void filter_take_up_told(filter *f);

#endif

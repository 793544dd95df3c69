/* How the motion is taken up. */

#ifndef TAKE_UP_H
#define TAKE_UP_H

#include "filter.h"

/* Opens what moves beside the positions and velocities, the states of effects: as far as they would swing with the oscillation, the constants being as
   they are. More than that, and a state that is only seen through a weak coupling would ring in the noise; the ringing and the coupling are told by
   their product alone, and the start would end at a coupling next to none. */
void filter_open_states(filter *f);

/* The position from the first sample [V], exactly through the pickoff's curve: what is uncertain of it is the sample's noise and p. */
void filter_take_up(filter *f, const double v[2]);

/* The same where the filter's state is the truth: the first sample is what that shows. */
void filter_take_up_told(filter *f);

#endif

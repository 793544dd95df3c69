/* What is done where the constants, or all that is taken of the device, are no longer right. */

#ifndef RESTART_H
#define RESTART_H

#include "filter.h"

/* Takes the next samples as another start, at the constants as they are and with what the design knew of them: they show what could not be seen
   before. Until it is complete the constants stay. */
void restart_to_look(filter *f);

/* Begins again with what the design says, at the next sample. */
void restart_from_design(filter *f);

/* The rate has jumped, and is opened; what is known of the constants stays. */
void restart_rate(filter *f);

/* A sample that is too far off: the rate has jumped. Surprises that go on say that the constants have changed. */
void restart_on_surprise(filter *f);

#endif

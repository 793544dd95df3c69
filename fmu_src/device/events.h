/* The instants at which effects switch. */

#ifndef GYRO_EVENTS_H
#define GYRO_EVENTS_H

#include "generated/effects.h"
#include "instance.h"

/* Follows from the parameters: the instant of each effect, negative where it is before the start. */
typedef struct {
    gyro_instant of[GYRO_N_EFFECTS];
} gyro_events;

#endif

/* The motion by the straight forces alone, and how it answers far from resonance. */

#ifndef GYRO_STRAIGHT_H
#define GYRO_STRAIGHT_H

#include "plant.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* The motion by the straight forces: s² q + C s q + K q = mean force/m. A state that an effect brings follows the motion at the carrier, so
   that its pull counts as stiffness there. */
typedef struct {
    matrix stiffness; /* 1/s² */
    matrix damping;   /* 1/s */
    double mean[2];   /* force that does not depend on the motion, per mass, N/kg */
} gyro_motion;

/* From the parameters of the view as they are; the states of the view are used for it. */
gyro_motion gyro_straight_motion(gyro_instance *g);

/* The harmonics of the motion that answer at once, being far from resonance: (K + i h ω C - h² ω²) q_h = force_h/m. `steepness` [N/m] is what
   the force on each axis changes by with its displacement: the mean comes nearer by a round, and harmonics are left out as the force gets as
   steep as the inertia that they work against. */
void gyro_follow_force(gyro_instance *g, const gyro_motion *m, const gyro_harmonics *force, const double steepness[2], gyro_harmonics *q);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

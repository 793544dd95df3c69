/* What effects remember, and what the plant holds of an effect that is tuned. */

#ifndef GYRO_MEMORIES_H
#define GYRO_MEMORIES_H

#include "generated/effects.h"
#include "instance.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* What the effects remember that act and did not in `acted` begins, from `value` as set. */
void gyro_begin_memories(gyro_instance *g, const double value[GYRO_N_VARIABLES], const unsigned char acted[GYRO_N_EFFECTS]);

/* From the plant: called before the parameters change, and after with what has acted before. */
void gyro_before_tuning(gyro_instance *g);
void gyro_after_tuning(gyro_instance *g, const unsigned char acted[GYRO_N_EFFECTS]);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

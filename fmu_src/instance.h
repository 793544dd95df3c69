/* What core.c, events.c and snapshot.c share with the plant inside an instance. Each FMU has a plant.h of its own, which defines `struct gyro_instance`
   with `value`, `message`, a `memory` that begins with the fields that core.c uses, and a `plan` with
   the internal step and the events. */

#ifndef GYRO_INSTANCE_H
#define GYRO_INSTANCE_H

#include "core.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* A step or time counts as a multiple of the internal step within this fraction of one. */
#define GYRO_ON_GRID 1e-6

/* No run comes this far: half of what an int64 counts. */
#define GYRO_MOST_STEPS (INT64_MAX / 2)

/* From core.c. */

/* Records why a call is refused, printf style; gives GYRO_ERROR. */
gyro_status gyro_refuse(gyro_instance *g, const char *format, ...);

/* Refuses parameters out of their bounds, or of no passive device. */
gyro_status gyro_check(gyro_instance *g);

/* Whether `time` [s] is a multiple of `step` [s] to within `slack` steps; the nearest multiple goes to *count. */
int gyro_whole_steps(double time, double step, double slack, int64_t *count);

/* From events.c, over the event_ fields of the plan. */

/* Finds the internal step and the fraction of it in which each effect's event falls. */
void gyro_plan_events(gyro_instance *g);

/* Sets the switches of the view for the events that have passed at `fraction` of internal step `tick`. */
void gyro_pass_events(gyro_instance *g, int64_t tick, double fraction);

/* The first event inside the present internal step after `fraction` of it; 1 where there is none. */
double gyro_next_event(const gyro_instance *g, double fraction);

/* From the plant. */

/* Builds the plan and the rest of the view from values and memory; refuses parameters that don't fit one another. Allocates nothing. */
gyro_status gyro_prepare(gyro_instance *g);

/* Bytes of what the plan says that the instance holds beside itself, and room for them. */
size_t gyro_room(const gyro_instance *g);
gyro_status gyro_make_room(gyro_instance *g);

/* Why a memory that was read from bytes can be none of this plant; NULL where it can. */
const char *gyro_impossible_memory(const gyro_instance *g);

/* Sets the initial state, takes sample 0, latches the outputs. */
void gyro_first_sample(gyro_instance *g);

/* Moves `ticks` internal steps with the inputs as they are, taking the samples that fall on the way. */
void gyro_tick(gyro_instance *g, int64_t ticks);

/* The name of a state that is not finite; NULL where all are. */
const char *gyro_infinite_state(const gyro_instance *g);

/* Frees what the instance holds beside itself. */
void gyro_drop(gyro_instance *g);

typedef struct {
    void *data;
    size_t size; /* bytes */
} gyro_part;

/* What a snapshot holds, in order, shape (GYRO_N_PARTS). The last part is what gyro_make_room makes; the sizes of the others are fixed. */
void gyro_list_parts(gyro_instance *g, gyro_part parts[]);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

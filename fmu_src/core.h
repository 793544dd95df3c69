/* One gyroscope: parameters, inputs, state, and the steps that move it. The FMI layers (fmi2.c, fmi3.c) call only this header.

   Time is an integer count of picoseconds since the start. Everything that the device is (variables, effects) comes from generated/model.h. */

#ifndef GYRO_CORE_H
#define GYRO_CORE_H

#include <stddef.h>
#include <stdint.h>

#include "generated/model.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

#define GYRO_MESSAGE_SIZE 320

typedef enum {
    GYRO_OK = 0,
    GYRO_ERROR = 1, /* refused, the instance is unchanged; or a step diverged. The message says why */
    GYRO_EARLY = 2  /* a step ended before its end; gyro_time says where, and the next one goes on from there */
} gyro_status;

typedef struct gyro_instance gyro_instance;

/* A new instance with every variable at its start value; NULL when memory is short. */
gyro_instance *gyro_new(void);
void gyro_free(gyro_instance *g);

/* Back to what gyro_new gives, bit for bit. */
void gyro_reset(gyro_instance *g);

/* The text of the latest GYRO_ERROR, "" before any. */
const char *gyro_message(const gyro_instance *g);

/* Variables by value reference, 0 <= vr < GYRO_N_VARIABLES (see gyro_variables[] for name, kind, start, min, max). SI units.
   gyro_set takes any finite value and never checks the life cycle: both are the FMI layer's to ask. */
void gyro_set(gyro_instance *g, uint32_t vr, double value);
double gyro_get(const gyro_instance *g, uint32_t vr);

/* The id of an effect that would act with this value of a tunable parameter and that this FMU can't follow; NULL where there is none. */
const char *gyro_foreign_effect(const gyro_instance *g, uint32_t vr, double value);

/* Checks the parameters, sets the initial state at `start_time` [s] and takes sample 0, so that outputs are valid. May be called again
   (after further gyro_set) until the first gyro_advance. */
gyro_status gyro_start(gyro_instance *g, double start_time);

/* Whether gyro_start holds. gyro_unstart: something was set since, so that gyro_start must come again before a step. */
int gyro_started(const gyro_instance *g);
void gyro_unstart(gyro_instance *g);

/* Moves time by `step` > 0 [s], inputs held. The instance keeps its own time, the start and the sum of all steps, to the nearest
   picosecond; `from`, the present time as the importer has it, is checked to its own rounding. The motion depends on when inputs
   change, never on how time is divided into steps. A state that is no longer finite is a GYRO_ERROR, with time at the instant that showed
   it, NaN as outputs, and no way on.
   With `to_sample` it ends early at the first sample on the way. `watch`, which may be NULL, is called with `watcher` at every point of the integration grid on the way, the outputs being those there,
   and gives the time [s] at which the step shall end, infinity for its own end; so does the parameter step_limit. */
typedef double (*gyro_watch)(void *watcher);
gyro_status gyro_advance(gyro_instance *g, double from, double step, int to_sample, gyro_watch watch, void *watcher);

/* Samples taken since the start, the first not counted; the time of the next one [s]. */
int64_t gyro_samples(const gyro_instance *g);
double gyro_next_sample(const gyro_instance *g);

/* Where samples are held, they are put out by gyro_latch only. */
void gyro_hold_samples(gyro_instance *g, int hold);
void gyro_latch(gyro_instance *g);

/* Present time [s]. */
double gyro_time(const gyro_instance *g);

/* The whole instance as bytes: magic, version, length, checksum, then numbers only (no pointers).
   gyro_load refuses what gyro_save of this very model did not write, or where `started` is 1 and the state has not started, and then
   leaves the instance as it was. It trusts no count and no number that it reads, whatever the checksum says. */
size_t gyro_save_size(const gyro_instance *g);
void gyro_save(const gyro_instance *g, unsigned char *bytes);
gyro_status gyro_load(gyro_instance *g, const unsigned char *bytes, size_t size, int started);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

/* The noise of the sensor: white, flicker, random walk; drawn at points of a grid and held from each to the next. */

#ifndef GYRO_DRIFT_H
#define GYRO_DRIFT_H

#include <stdint.h>

#include "generated/names.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

enum { GYRO_FLICKERS = 14, GYRO_SLOW = 2, GYRO_BLOCK = 32 };

/* Standard normal numbers of one stream, a block of which is drawn at once. */
typedef struct {
    int64_t block; /* which one, counted from 1; 0: none */
    double number[GYRO_BLOCK];
} gyro_numbers;

/* Follows from the parameters; what it holds of drawn numbers only spares drawing them again. */
typedef struct {
    uint32_t seed;
    double white;   /* of a normal number, rad/s */
    double flicker; /* likewise, of each process */
    double walk;
    double slow;     /* sum of the processes from GYRO_SLOW on of the points 4^GYRO_SLOW slow_at and after, rad/s; slow_at -1: none */
    int64_t slow_at;
    gyro_numbers of_white;
    gyro_numbers of_walk;
    gyro_numbers of_flicker[GYRO_FLICKERS];
} gyro_drift_plan;

/* What the noise remembers, rad/s. */
typedef struct {
    double flicker[GYRO_FLICKERS];
    double walk;
} gyro_drift;

/* N [rad/s0.5], B [rad/s], K [rad/s1.5]; step of the grid [s]. */
void gyro_plan_drift(gyro_drift_plan *plan, uint32_t seed, double angle_random_walk, double instability, double rate_random_walk, double step);

/* Brings the noise to the point 0, or from the point before to `point`. */
void gyro_start_drift(gyro_drift_plan *plan, gyro_drift *drift);
void gyro_next_drift(gyro_drift_plan *plan, gyro_drift *drift, int64_t point);

/* The noise [rad/s] from `point` on. */
double gyro_noise(gyro_drift_plan *plan, const gyro_drift *drift, int64_t point);

/* The bias [1] of a turn-on, standard normal. */
double gyro_turn_on(uint32_t seed, int64_t turn_on);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

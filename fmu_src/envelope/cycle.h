/* Signals around one cycle of the carrier: by harmonics, and by their values at evenly spaced phases. */

#ifndef GYRO_CYCLE_H
#define GYRO_CYCLE_H

#include "complex2.h"
#include "generated/names.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

enum {
    GYRO_HARMONICS = 3, /* the mean and this many */
    GYRO_PHASES = 32    /* a term of degree n is exact in all of them for n <= 28 */
};

/* s(φ) = mean + Σ Re{part[h - 1] e^(i h φ)}, of x and y. */
typedef struct {
    double mean[2];
    pair part[GYRO_HARMONICS];
} gyro_harmonics;

/* The values of x and y at φ = 2π k/GYRO_PHASES. */
typedef struct {
    double at[GYRO_PHASES][2];
} gyro_cycle;

gyro_cycle gyro_around(const gyro_harmonics *s);
gyro_harmonics gyro_spectrum(const gyro_cycle *s);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

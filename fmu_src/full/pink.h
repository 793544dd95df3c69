/* Pink noise: two independent numbers a sample of the one-sided density 1 Hz/f [1] from 1 Hz to half the sample rate, within 3.5 % (1.5 %
   below a hundredth of the sample rate); flat below about 0.1 Hz, so that the variance is finite. */

#ifndef GYRO_PINK_H
#define GYRO_PINK_H

#include <stdint.h>

#include "generated/names.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Enough for a sample period of 1 ns, the lowest bound, which takes 16; at most GYRO_MOST_LANES. */
enum { GYRO_PINK_SECTIONS = 20 };

/* Follows from the sample period. */
typedef struct {
    int n;                                /* sections in use */
    double pole[GYRO_PINK_SECTIONS];      /* of each section */
    double deviation[GYRO_PINK_SECTIONS]; /* standard deviation of each section, sqrt(Hz) */
    double drive[GYRO_PINK_SECTIONS];     /* of what each sample adds to it, sqrt(Hz) */
} gyro_pink_plan;

/* What a noise remembers from sample to sample. */
typedef struct {
    double section[GYRO_PINK_SECTIONS][2]; /* of both axes, sqrt(Hz) */
    double sum[2][2];                      /* their sum one and two samples ago, sqrt(Hz) */
    int64_t started;                       /* 1 after gyro_pink_start; a noise that is switched off keeps what it remembers */
} gyro_pink_memory;

void gyro_pink_design(gyro_pink_plan *plan, double sample_period);

/* Draws the memory before sample 0, as if the noise had gone on for ever. */
void gyro_pink_start(const gyro_pink_plan *plan, uint32_t seed, uint32_t stream, gyro_pink_memory *memory);

/* The noise of the next sample, which must be `sample`, sqrt(Hz). */
void gyro_pink_next(const gyro_pink_plan *plan, uint32_t seed, uint32_t stream, uint64_t sample, gyro_pink_memory *memory, double pink[2]);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

/* Counter-based noise: a standard normal number is a pure function of (seed, stream, counter, lane), so that any step pattern draws the same. */

#ifndef GYRO_NOISE_H
#define GYRO_NOISE_H

#include <stdint.h>

#include "generated/names.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Two independent standard normal numbers. */
void gyro_normal_pair(uint32_t seed, uint32_t stream, uint64_t counter, uint32_t lane, double normal[2]);

/* Those of the lanes 0 .. lanes - 1 at once, the same to the last bit; lanes <= GYRO_MOST_LANES. */
enum { GYRO_MOST_LANES = 20 };
void gyro_normal_pairs(uint32_t seed, uint32_t stream, uint64_t counter, int lanes, double normal[][2]);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

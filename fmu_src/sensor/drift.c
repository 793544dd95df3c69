/* Flicker noise as a sum of first-order processes with time constants a factor of 4 apart (M. S. Keshner, 1/f noise, Proc. IEEE 70, 1982), each
   drawn anew at every 4^i-th point only, so that all of them cost a third more than the first. */

#include "drift.h"

#include <string.h>

#include "gyro_math.h"
#include "noise.h"

/* CRC-32 of the parameters' names; a flicker process adds its number. */
static const uint32_t WHITE = 0x812243c1u, FLICKER = 0x9335c713u, WALK = 0x66217e9au, TURN_ON = 0xa9c0d611u;

/* From one number of a process to the next. With it and the first process, which stands for all faster ones, larger by FIRST in variance, the
   Allan deviation is within 2.2 % of FLAT B from two points of the grid on to a fifth of the slowest process (13 % of the sample at one). */
static const double POLE = 0.2, FIRST = 1.1;

/* √(2 ln 2/π): the Allan deviation of flicker noise over B (IEEE Std 952, annex C); that of the processes at variance 1 is 1. */
static const double FLAT = 0.6642824702679600;

void gyro_plan_drift(gyro_drift_plan *plan, uint32_t seed, double angle_random_walk, double instability, double rate_random_walk, double step)
{
    memset(plan, 0, sizeof *plan);
    plan->seed = seed;
    plan->slow_at = -1;
    plan->white = angle_random_walk / sqrt(step);
    plan->flicker = FLAT * instability;
    plan->walk = rate_random_walk * sqrt(step);
}

static double number(gyro_numbers *numbers, uint32_t seed, uint32_t stream, int64_t index)
{
    const int64_t block = index / GYRO_BLOCK + 1;
    if (numbers->block != block) {
        double pairs[GYRO_BLOCK / 2][2];
        gyro_normal_pairs(seed, stream, (uint64_t)block, GYRO_BLOCK / 2, pairs);
        memcpy(numbers->number, pairs, sizeof pairs);
        numbers->block = block;
    }
    return numbers->number[index % GYRO_BLOCK];
}

static double flicker_number(gyro_drift_plan *plan, int i, int64_t index)
{
    const double deviation = i == 0 ? sqrt(FIRST) : 1.0;
    return deviation * plan->flicker * number(&plan->of_flicker[i], plan->seed, FLICKER + (uint32_t)i, index);
}

void gyro_start_drift(gyro_drift_plan *plan, gyro_drift *drift)
{
    memset(drift, 0, sizeof *drift);
    plan->slow_at = -1;
    for (int i = 0; i < GYRO_FLICKERS && plan->flicker > 0.0; i++) {
        /* As if the noise had gone on for ever. */
        drift->flicker[i] = flicker_number(plan, i, 0);
    }
}

void gyro_next_drift(gyro_drift_plan *plan, gyro_drift *drift, int64_t point)
{
    const double drive = sqrt(1.0 - POLE * POLE);
    int64_t index = point;
    for (int i = 0; i < GYRO_FLICKERS && plan->flicker > 0.0; i++) {
        drift->flicker[i] = POLE * drift->flicker[i] + drive * flicker_number(plan, i, index);
        if (index % 4 != 0) {
            break;
        }
        index /= 4;
    }
    if (plan->walk > 0.0) {
        drift->walk += plan->walk * number(&plan->of_walk, plan->seed, WALK, point);
    }
}

/* The sum of the processes that change at few points. */
static double slow_flicker(gyro_drift_plan *plan, const gyro_drift *drift, int64_t point)
{
    const int64_t at = point >> 2 * GYRO_SLOW;
    if (plan->slow_at != at) {
        plan->slow_at = at;
        plan->slow = 0.0;
        for (int i = GYRO_SLOW; i < GYRO_FLICKERS; i++) {
            plan->slow += drift->flicker[i];
        }
    }
    return plan->slow;
}

double gyro_noise(gyro_drift_plan *plan, const gyro_drift *drift, int64_t point)
{
    double noise = drift->walk;
    if (plan->white > 0.0) {
        noise += plan->white * number(&plan->of_white, plan->seed, WHITE, point);
    }
    if (plan->flicker > 0.0) {
        noise += drift->flicker[0] + drift->flicker[1] + slow_flicker(plan, drift, point);
    }
    return noise;
}

double gyro_turn_on(uint32_t seed, int64_t turn_on)
{
    double pair[2];
    gyro_normal_pair(seed, TURN_ON, (uint64_t)turn_on, 0u, pair);
    return pair[0];
}

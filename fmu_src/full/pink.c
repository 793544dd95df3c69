/* A sum of first-order random processes with corners evenly spaced on a logarithmic scale has the density 1/f between the lowest and the
   highest (M. S. Keshner, 1/f noise, Proc. IEEE 70, 1982). Each is stationary from the start and drawn on its own. */

#include "pink.h"

#include <string.h>

#include "gyro_math.h"
#include "noise.h"

/* 1.5 corners a decade, the natural logarithm of their ratio: ripple 4 exp(-pi^2/1.535) = 0.65 %. A process of variance SPACING [Hz] adds the
   density 1 Hz/f for its part of the scale. */
static const double SPACING = 1.535056728662697;

/* Sampling folds what lies above half the sample rate back. The highest corner, in half sample rates, the variance of its section, in SPACING,
   and a filter over the sum of three samples (1 at zero frequency) are those for which the largest deviation from 1/f is least. */
static const double HIGHEST = 0.692, HIGHEST_PART = 0.582;
static const double TAP[3] = {1.03077199, 0.02840696, -0.05917895};

/* The first corner below this is the last [Hz]. It takes the variance of all corners below it, weighted by frequency, which gives the right
   density at 1 Hz and above within 0.7 %. */
static const double LOWEST = 0.3;

static const double PI = 3.141592653589793;

void gyro_pink_design(gyro_pink_plan *plan, double sample_period)
{
    const double ratio = gyro_exp(-SPACING);
    double corner = HIGHEST * 0.5 / sample_period;
    int last = 0;
    memset(plan, 0, sizeof *plan);
    while (!last) {
        const int i = plan->n++;
        last = corner <= LOWEST || plan->n == GYRO_PINK_SECTIONS;
        const double part = (i == 0 ? HIGHEST_PART : 1.0) * (last ? 1.0 / (1.0 - ratio) : 1.0);
        plan->pole[i] = gyro_exp(-2.0 * PI * corner * sample_period);
        plan->deviation[i] = sqrt(SPACING * part);
        /* sqrt(1 - pole^2), without its cancellation. */
        plan->drive[i] = plan->deviation[i] * sqrt(-gyro_expm1(-4.0 * PI * corner * sample_period));
        corner *= ratio;
    }
}

/* Moves every section by one sample with the normal numbers of `counter`; gives the filtered sum. */
static void move(const gyro_pink_plan *plan, uint32_t seed, uint32_t stream, uint64_t counter, gyro_pink_memory *memory, double pink[2])
{
    double sum[2] = {0.0, 0.0};
    double normal[GYRO_PINK_SECTIONS][2];
    gyro_normal_pairs(seed, stream, counter, plan->n, normal);
    for (int i = 0; i < plan->n; i++) {
        for (int axis = 0; axis < 2; axis++) {
            memory->section[i][axis] = plan->pole[i] * memory->section[i][axis] + plan->drive[i] * normal[i][axis];
            sum[axis] += memory->section[i][axis];
        }
    }
    for (int axis = 0; axis < 2; axis++) {
        pink[axis] = TAP[0] * sum[axis] + TAP[1] * memory->sum[0][axis] + TAP[2] * memory->sum[1][axis];
        memory->sum[1][axis] = memory->sum[0][axis];
        memory->sum[0][axis] = sum[axis];
    }
}

/* Numbers drawn before sample 0: one for the start itself, then one for each sample that the filter remembers. */
enum { BEFORE = 3 };

void gyro_pink_start(const gyro_pink_plan *plan, uint32_t seed, uint32_t stream, gyro_pink_memory *memory)
{
    double unused[2];
    memset(memory, 0, sizeof *memory);
    memory->started = 1;
    gyro_normal_pairs(seed, stream, 0, plan->n, memory->section);
    for (int i = 0; i < plan->n; i++) {
        memory->section[i][0] *= plan->deviation[i];
        memory->section[i][1] *= plan->deviation[i];
    }
    for (uint64_t counter = 1; counter < BEFORE; counter++) {
        move(plan, seed, stream, counter, memory, unused);
    }
}

void gyro_pink_next(const gyro_pink_plan *plan, uint32_t seed, uint32_t stream, uint64_t sample, gyro_pink_memory *memory, double pink[2])
{
    move(plan, seed, stream, sample + BEFORE, memory, pink);
}

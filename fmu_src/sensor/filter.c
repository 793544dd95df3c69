/* s' = A s + B u with u held: s(h) = e^(Ah) s + ... u, both from the exponential of the matrix of A and B above zeros, by scaling and squaring
   of its Taylor series: no case for poles that are real, equal or slow, and the same bits on every platform. */

#include "filter.h"

#include <string.h>

#include "gyro_math.h"
#include "instance.h"

enum { FILTER_ORDER = GYRO_ORDER, WITH_INPUTS = GYRO_ORDER + 2, SERIES_TERMS = 14, SLOTS_PROBED = 4 };

typedef double matrix8[WITH_INPUTS][WITH_INPUTS];

static void multiply_matrices(matrix8 a, matrix8 b, matrix8 product)
{
    matrix8 sum;
    for (int i = 0; i < WITH_INPUTS; i++) {
        for (int j = 0; j < WITH_INPUTS; j++) {
            sum[i][j] = 0.0;
            for (int k = 0; k < WITH_INPUTS; k++) {
                sum[i][j] += a[i][k] * b[k][j];
            }
        }
    }
    memcpy(product, sum, sizeof sum);
}

static double largest_row(matrix8 a)
{
    double largest = 0.0;
    for (int i = 0; i < WITH_INPUTS; i++) {
        double row = 0.0;
        for (int j = 0; j < WITH_INPUTS; j++) {
            row += fabs(a[i][j]);
        }
        largest = row > largest ? row : largest;
    }
    return largest;
}

/* a becomes e^a. */
static void exponentiate(matrix8 a)
{
    matrix8 term, sum;
    int halvings = 0;
    double scale = 1.0;
    for (double norm = largest_row(a); norm * scale > 0.5 && halvings < 64; halvings++) {
        scale *= 0.5;
    }
    memset(term, 0, sizeof term);
    for (int i = 0; i < WITH_INPUTS; i++) {
        term[i][i] = 1.0;
        for (int j = 0; j < WITH_INPUTS; j++) {
            a[i][j] *= scale;
        }
    }
    memcpy(sum, term, sizeof sum);
    /* 0.5^14/14! = 7e-16 of the first left out. */
    for (int k = 1; k < SERIES_TERMS; k++) {
        multiply_matrices(term, a, term);
        for (int i = 0; i < WITH_INPUTS; i++) {
            for (int j = 0; j < WITH_INPUTS; j++) {
                term[i][j] /= k;
                sum[i][j] += term[i][j];
            }
        }
    }
    for (; halvings > 0; halvings--) {
        multiply_matrices(sum, sum, sum);
    }
    memcpy(a, sum, sizeof sum);
}

static void find_transition(const gyro_filter *filter, gyro_transition *over, int64_t ticks)
{
    const double seconds = (double)ticks / GYRO_TICKS_A_SECOND;
    const gyro_section *one = &filter->section[0], *two = &filter->section[1];
    const double h1 = one->frequency * seconds, h2 = two->frequency * seconds;
    const double damped = -2.0 * one->damping * h1, signal = h2 * one->lead * one->frequency, noise = h2 * filter->noise_lead * one->frequency;
    matrix8 a = {
        {0.0, h1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0},
        {-h1, damped, 0.0, 0.0, 0.0, 0.0, h1, 0.0},
        {0.0, 0.0, 0.0, h1, 0.0, 0.0, 0.0, 0.0},
        {0.0, 0.0, -h1, damped, 0.0, 0.0, 0.0, h1},
        {0.0, 0.0, 0.0, 0.0, 0.0, h2, 0.0, 0.0},
        {h2, signal, h2, noise, -h2, -2.0 * two->damping * h2, 0.0, 0.0},
    };
    exponentiate(a);
    over->ticks = ticks;
    memcpy(over->move, a, sizeof over->move);
    over->warm = filter->lag > 0.0 ? -gyro_expm1(-seconds / filter->lag) : 1.0;
}

const gyro_transition *gyro_transition_of(gyro_filter *filter, int64_t ticks)
{
    const uint32_t first = (uint32_t)(((uint64_t)ticks * UINT64_C(0x9E3779B97F4A7C15)) >> 57);
    gyro_transition *found = NULL;
    for (uint32_t i = 0; i < SLOTS_PROBED && found == NULL; i++) {
        gyro_transition *kept = &filter->kept[(first + i) % GYRO_KEPT];
        found = kept->ticks == ticks ? kept : NULL;
    }
    for (uint32_t i = 0; i < SLOTS_PROBED && found == NULL; i++) {
        gyro_transition *kept = &filter->kept[(first + i) % GYRO_KEPT];
        found = kept->ticks == 0 ? kept : NULL;
    }
    if (found == NULL) {
        found = &filter->kept[(first + filter->turn++ % SLOTS_PROBED) % GYRO_KEPT];
    }
    if (found->ticks != ticks) {
        find_transition(filter, found, ticks);
    }
    return found;
}

void gyro_move_filter(const gyro_transition *over, double state[FILTER_ORDER], double input, double noise)
{
    double moved[FILTER_ORDER];
    for (int i = 0; i < FILTER_ORDER; i++) {
        moved[i] = over->move[i][FILTER_ORDER] * input + over->move[i][FILTER_ORDER + 1] * noise;
        for (int j = 0; j < FILTER_ORDER; j++) {
            moved[i] += over->move[i][j] * state[j];
        }
    }
    memcpy(state, moved, sizeof moved);
}

void gyro_rest_filter(double state[FILTER_ORDER], double input)
{
    memset(state, 0, FILTER_ORDER * sizeof *state);
    state[0] = input;
    state[4] = input;
}

double gyro_filtered(const gyro_filter *filter, const double state[FILTER_ORDER])
{
    return state[4] + filter->section[1].lead * filter->section[1].frequency * state[5];
}

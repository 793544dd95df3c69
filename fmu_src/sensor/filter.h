/* The sensor's bandwidth: two sections in a row, each (1 + l s)/(1 + 2 d s/w + s²/w²), exact for an input that is held. Noise passes the first
   one by itself, with a zero of its own: both sides of a resonance add to noise by their power. */

#ifndef GYRO_FILTER_H
#define GYRO_FILTER_H

#include <stdint.h>

#include "generated/names.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

enum { GYRO_ORDER = 6, GYRO_KEPT = 128 };

/* A section: w [rad/s], d [1], l [s]. */
typedef struct {
    double frequency;
    double damping;
    double lead;
} gyro_section;

/* Over one length of time. The states of a section are its output without the zero and that one's rate over w: of the first section for the
   input and for the noise, then of the second. */
typedef struct {
    int64_t ticks;                           /* the length; 0: none */
    double move[GYRO_ORDER][GYRO_ORDER + 2]; /* state = move (state, input, noise) */
    double warm;                             /* part of the way to the ambient temperature that the structure goes */
} gyro_transition;

/* Those of the latest lengths: an importer has few. */
typedef struct {
    gyro_section section[2];
    double noise_lead; /* of the first section for the noise, s */
    double lag; /* of the structure, s */
    gyro_transition kept[GYRO_KEPT];
    uint32_t turn; /* of those that a new one may displace, the next */
} gyro_filter;

/* The transition over `ticks` > 0; it is valid until the next call. */
const gyro_transition *gyro_transition_of(gyro_filter *filter, int64_t ticks);

/* Moves the state, shape (GYRO_ORDER), under a held input and noise. */
void gyro_move_filter(const gyro_transition *over, double state[GYRO_ORDER], double input, double noise);

/* The state that stays under that input without noise, and the output of a state; both in the unit of the input. */
void gyro_rest_filter(double state[GYRO_ORDER], double input);
double gyro_filtered(const gyro_filter *filter, const double state[GYRO_ORDER]);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

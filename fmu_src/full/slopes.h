/* The states that move, and how their rates go with them. */

#ifndef GYRO_SLOPES_H
#define GYRO_SLOPES_H

#include "generated/tangent.h"
#include "matrices.h"

enum { MOTION = GYRO_STATE_Y_DOT + 1, OWN = GYRO_N_STATES - MOTION };

/* Some of the states. */
typedef struct {
    int n;
    int place[GYRO_N_STATES];
} chosen;

/* The states of the motion, and those which effects add that act in `view` and, where that is another, do not in `beside`. */
static inline chosen states_of(const gyro_view *view, const gyro_view *beside)
{
    chosen made = {0, {0}};
    for (int i = 0; i < MOTION && !beside; i++) {
        made.place[made.n++] = i;
    }
    for (int i = 0; i < OWN; i++) {
        if (view->active[gyro_owners[i]] && !(beside && beside->active[gyro_owners[i]])) {
            made.place[made.n++] = MOTION + i;
        }
    }
    return made;
}

/* How the rates of some states go with them, in the view as it is; `along` is zero, which takes as long to make. */
static inline void find_slope(const gyro_view *view, const chosen *moving, gyro_tangent *along, matrix *slope)
{
    double rate[GYRO_N_STATES];
    for (int j = 0; j < moving->n; j++) {
        along->s[moving->place[j]] = 1.0;
        tangent_rate(view, along, rate);
        along->s[moving->place[j]] = 0.0;
        for (int i = 0; i < moving->n; i++) {
            slope->of[i][j] = rate[moving->place[i]];
        }
    }
}

#endif

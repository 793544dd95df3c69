/* The motion where a steep force holds a mass: a dry friction near rest takes up whatever pushes, and leaves a creep whose speed follows within
   microseconds. No series goes much further than these. Once the speed has settled the motion is linear about where it is, and goes any way at once:
   s(h) = s + h phi_1(h J) s', J being the slope of the rates (M. Hochbruck, A. Ostermann, Exponential integrators, Acta Numerica 19, 2010). */

#ifndef GYRO_REST_H
#define GYRO_REST_H

#include "slopes.h"

/* Series in a step after which it is looked whether a mass rests, and how many more until it is looked again: a motion that turns round takes up to
   fifteen, and what settles is there to 1e-10 after eight of three time constants. */
enum { GYRO_REST_AFTER = 8, GYRO_REST_AGAIN = 4 };

/* Where the rest of the step is too long for that, parts of it that are tried, each of the one before, down to the least. */
static const double GYRO_REST_SHORTER = 1.0 / 8, GYRO_REST_LEAST = 1.0 / 512;

/* Time constants that the rest of the step must be at least: of fewer, series make short work. */
static const double GYRO_REST_STEEP = 30.0;

/* What may be left out of a state, over its size, which of a speed or a place is that of both axes: so much then is also left out of the way of a
   creep. */
static const double GYRO_REST_LEFT = 1e-9;

/* h |J| up to which GYRO_REST_TERMS terms of phi_1 are all that rounding leaves. */
static const double GYRO_REST_SMALL = 0.25;
enum { GYRO_REST_TERMS = 9, GYRO_REST_DOUBLINGS = 60 };

/* How n states of a slope J pass differences on over a step h [s], exp(h J), and what rates add that stay, h phi_1(h J), and that rise along a line
   from zero to one, h phi_2(h J): those of a part of the step, doubled. */
typedef struct {
    matrix passage, steady, rising;
} settling;

static inline void double_settling(int n, const settling *half, settling *whole)
{
    find_product(n, 0.5, &half->passage, &half->rising, &whole->rising);
    add_scaled(n, 0.5, &half->rising, &whole->rising);
    add_scaled(n, 0.5, &half->steady, &whole->rising);
    find_product(n, 1.0, &half->passage, &half->steady, &whole->steady);
    add_scaled(n, 1.0, &half->steady, &whole->steady);
    find_product(n, 1.0, &half->passage, &half->passage, &whole->passage);
}

/* Finds that in one of two, which it gives. */
static inline const settling *find_settling(int n, const matrix *slope, double h, double norm, settling over[2])
{
    double part = h;
    int doublings = 0;
    matrix power[2] = {{{{0.0}}}};
    while (part * norm > GYRO_REST_SMALL && doublings < GYRO_REST_DOUBLINGS) {
        part *= 0.5;
        doublings++;
    }
    set_diagonal(n, part, &power[0]);
    set_diagonal(n, part, &over[0].steady);
    set_diagonal(n, 0.5 * part, &over[0].rising);
    set_diagonal(n, 1.0, &over[0].passage);
    for (int k = 1; k < GYRO_REST_TERMS; k++) {
        find_product(n, part / (k + 1), slope, &power[(k - 1) % 2], &power[k % 2]);
        add_scaled(n, 1.0, &power[k % 2], &over[0].steady);
        add_scaled(n, 1.0 / (k + 2), &power[k % 2], &over[0].rising);
    }
    find_product(n, 1.0, slope, &over[0].steady, &power[0]);
    add_scaled(n, 1.0, &power[0], &over[0].passage);
    for (int k = 0; k < doublings; k++) {
        double_settling(n, &over[k % 2], &over[(k + 1) % 2]);
    }
    return &over[doublings % 2];
}

/* The size of a state, of which those of the motion go by both axes. */
static inline double size_at_rest(const double s[GYRO_N_STATES], int own)
{
    const int other = own < MOTION ? (own + GYRO_STATE_Y - GYRO_STATE_X) % MOTION : own;
    return larger(fabs(s[own]), fabs(s[other]));
}

/* Whether what the linear motion leaves out of the rates at its end is nothing, over a step h [s] from `before` to the states of the view. */
static inline int has_rested(const gyro_view *g, const chosen *moving, const matrix *slope, double h, const double before[GYRO_N_STATES],
                             const double rate[GYRO_N_STATES])
{
    double end[GYRO_N_STATES];
    int rested = 1;
    state_rate(g, end);
    for (int i = 0; i < moving->n; i++) {
        const int own = moving->place[i];
        double left = end[own] - rate[own];
        for (int j = 0; j < moving->n; j++) {
            left -= slope->of[i][j] * (g->s[moving->place[j]] - before[moving->place[j]]);
        }
        const double steep = larger(-slope->of[i][i], 0.0);
        rested = rested && fabs(left) <= GYRO_REST_LEFT * (1.0 / h + steep) * larger(size_at_rest(g->s, own), size_at_rest(before, own));
    }
    return rested;
}

/* Finds how the rates of the states that move go with them; gives the axes, 1 for x, 2 for y and 3 for both, on which a force is so steep that
   what it holds settles well within h [s]. */
static inline int find_steep(const gyro_view *g, double h, chosen *moving, matrix *slope)
{
    gyro_tangent along;
    memset(&along, 0, sizeof along);
    memset(slope, 0, sizeof *slope);
    *moving = states_of(g, NULL);
    find_slope(g, moving, &along, slope);
    const int x = -h * slope->of[GYRO_STATE_X_DOT][GYRO_STATE_X_DOT] > GYRO_REST_STEEP;
    const int y = -h * slope->of[GYRO_STATE_Y_DOT][GYRO_STATE_Y_DOT] > GYRO_REST_STEEP;
    return x + 2 * y;
}

/* Moves the view over h [s] if a steep force holds the mass; else gives 0, and has moved nothing. */
static inline int move_at_rest(gyro_view *g, double h)
{
    chosen moving;
    matrix slope;
    int moves = find_steep(g, h, &moving, &slope);
    if (moves) {
        settling two[2];
        double rate[GYRO_N_STATES], before[GYRO_N_STATES], unit[GYRO_N_STATES];
        balance(moving.n, &slope, unit);
        const settling *over = find_settling(moving.n, &slope, h, norm_of(moving.n, &slope, unit), two);
        state_rate(g, rate);
        memcpy(before, g->s, sizeof before);
        for (int i = 0; i < moving.n; i++) {
            for (int j = 0; j < moving.n; j++) {
                g->s[moving.place[i]] += over->steady.of[i][j] * rate[moving.place[j]];
            }
        }
        moves = has_rested(g, &moving, &slope, h, before, rate);
        if (!moves) {
            memcpy(g->s, before, sizeof before);
        }
    }
    return moves;
}

#endif

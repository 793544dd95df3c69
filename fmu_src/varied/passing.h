/* What states that move by a matrix pass on over a part of a step. Used by follow.c and variation.c. */

#ifndef GYRO_PASSING_H
#define GYRO_PASSING_H

#include "slopes.h"

enum { NODES = 2 };

/* Parts of a step at which the nodes lie, 1/2 -+ sqrt(3)/6. */
static const double PLACE[NODES] = {0.21132486540518713, 0.7886751345948129};

/* The line that is 1 at a node and 0 at the other: at the start of a step, and how it rises over it. */
static const double LINE[NODES][2] = {{1.3660254037844386, -1.7320508075688772}, {-0.3660254037844386, 1.7320508075688772}};

/* Terms of a series, at most: enough for a mode at ten times the rate of the steps. */
enum { TERMS = 200 };

/* Adds a matrix; whether that changes any number. */
static inline int is_more(int n, const matrix *a, matrix *to)
{
    int more = 0;
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            const double sum = to->of[i][j] + a->of[i][j];
            more |= sum != to->of[i][j];
            to->of[i][j] = sum;
        }
    }
    return more;
}

/* exp(a) by so many terms. */
static inline void find_exponential(int n, const matrix *a, int terms, matrix *found)
{
    matrix power[2];
    set_diagonal(n, 1.0, &power[0]);
    set_diagonal(n, 1.0, found);
    for (int k = 1, more = 1; k <= terms && more; k++) {
        find_product(n, 1.0 / k, a, &power[(k - 1) % 2], &power[k % 2]);
        more = is_more(n, &power[k % 2], found);
    }
}

/* What states that move by a d + g(t) pass on over a part of a step, and what g at the step's nodes adds. */
typedef struct {
    matrix passage;
    matrix weight[NODES]; /* s */
} passing;

/* For a `part` of a step h [s]; a [1/s in the units of n states]. */
static inline void find_passing(int n, const matrix *a, double h, double part, passing *made)
{
    const double end = part * h;
    matrix scaled = {{{0.0}}};
    add_scaled(n, end, a, &scaled);
    find_exponential(n, &scaled, TERMS, &made->passage);
    for (int node = 0; node < NODES; node++) {
        set_diagonal(n, 0.0, &made->weight[node]);
    }
    for (int j = 0; j < 2; j++) {
        /* The integral of exp(a (end - t)) (t/h)^j is the sum of a^r end^(r + 1) part^j/(r + 1)...(r + j + 1). */
        matrix power[2], sum;
        set_diagonal(n, j == 0 ? end : 0.5 * end * part, &power[0]);
        set_diagonal(n, 0.0, &sum);
        for (int r = 0; r < TERMS && is_more(n, &power[r % 2], &sum); r++) {
            find_product(n, 1.0 / (r + j + 2), &scaled, &power[r % 2], &power[(r + 1) % 2]);
        }
        for (int node = 0; node < NODES; node++) {
            add_scaled(n, LINE[node][j], &sum, &made->weight[node]);
        }
    }
}

#endif

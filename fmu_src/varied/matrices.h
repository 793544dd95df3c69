/* Matrices of a few states, and what a motion by one passes on over a part of a step. Used by variation.c alone. */

#ifndef GYRO_MATRICES_H
#define GYRO_MATRICES_H

#include "generated/effects.h"

enum { MOTION = GYRO_STATE_Y_DOT + 1, OWN = GYRO_N_STATES - MOTION, NODES = 2, MOST = OWN > MOTION ? OWN : MOTION };

/* Parts of a step at which the nodes lie, 1/2 -+ sqrt(3)/6. */
static const double PLACE[NODES] = {0.21132486540518713, 0.7886751345948129};

/* The line that is 1 at a node and 0 at the other: at the start of a step, and how it rises over it. */
static const double LINE[NODES][2] = {{1.3660254037844386, -1.7320508075688772}, {-0.3660254037844386, 1.7320508075688772}};

/* Terms of a series whose size is not known: enough for a mode at ten times the rate of the steps. */
enum { TERMS = 200 };

typedef struct {
    double of[MOST][MOST];
} matrix;

static inline matrix matrix_product(int n, const matrix *a, const matrix *b)
{
    matrix c = {{{0.0}}};
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            double sum = 0.0;
            for (int k = 0; k < n; k++) {
                sum += a->of[i][k] * b->of[k][j];
            }
            c.of[i][j] = sum;
        }
    }
    return c;
}

static inline void add_scaled(int n, double factor, const matrix *a, matrix *to)
{
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            to->of[i][j] += factor * a->of[i][j];
        }
    }
}

static inline matrix matrix_of(int n, double diagonal)
{
    matrix made = {{{0.0}}};
    for (int i = 0; i < n; i++) {
        made.of[i][i] = diagonal;
    }
    return made;
}

/* exp(a) by so many terms; a [units of n states]. */
static inline matrix matrix_exponential(int n, const matrix *a, int terms)
{
    matrix power = matrix_of(n, 1.0), sum = power;
    for (int k = 1; k <= terms; k++) {
        const matrix next = matrix_product(n, &power, a);
        power = matrix_of(n, 0.0);
        add_scaled(n, 1.0 / k, &next, &power);
        add_scaled(n, 1.0, &power, &sum);
    }
    return sum;
}

/* What states that move by a d + g(t) pass on over a part of a step, and what g at the step's nodes adds. */
typedef struct {
    matrix passage;
    matrix weight[NODES]; /* s */
} passing;

/* For a `part` of a step h [s]; a [1/s in the units of n states]. */
static passing passing_of(int n, const matrix *a, double h, double part)
{
    const double end = part * h;
    matrix scaled = matrix_of(n, 0.0);
    add_scaled(n, end, a, &scaled);
    passing made;
    made.passage = matrix_exponential(n, &scaled, TERMS);
    for (int node = 0; node < NODES; node++) {
        made.weight[node] = matrix_of(n, 0.0);
    }
    for (int j = 0; j < 2; j++) {
        /* The integral of exp(a (end - t)) (t/h)^j is the sum of a^r end^(r + 1) part^j/(r + 1)...(r + j + 1). */
        matrix power = matrix_of(n, j == 0 ? end : 0.5 * end * part), sum = matrix_of(n, 0.0);
        for (int r = 0; r < TERMS; r++) {
            add_scaled(n, 1.0, &power, &sum);
            const matrix next = matrix_product(n, &power, &scaled);
            power = matrix_of(n, 0.0);
            add_scaled(n, 1.0 / (r + j + 2), &next, &power);
        }
        for (int node = 0; node < NODES; node++) {
            add_scaled(n, LINE[node][j], &sum, &made.weight[node]);
        }
    }
    return made;
}

#endif

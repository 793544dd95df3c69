/* What states that move by a matrix pass on over a part of a step. Used by linearise.c and variation.c. */

#ifndef GYRO_PASSING_H
#define GYRO_PASSING_H

#include "rest.h"

enum { NODES = 2 };

/* Parts of a step at which the nodes lie, 1/2 -+ sqrt(3)/6. */
static const double PLACE[NODES] = {0.21132486540518713, 0.7886751345948129};

/* The line that is 1 at a node and 0 at the other: at the start of a step, and how it rises over it. */
static const double LINE[NODES][2] = {{1.3660254037844386, -1.7320508075688772}, {-0.3660254037844386, 1.7320508075688772}};

/* Times h^2 the commutator's weight, sqrt(3)/12. */
static const double TURNED = 0.14433756729740643;

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

/* The exponent by which a piece of h [s] passes differences on, by the slopes at its nodes. */
static inline void find_exponent(int n, const matrix slope[NODES], double h, matrix *found)
{
    matrix product;
    set_diagonal(n, 0.0, found);
    add_scaled(n, 0.5 * h, &slope[0], found);
    add_scaled(n, 0.5 * h, &slope[1], found);
    find_product(n, -TURNED * h * h, &slope[0], &slope[1], &product);
    add_scaled(n, 1.0, &product, found);
    find_product(n, TURNED * h * h, &slope[1], &slope[0], &product);
    add_scaled(n, 1.0, &product, found);
}

/* The same of h [s] by exponents that are not much more than 1, in so many terms of series; slope: at the nodes. */
static inline void find_short_passing(int n, const matrix slope[NODES], const matrix *exponents, int terms, double h, passing *made)
{
    matrix power[2] = {{{{0.0}}}}, more, weight[NODES];
    set_diagonal(n, 0.0, &made->passage);
    for (int node = 0; node < NODES; node++) {
        set_diagonal(n, 0.0, &weight[node]);
    }
    for (int k = 0; k <= terms; k++) {
        matrix *latest = &power[k % 2];
        if (k == 0) {
            set_diagonal(n, 1.0, latest);
        } else {
            find_product(n, 1.0 / k, exponents, &power[(k - 1) % 2], latest);
        }
        add_scaled(n, 1.0, latest, &made->passage);
        for (int node = 0; node < NODES; node++) {
            add_scaled(n, h / (k + 1) * (LINE[node][0] + LINE[node][1] / (k + 2)), latest, &weight[node]);
        }
    }
    /* The exponents from a node to the end are more than their share of the whole, by as much from both nodes. */
    set_diagonal(n, 1.0, &more);
    add_scaled(n, -TURNED * h, &slope[0], &more);
    add_scaled(n, TURNED * h, &slope[1], &more);
    for (int node = 0; node < NODES; node++) {
        find_product(n, 1.0, &more, &weight[node], &made->weight[node]);
    }
}

/* The same of any h [s] where the slopes at both nodes are alike, and too steep for a series; norm: of the exponent. */
static inline void find_steep_passing(int n, const matrix *exponent, double h, double norm, passing *made)
{
    settling two[2];
    const settling *over = find_settling(n, exponent, 1.0, norm, two);
    made->passage = over->passage;
    for (int node = 0; node < NODES; node++) {
        set_diagonal(n, 0.0, &made->weight[node]);
        add_scaled(n, h * LINE[node][0], &over->steady, &made->weight[node]);
        add_scaled(n, h * LINE[node][1], &over->rising, &made->weight[node]);
    }
}

#endif

#include "no_lag.h"

#include "block.h"
#include "linear.h"
#include "unseen.h"

#define MAY 3.0    /* deviations within which a lag may have ended */
#define HAIR 1e-9  /* of the way to the end of a lag that is left, so that it stays on its side */
#define PASSES 2.0 /* changes of the lag over a block, beyond the noise, within which it is at its end */

/* The lag without its end, below zero beyond there [s], and its slopes by p. */
static double endless(const known *k, double slopes[NP])
{
    linear at, by[NP];
    linear_of(k, &at, by);
    for (int q = 0; q < NP; q++) {
        slopes[q] = by[q].lag;
    }
    return at.lag;
}

/* The most of `step` and a `way` beside it that no lowest value forbids. */
static double room(const filter *f, const double step[NP], const double way[NP])
{
    double eta[NP], end[NP], most = 1.0;
    for (int i = 0; i < NP; i++) {
        eta[i] = f->eta[i] + step[i];
        end[i] = eta[i] + way[i];
    }
    for (int i = 0; i < NP; i++) {
        const double from = block_constant_at(f, eta, i), to = block_constant_at(f, end, i);
        if (to < f->lowest[i] && to < from) {
            most = smaller(most, larger(from - f->lowest[i], 0.0) / (from - to));
        }
    }
    return most;
}

void no_lag_look(filter *f, double L[NP][NP], double step[NP])
{
    known k = f->k;
    double eta[NP], slopes[NP], g[NP], along[NP], half[NP];
    memset(f->reopened, 0, sizeof f->reopened);
    if (!LAG_ENDS || f->growing) {
        return;
    }
    for (int i = 0; i < NP; i++) {
        eta[i] = f->eta[i] + step[i];
    }
    for (int i = 0; i < NP; i++) {
        k.p[i] = block_constant_at(f, eta, i);
    }
    const double lag = endless(&k, slopes);
    memcpy(k.in, f->in[0], sizeof k.in);
    const double moved = lag - endless(&k, half);
    block_row_in_eta(f, slopes, g);
    block_solve(L, g, along, half);
    const double before = block_squared(g), after = block_squared(half);
    const double reach = PASSES * fabs(moved) + MAY * sqrt(after);
    if (lag * moved < 0.0 && lag * lag < MAY * MAY * after) {
        double way[NP];
        for (int i = 0; i < NP; i++) {
            way[i] = -(1.0 - HAIR) * lag / after * along[i];
        }
        const double most = room(f, step, way);
        for (int i = 0; i < NP; i++) {
            step[i] += most * way[i];
        }
    }
    if (fabs(lag) < reach && before > after) {
        const double part = smaller(sqrt(before - after), reach) / before;
        for (int i = 0; i < NP; i++) {
            for (int j = i; j < NP; j++) {
                f->reopened[i] += f->W[i][j] * g[j] * part;
            }
        }
    }
}

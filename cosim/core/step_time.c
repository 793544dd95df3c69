/* Each time that a step may have had is a hypothesis: a filter that knows of it, from before the step, and the likelihood of its innovations (A. Willsky
   and H. Jones, IEEE Trans. Automatic Control 21, 1976). Whether the velocity jumps as it is known to, or as by the Euler force of a frame that turns,
   is another. */

#include "step_time.h"

#include "known_model.h"
#include "prediction.h"

#define STRIDE 4       /* samples between the times that are tried first */
#define UNEXPLAINED 2.0 /* mean squared innovation over its variance of what is no step */
#define JUMPS 2        /* as known, or with the Euler force of a frame that turns */

/* Corrects z and P of one axis with the innovation e; returns e^2/S + log S. */
static double correct(moving *n, const double *c, double noise, double e, double *squared)
{
    double Pc[NZ], S = noise;
    for (int i = 0; i < NZ; i++) {
        Pc[i] = 0.0;
        for (int j = 0; j < NZ; j++) {
            Pc[i] += n->P[i][j] * c[j];
        }
        S += c[i] * Pc[i];
    }
    for (int i = 0; i < NZ; i++) {
        n->z[i] += Pc[i] / S * e;
        for (int j = 0; j < NZ; j++) {
            n->P[i][j] -= Pc[i] / S * Pc[j];
        }
    }
    *squared += e * e / S;
    return e * e / S + log(S);
}

/* Filters the present sample; returns its share of twice the negative logarithm of the likelihood. */
static double hear(filter *f, int64_t sample, double *squared)
{
    const heard *h = &f->heard[sample & (RECENT - 1)];
    double expected[2], C[2][NZ], by_p[2 * NP], noise[2], was[NZ], e;
    f->sample = sample;
    filter_enter(f, h->in);
    filter_predict(f);
    filter_expect(f, expected, C, by_p, noise);
    memcpy(was, f->now.z, sizeof was);
    double total = correct(&f->now, C[0], noise[0], h->v[0] - expected[0], squared);
    e = h->v[1] - expected[1];
    for (int i = 0; i < NZ; i++) {
        e -= C[1][i] * (f->now.z[i] - was[i]);
    }
    return total + correct(&f->now, C[1], noise[1], e, squared);
}

/* The rate steps now. */
static void jump(filter *f, double after, double variance, int euler)
{
    const double none[2] = {0.0, 0.0};
    double *z = f->now.z, by_rate[2];
    if (euler) {
        by_rate[0] = z[2];
        by_rate[1] = -z[0];
    } else {
        known_jump(&f->k, z, none, z[OMEGA], by_rate);
    }
    z[1] += (after - z[OMEGA]) * by_rate[0];
    z[3] += (after - z[OMEGA]) * by_rate[1];
    z[OMEGA] = after;
    for (int i = 0; i < NZ; i++) {
        f->now.P[i][OMEGA] = f->now.P[OMEGA][i] = 0.0;
    }
    f->now.P[OMEGA][OMEGA] = variance;
}

/* Twice the negative logarithm of the likelihood of the samples up to `looked` where the rate stepped at the sample `at`; `squared`: the mean squared
   innovation from there on, over its variance. */
static double unlikelihood(filter *f, int64_t at, int64_t looked, double after, double variance, int euler, const moving *before, int64_t from,
                           double *squared)
{
    double total = 0.0, unused = 0.0;
    f->now = *before;
    for (int64_t k = from + 1; k <= at; k++) {
        total += hear(f, k, &unused);
    }
    jump(f, after, variance, euler);
    *squared = 0.0;
    for (int64_t k = at + 1; k <= looked; k++) {
        total += hear(f, k, squared);
    }
    *squared /= 2.0 * (double)(looked - at);
    return total;
}

/* What a search goes through. */
typedef struct {
    int64_t from, earliest, seen, looked;
    double after, variance;
    moving before;
} search;

static double tried(filter *f, const search *s, int64_t at, int euler, double *squared)
{
    return unlikelihood(f, at, s->looked, s->after, s->variance, euler, &s->before, s->from, squared);
}

/* The most likely time with one kind of jump, by a parabola through the least and its neighbours; below zero where it is none inside. */
static double most_likely(filter *f, const search *s, int euler, double *least, double *squared)
{
    double ignored, value[2 * STRIDE + 1];
    int64_t best = s->earliest;
    *least = HUGE_VAL;
    for (int64_t at = s->earliest; at <= s->seen; at += STRIDE) {
        const double found = tried(f, s, at, euler, &ignored);
        if (found < *least) {
            *least = found;
            best = at;
        }
    }
    const int64_t first = best - STRIDE;
    int place = 0;
    for (int i = 0; i <= 2 * STRIDE; i++) {
        value[i] = tried(f, s, first + i, euler, &ignored);
        place = value[i] < value[place] ? i : place;
    }
    *least = tried(f, s, first + place, euler, squared);
    if (place == 0 || place == 2 * STRIDE) {
        return -1.0;
    }
    const double bend = value[place - 1] - 2.0 * value[place] + value[place + 1];
    return (double)(first + place) + (bend > 0.0 ? 0.5 * (value[place - 1] - value[place + 1]) / bend : 0.0);
}

double step_time(filter *f, int64_t earliest, int64_t seen, int64_t looked, double after)
{
    const int64_t sample = f->sample;
    const moving now = f->now;
    const motion m = f->m;
    const known k = f->k;
    search s;
    double at[JUMPS], least[JUMPS], squared[JUMPS];
    s.from = (earliest - STRIDE - 1) / EVERY * EVERY;
    s.earliest = earliest;
    s.seen = seen;
    s.looked = looked;
    s.after = after;
    s.variance = now.P[OMEGA][OMEGA];
    if (sample - s.from >= RECENT || s.from <= f->origin) {
        return -1.0;
    }
    memset(&s.before, 0, sizeof s.before);
    const before_now *b = &f->past[s.from / EVERY % (RECENT / EVERY)];
    memcpy(s.before.z, b->z, sizeof b->z);
    memcpy(s.before.P, b->P, sizeof b->P);
    for (int j = 0; j < JUMPS; j++) {
        at[j] = most_likely(f, &s, j, &least[j], &squared[j]);
    }
    f->sample = sample;
    f->now = now;
    f->m = m;
    f->k = k;
    const int best = least[1] < least[0];
    return squared[best] < UNEXPLAINED ? at[best] : -1.0;
}

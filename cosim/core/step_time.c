/* Each time that a step may have had is a hypothesis: a filter that knows of it, from before the step, and the likelihood of its innovations (A.
   Willsky and H. Jones, IEEE Trans. Automatic Control 21, 1976). Whether the velocity jumps as it is known to, or as by the Euler force of a frame
   that turns, is another. */

#include "step_time.h"

#include "correction.h"
#include "known_model.h"
#include "prediction.h"

#define HOPELESS 1000.0  /* above the least: less likely by exp(-500) */
#define UNEXPLAINED 2.0  /* mean squared innovation over its variance of what is no step */
#define JUMPS 2          /* as known, or with the Euler force of a frame that turns */

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
    filter_leave_out(f, h->v, noise);
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

/* What a search goes through: the samples from `earliest` on before a step, those up to `looked` after it; the rate after it and its variance. */
typedef struct {
    int64_t earliest, seen, looked;
    double after, variance;
} search;

static void go_back(filter *f, const before_now *b)
{
    memcpy(f->now.z, b->z, sizeof b->z);
    memcpy(f->now.P, b->P, sizeof b->P);
}

/* Filters on without a step, from sample `from` on. */
static void stand_still(filter *f, const search *s, int64_t from)
{
    double total = 0.0, unused = 0.0;
    for (int64_t k = from + 1; k <= s->seen; k++) {
        total += hear(f, k, &unused);
        if (k >= s->earliest) {
            still *b = &f->stills[k - s->earliest];
            memcpy(b->motion.z, f->now.z, sizeof b->motion.z);
            memcpy(b->motion.P, f->now.P, sizeof b->motion.P);
            b->unlikely = total;
        }
    }
}

/* Twice the negative logarithm of the likelihood of the samples where the rate stepped at the sample `at`; `squared`: the mean squared innovation
   from there on, over its variance. */
static double unlikelihood(filter *f, const search *s, int64_t at, int euler, double *squared)
{
    const still *b = &f->stills[at - s->earliest];
    double total = b->unlikely;
    go_back(f, &b->motion);
    jump(f, s->after, s->variance, euler);
    *squared = 0.0;
    for (int64_t k = at + 1; k <= s->looked; k++) {
        total += hear(f, k, squared);
    }
    *squared /= 2.0 * (double)(s->looked - at);
    return total;
}

/* The most likely time with one kind of jump, by a parabola through the least and its neighbours; below zero where it is none inside. Searches
   backwards, until earlier times are out of the question. */
static double most_likely(filter *f, const search *s, int euler, double *least, double *squared)
{
    double value[3] = {0.0, 0.0, 0.0}, of[2] = {0.0, 0.0}, best = -1.0;
    *least = HUGE_VAL;
    for (int64_t at = s->seen; at >= s->earliest && !(value[2] > *least + HOPELESS); at--) {
        value[0] = value[1];
        value[1] = value[2];
        of[0] = of[1];
        value[2] = unlikelihood(f, s, at, euler, &of[1]);
        if (at <= s->seen - 2 && value[1] <= value[0] && value[1] <= value[2] && value[1] < *least) {
            const double bend = value[0] - 2.0 * value[1] + value[2], off = bend > 0.0 ? 0.5 * (value[0] - value[2]) / bend : 0.0;
            /* A step between two samples: as badly as the nearest explains it, the parabola does not. */
            const double gained = 0.5 * bend * off * off;
            *least = value[1] - gained;
            *squared = of[0] - gained / (2.0 * (double)(s->looked - at - 1));
            best = (double)(at + 1) - off;
        }
    }
    return best;
}

double step_time(filter *f, int64_t earliest, int64_t seen, int64_t looked, double after)
{
    const int64_t sample = f->sample, from = (earliest - 1) / EVERY * EVERY;
    const moving now = f->now;
    const motion m = f->m;
    const known k = f->k;
    double at[JUMPS], least[JUMPS], squared[JUMPS] = {0.0};
    const search s = {.earliest = earliest, .seen = seen, .looked = looked, .after = after, .variance = now.P[OMEGA][OMEGA]};
    if (sample - from >= RECENT || seen - earliest >= TIMES || from <= f->origin) {
        return -1.0;
    }
    memset(f->now.Y, 0, sizeof f->now.Y);
    go_back(f, &f->past[from / EVERY % (RECENT / EVERY)]);
    stand_still(f, &s, from);
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

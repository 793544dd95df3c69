/* Each time that a step may have had is a hypothesis: a filter that knows of it, from before the step, and the likelihood of its innovations (A.
   Willsky and H. Jones, IEEE Trans. Automatic Control 21, 1976). What share of the Euler force of a frame that turns the package has is found with
   it. */

#include "step_time.h"

#include "correction.h"
#include "prediction.h"

#define HOPELESS 1000.0  /* above the least: less likely by exp(-500) */
#define SURELY 9.0       /* by which it must be less for a share that is neither none nor all: three standard deviations */
#define UNEXPLAINED 2.0  /* mean squared innovation over its variance of what is no step */

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

/* The rate steps now, and the velocity by this share of the Euler force of a frame that turns. */
static void jump(filter *f, double after, double variance, double share)
{
    double *z = f->now.z;
    const double change = share * (after - z[OMEGA]);
    z[1] += change * z[2];
    z[3] -= change * z[0];
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

/* How a step explains the samples: twice the negative logarithm of their likelihood, and the mean squared innovation from there on, over its
   variance. */
typedef struct {
    double unlikely, squared;
} account;

static account account_of(filter *f, const search *s, int64_t at, double share)
{
    const still *b = &f->stills[at - s->earliest];
    account a = {b->unlikely, 0.0};
    go_back(f, &b->motion);
    jump(f, s->after, s->variance, share);
    for (int64_t k = at + 1; k <= s->looked; k++) {
        a.unlikely += hear(f, k, &a.squared);
    }
    a.squared /= 2.0 * (double)(s->looked - at);
    return a;
}

static double parabola(double none, double half, double whole, double share)
{
    return none + share * (4.0 * half - 3.0 * none - whole) + 2.0 * share * share * (none - 2.0 * half + whole);
}

/* With the most likely share: innovations are linear in it, so that three shares tell of all. */
static account freely(account none, account half, account whole)
{
    const double bend = none.unlikely - 2.0 * half.unlikely + whole.unlikely, slope = 4.0 * half.unlikely - 3.0 * none.unlikely - whole.unlikely;
    const double share = bend > 0.0 ? smaller(larger(-0.25 * slope / bend, 0.0), 1.0) : none.unlikely < whole.unlikely ? 0.0 : 1.0;
    return (account){parabola(none.unlikely, half.unlikely, whole.unlikely, share), parabola(none.squared, half.squared, whole.squared, share)};
}

/* The time at which a step explains the samples best, by a parabola through the least and its neighbours, a[i] being that of the sample seen - i;
   below zero where it is none inside. */
static double most_likely(const search *s, const account *a, int count, account *best)
{
    double at = -1.0;
    best->unlikely = HUGE_VAL;
    for (int i = 1; i < count - 1; i++) {
        const double later = a[i - 1].unlikely, here = a[i].unlikely, earlier = a[i + 1].unlikely;
        if (here <= later && here <= earlier && here < best->unlikely) {
            const double bend = later - 2.0 * here + earlier, off = bend > 0.0 ? 0.5 * (later - earlier) / bend : 0.0;
            /* A step between two samples: as badly as the nearest explains it, the parabola does not. */
            const double gained = 0.5 * bend * off * off;
            best->unlikely = here - gained;
            best->squared = a[i].squared - gained / (2.0 * (double)(s->looked - s->seen + i));
            at = (double)(s->seen - i) - off;
        }
    }
    return at;
}

/* The same with the share of the Euler force that most packages have, none or all, or with another one where that is far more likely. Earlier times
   are looked at until they are out of the question. */
static double time_of(filter *f, const search *s, double *squared)
{
    account none[TIMES], whole[TIMES], any[TIMES], best[3];
    double least = HUGE_VAL;
    int count = 0;
    for (int64_t k = s->seen; k >= s->earliest && (count == 0 || !(any[count - 1].unlikely > least + HOPELESS)); k--, count++) {
        none[count] = account_of(f, s, k, 0.0);
        whole[count] = account_of(f, s, k, 1.0);
        any[count] = freely(none[count], account_of(f, s, k, 0.5), whole[count]);
        least = smaller(least, any[count].unlikely);
    }
    const double at[3] = {most_likely(s, none, count, &best[0]), most_likely(s, whole, count, &best[1]), most_likely(s, any, count, &best[2])};
    int taken = best[1].unlikely < best[0].unlikely;
    taken = best[2].unlikely < best[taken].unlikely - SURELY ? 2 : taken;
    *squared = best[taken].squared;
    return at[taken];
}

double step_time(filter *f, int64_t earliest, int64_t seen, int64_t looked, double after)
{
    const int64_t sample = f->sample, from = (earliest - 1) / EVERY * EVERY;
    const moving now = f->now;
    const motion m = f->m;
    const known k = f->k;
    double squared = 0.0;
    const search s = {.earliest = earliest, .seen = seen, .looked = looked, .after = after, .variance = now.P[OMEGA][OMEGA]};
    if (sample - from >= RECENT || seen - earliest >= TIMES || from <= f->origin) {
        return -1.0;
    }
    memset(f->now.Y, 0, sizeof f->now.Y);
    go_back(f, &f->past[from / EVERY % (RECENT / EVERY)]);
    stand_still(f, &s, from);
    const double at = time_of(f, &s, &squared);
    f->sample = sample;
    f->now = now;
    f->m = m;
    f->k = k;
    return squared < UNEXPLAINED ? at : -1.0;
}

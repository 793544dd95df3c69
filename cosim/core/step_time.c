/* Each time that a step may have had is a hypothesis: a filter that knows of it, from before the step, and the likelihood of its innovations (A.
   Willsky and H. Jones, IEEE Trans. Automatic Control 21, 1976). What share of the Euler force of a frame that turns the package has is found with
   it. */

#include "step_time.h"

#include "correction.h"
#include "prediction.h"

#define HOPELESS 1000.0  /* above the least: less likely by exp(-500) */
#define SURELY 9.0       /* by which it must be less for a share that is neither none nor all: three standard deviations */
#define MOST 100.0     /* by which one step may speak against a share: what it is taken for may be wrong */
#define BETWEEN 8        /* times between a sample and the next that are looked at */
#define UNEXPLAINED 2.0  /* mean squared innovation over its variance of what is no step */

static double share_of(int i) { return (double)i / (SHARES - 1); }

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
    double expected[2], C[2][NZ], by_p[2 * NW], noise[2], was[NZ], e;
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

/* With a share of the Euler force. Innovations are linear in it, so that the accounts of none, a half and the whole tell of all. */
static account with_share(const account three[3], double share)
{
    return (account){parabola(three[0].unlikely, three[1].unlikely, three[2].unlikely, share),
                     parabola(three[0].squared, three[1].squared, three[2].squared, share)};
}

/* How a step with some share explains the samples: at its most likely time, which is inside or not; and when it was by all times together. */
typedef struct {
    account as;
    int inside;
    step_found when;
} explained;

/* three[i]: accounts of the sample seen - i. Between samples a parabola through three of them tells. */
static explained explain(const search *s, account (*three)[3], int count, double share)
{
    explained e = {with_share(three[0], share), 0, {0.0, 0.0}};
    double total = 0.0, first = 0.0, second = 0.0;
    for (int i = 1; i < count - 1; i++) {
        const account here = with_share(three[i], share);
        const double later = with_share(three[i - 1], share).unlikely, earlier = with_share(three[i + 1], share).unlikely;
        const double slope = 0.5 * (earlier - later), bend = later - 2.0 * here.unlikely + earlier;
        for (int j = 0; j < BETWEEN; j++) {
            const double off = ((double)j + 0.5) / BETWEEN - 0.5, more = off * (slope + 0.5 * bend * off);
            const account at = {here.unlikely + more, here.squared + more / (2.0 * (double)(s->looked - s->seen + i))};
            if (at.unlikely < e.as.unlikely) {
                /* Weights are relative to the least so far. */
                const double fall = exp(0.5 * (at.unlikely - e.as.unlikely));
                total *= fall;
                first *= fall;
                second *= fall;
                e.as = at;
                e.inside = 1;
            }
            const double weight = exp(0.5 * (e.as.unlikely - at.unlikely)), back = (double)i + off;
            total += weight;
            first += weight * back;
            second += weight * back * back;
        }
    }
    if (e.inside) {
        const double mean = first / total;
        /* Of one sample alone rounding may leave less than nothing. */
        e.when = (step_found){(double)s->seen - mean, larger(second / total - mean * mean, 0.0)};
    }
    return e;
}

/* Accounts of the samples back from where the step has shown, until they are out of the question; returns how many. */
static int look_back(filter *f, const search *s, account (*three)[3])
{
    double least = HUGE_VAL, here = 0.0;
    int count = 0;
    for (int64_t k = s->seen; k >= s->earliest && !(here > least + HOPELESS); k--, count++) {
        here = HUGE_VAL;
        for (int i = 0; i < 3; i++) {
            three[count][i] = account_of(f, s, k, 0.5 * i);
        }
        for (int i = 0; i < SHARES; i++) {
            here = smaller(here, with_share(three[count], share_of(i)).unlikely);
        }
        least = smaller(least, here);
    }
    return count;
}

/* With the share that most packages have, none or all, or with another one where that is far more likely by this step and those before: a package
   has one. */
static explained explain_best(filter *f, const search *s, double unlikely[SHARES])
{
    account three[TIMES][3];
    explained with[SHARES];
    double total[SHARES], least = HUGE_VAL;
    const int count = look_back(f, s, three);
    int any = 0;
    for (int i = 0; i < SHARES; i++) {
        with[i] = explain(s, three, count, share_of(i));
        least = smaller(least, with[i].as.unlikely);
    }
    for (int i = 0; i < SHARES; i++) {
        total[i] = unlikely[i] + smaller(with[i].as.unlikely - least, MOST);
        any = total[i] < total[any] ? i : any;
    }
    const int usual = total[SHARES - 1] < total[0] ? SHARES - 1 : 0, taken = total[any] < total[usual] - SURELY ? any : usual;
    if (with[taken].inside && with[taken].as.squared < UNEXPLAINED) {
        memcpy(unlikely, total, sizeof total);
    }
    return with[taken];
}

step_found step_time(filter *f, int64_t earliest, int64_t seen, int64_t looked, double after, double unlikely[SHARES])
{
    const int64_t sample = f->sample, from = (earliest - 1) / EVERY * EVERY;
    const moving now = f->now;
    const motion m = f->m;
    const known k = f->k;
    const search s = {.earliest = earliest, .seen = seen, .looked = looked, .after = after, .variance = now.P[OMEGA][OMEGA]};
    const step_found none = {-1.0, 0.0};
    if (sample - from >= RECENT || seen - earliest >= TIMES || from <= f->origin) {
        return none;
    }
    memset(f->now.Y, 0, sizeof f->now.Y);
    go_back(f, &f->past[from / EVERY % (RECENT / EVERY)]);
    stand_still(f, &s, from);
    const explained e = explain_best(f, &s, unlikely);
    f->sample = sample;
    f->now = now;
    f->m = m;
    f->k = k;
    return e.inside && e.as.squared < UNEXPLAINED ? e.when : none;
}

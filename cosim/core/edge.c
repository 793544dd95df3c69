#include "edge.h"

#include "foucault.h"
#include "known_model.h"

#define STEP 1.0       /* change of the rate that is a step [rad/s] */
#define SUDDEN 1e-4    /* within this time [s] */
#define LATEST 4e-4    /* a step lies at most so long before it shows [s] */
#define MARGIN 3e-4    /* between the motion that is taken as before the step and that [s] */
#define SETTLED 1e-3   /* after which the rate is known again [s] */
#define SPAN 1e-3      /* over which the motion is averaged, before and after [s] */
#define EXPLAINED 0.3  /* share of the deviation that the best time may leave unexplained */
#define FINE 4         /* times tried a sample */

static const edge_sample *sample_at(const edge *e, int64_t k) { return &e->past[k & (EDGE_PAST - 1)]; }

static int64_t samples_in(const edge *e, double duration) { return (int64_t)(duration / e->period + 0.5); }

/* The orbit a time later: z'' + 2 i turn z' + w^2 z = 0. */
static orbit moved(orbit o, double turn, double w, double duration)
{
    const double complex up = 0.5 * (o.z + (o.v + I * turn * o.z) / (I * w)), down = o.z - up;
    const double complex swing = cexp(I * w * duration), frame = cexp(-I * turn * duration);
    const double complex ahead = frame * up * swing, back = frame * down * conj(swing);
    const orbit end = {ahead + back, I * (w - turn) * ahead - I * (w + turn) * back};
    return end;
}

/* Orientation of the straight line that an orbit is while the plane turns [rad]. */
static double orientation(orbit o, double turn, double w)
{
    const double complex v = (o.v + I * turn * o.z) / w;
    const double cross = 2.0 * (creal(o.z) * cimag(o.z) + creal(v) * cimag(v));
    return 0.5 * atan2(cross, creal(o.z * conj(o.z)) + 2.0 * creal(v) * creal(v) - 2.0 * cimag(o.z) * cimag(o.z) - creal(v * conj(v)));
}

static double mean_rate(const edge *e, int64_t first, int64_t last)
{
    double total = 0.0;
    for (int64_t k = first; k < last; k++) {
        total += sample_at(e, k)->rate;
    }
    return total / (double)(last - first);
}

/* The orbit at sample `at`, averaged over those from first to last - 1. */
static orbit mean_orbit(const edge *e, int64_t first, int64_t last, int64_t at, double turn, double w)
{
    orbit total = {0.0, 0.0};
    for (int64_t k = first; k < last; k++) {
        const edge_sample *s = sample_at(e, k);
        const orbit there = moved(s->free, turn, w, (double)(at - k) * e->period);
        total.z += there.z;
        total.v += there.v;
    }
    total.z /= (double)(last - first);
    total.v /= (double)(last - first);
    return total;
}

/* The rate that the force which acts from sample k on was computed with; the force is `delay` samples late. */
static double rate_acting(const edge *e, int64_t k, double delay)
{
    const int64_t whole = (int64_t)delay;
    const double part = delay - (double)whole;
    return (1.0 - part) * sample_at(e, k - whole)->rate + part * sample_at(e, k - whole - 1)->rate;
}

/* Squared deviation of b from a over the square of a's size, but for what amplitude and phase explain. */
static double deviation_of(orbit a, orbit b, double w)
{
    const double from[4] = {creal(a.z), cimag(a.z), creal(a.v) / w, cimag(a.v) / w};
    const double along[2][4] = {{from[0], from[1], from[2], from[3]}, {from[2], from[3], -from[0], -from[1]}};
    double d[4] = {creal(b.z) - from[0], cimag(b.z) - from[1], creal(b.v) / w - from[2], cimag(b.v) / w - from[3]}, size = 0.0, total = 0.0;
    for (int i = 0; i < 4; i++) {
        size += from[i] * from[i];
    }
    for (int n = 0; n < 2; n++) {
        double share = 0.0;
        for (int i = 0; i < 4; i++) {
            share += d[i] * along[n][i] / size;
        }
        for (int i = 0; i < 4; i++) {
            d[i] -= share * along[n][i];
        }
    }
    for (int i = 0; i < 4; i++) {
        total += d[i] * d[i];
    }
    return total / size;
}

/* Jump of the velocity by a step of the rate, per rad/s: the Euler force on all of the motion, where the package is known to have one. */
static double complex jump_of(const known *k, orbit a, orbit b)
{
    double s[NS] = {0}, out[2];
    const double none[2] = {0.0, 0.0};
    s[0] = creal(a.z + b.z);
    s[1] = creal(a.v + b.v);
    s[2] = cimag(a.z + b.z);
    s[3] = cimag(a.v + b.v);
    known_jump(k, s, none, 0.0, out);
    return out[0] + I * out[1];
}

/* Finds when the step was, and what it turned the pattern by. */
static void review(edge *e, const double *estimate)
{
    const double rest[NS] = {0}, none[2] = {0.0, 0.0}, T = e->period;
    double still[NS * NS], turning[NS * NS], late[2] = {0.0, 0.0};
    known_coordinates(&e->k, estimate + ESTIMATE_KXX, none, 0.0, e->k.p);
    known_rate_by_state(&e->k, rest, none, 0.0, still);
    known_rate_by_state(&e->k, rest, none, 1.0, turning);
    const double coupling = 0.25 * (turning[NS + 3] - still[NS + 3] - turning[3 * NS + 1] + still[3 * NS + 1]);
    if (HAS_DELAY) {
        known_late(&e->k, rest, none, 0.0, late);
    }
    const int64_t span = samples_in(e, SPAN), tried = samples_in(e, LATEST);
    const int64_t last = e->count - span, earliest = e->seen - tried, first = earliest - samples_in(e, MARGIN);
    const double w = sqrt(sample_at(e, first)->omega_squared), delay = smaller(larger(late[0] / T, 0.0), (double)span);
    const double before = mean_rate(e, first - span, first), after = mean_rate(e, last, e->count);
    /* What the controller turns the pattern by goes on through the step. */
    const double own = -(sample_at(e, last)->turned - sample_at(e, first)->turned) / ((double)(last - first) * T);
    const double turn_before = coupling * before + own, turn_after = coupling * after + own;
    const orbit from = mean_orbit(e, first - span, first, first, turn_before, w), to = mean_orbit(e, last, e->count, last, turn_after, w);
    /* Kicks that the Coriolis force on the forced motion gave beyond what the loop cancelled, had the rate been `after` throughout. */
    orbit kicked = {0.0, 0.0};
    for (int64_t k = first; k < last; k++) {
        const double complex forced = 0.5 * (sample_at(e, k)->forced.v + sample_at(e, k + 1)->forced.v);
        const orbit kick = {0.0, -2.0 * I * coupling * T * (after - rate_acting(e, k, delay)) * forced};
        const orbit there = moved(kick, turn_after, w, ((double)(last - k) - 0.5) * T);
        kicked.z += there.z;
        kicked.v += there.v;
    }
    double least = INFINITY, most = 0.0, turned = 0.0;
    for (int64_t k = first; k <= e->seen; k++) {
        const double complex forced = 0.5 * (sample_at(e, k)->forced.v + sample_at(e, k + 1)->forced.v);
        for (int n = 0; n < FINE && k >= earliest; n++) {
            const double part = (double)n / FINE, since = (double)(k - first) + part, left = (double)(last - k) - part;
            orbit o = moved(from, turn_before, w, since * T);
            o.v += (after - before) * jump_of(&e->k, o, sample_at(e, k)->forced);
            o = moved(o, turn_after, w, left * T);
            const orbit kick = {0.0, -2.0 * I * coupling * T * part * (before - after) * forced};
            const orbit there = moved(kick, turn_after, w, (left + 0.5 * part) * T);
            o.z += kicked.z + there.z;
            o.v += kicked.v + there.v;
            const double left_over = deviation_of(to, o, w);
            most = larger(most, left_over);
            if (left_over < least) {
                least = left_over;
                turned = orientation(o, turn_after, w) - orientation(from, turn_before, w) + (since * turn_before + left * turn_after) * T;
            }
        }
        const orbit kick = {0.0, -2.0 * I * coupling * T * (before - after) * forced};
        const orbit there = moved(kick, turn_after, w, ((double)(last - k) - 0.5) * T);
        kicked.z += there.z;
        kicked.v += there.v;
    }
    if (least < EXPLAINED * EXPLAINED * most) {
        e->turned += remainder(turned, PI);
    }
}

void edge_start(edge *e, const double *values, double period)
{
    memset(e, 0, sizeof *e);
    memcpy(e->k.c, values, NC * sizeof *values);
    e->period = period;
    e->seen = -1;
}

void edge_follow(edge *e, const double *estimate, const double in[IN], const double forced[4], double omega_squared, double turned)
{
    edge_sample *now = &e->past[e->count & (EDGE_PAST - 1)];
    now->forced.z = forced[0] + I * forced[2];
    now->forced.v = forced[1] + I * forced[3];
    now->free.z = estimate[0] + I * estimate[2] - now->forced.z;
    now->free.v = estimate[1] + I * estimate[3] - now->forced.v;
    now->rate = estimate[4];
    now->omega_squared = omega_squared;
    now->turned = turned;
    memcpy(e->k.in, in, sizeof e->k.in);
    const int64_t needed = samples_in(e, LATEST + MARGIN + 2.0 * SPAN), wait = samples_in(e, SETTLED + SPAN), sudden = samples_in(e, SUDDEN);
    if (needed + wait >= EDGE_PAST) {
        return;
    }
    if (e->seen < 0 && e->count > needed && fabs(now->rate - sample_at(e, e->count - sudden)->rate) > STEP) {
        e->seen = e->count;
    }
    e->count++;
    if (e->seen >= 0 && e->count == e->seen + wait) {
        review(e, estimate);
        e->seen = -1;
    }
}

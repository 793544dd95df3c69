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
#define JUMPS 2        /* what the velocity may do in a step: what is known of the package; the Euler force of a frame that turns */
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

/* The motion on both sides of a step: rates [rad/s], how fast the pattern turns [rad/s], the pattern at `first` and at `last`. */
typedef struct {
    int64_t first, last;
    double before, after, turn_before, turn_after;
    orbit from, to;
} sides;

static double coupling_of(edge *e, const double *estimate)
{
    const double rest[NS] = {0}, none[2] = {0.0, 0.0};
    double still[NS * NS], turning[NS * NS];
    known_coordinates(&e->k, estimate + ESTIMATE_KXX, none, 0.0, e->k.p);
    known_rate_by_state(&e->k, rest, none, 0.0, still);
    known_rate_by_state(&e->k, rest, none, 1.0, turning);
    return rate_coupling(still, turning, 1.0);
}

/* Samples by which the force is late. */
static double delay_of(const edge *e)
{
    const double rest[NS] = {0}, none[2] = {0.0, 0.0};
    double late[2] = {0.0, 0.0};
    if (HAS_DELAY) {
        known_late(&e->k, rest, none, 0.0, late);
    }
    return smaller(larger(late[0] / e->period, 0.0), (double)samples_in(e, SPAN));
}

static int64_t first_of(const edge *e) { return e->seen - samples_in(e, LATEST) - samples_in(e, MARGIN); }

static sides sides_of(const edge *e, double coupling, double w)
{
    sides s;
    const int64_t span = samples_in(e, SPAN);
    s.last = e->count - span;
    s.first = first_of(e);
    s.before = mean_rate(e, s.first - span, s.first);
    s.after = mean_rate(e, s.last, e->count);
    /* What the controller turns the pattern by goes on through the step. */
    const double own = -(sample_at(e, s.last)->turned - sample_at(e, s.first)->turned) / ((double)(s.last - s.first) * e->period);
    s.turn_before = coupling * s.before + own;
    s.turn_after = coupling * s.after + own;
    s.from = mean_orbit(e, s.first - span, s.first, s.first, s.turn_before, w);
    s.to = mean_orbit(e, s.last, e->count, s.last, s.turn_after, w);
    return s;
}

/* Adds what a push of the velocity has become `duration` later. */
static void push(orbit *o, double complex velocity, double turn, double w, double duration)
{
    const orbit start = {0.0, velocity}, end = moved(start, turn, w, duration);
    o->z += end.z;
    o->v += end.v;
}

/* The Coriolis push, per rad/s that is not cancelled, on the forced motion over the period after sample k. */
static double complex push_of_forced(const edge *e, int64_t k, double coupling)
{
    return -I * coupling * e->period * (sample_at(e, k)->forced.v + sample_at(e, k + 1)->forced.v);
}

/* Finds when the step was, and what it turned the pattern by. */
static void review(edge *e, const double *estimate)
{
    const double T = e->period, coupling = coupling_of(e, estimate), delay = delay_of(e);
    const double w = sqrt(sample_at(e, first_of(e))->omega_squared);
    const sides s = sides_of(e, coupling, w);
    /* What the loop did not cancel, had the rate been `after` throughout; the rest follows as the time that is tried moves on. */
    orbit kicked = {0.0, 0.0};
    for (int64_t k = s.first; k < s.last; k++) {
        const double complex kick = (s.after - rate_acting(e, k, delay)) * push_of_forced(e, k, coupling);
        push(&kicked, kick, s.turn_after, w, ((double)(s.last - k) - 0.5) * T);
    }
    double least[JUMPS] = {INFINITY, INFINITY}, most[JUMPS] = {0.0, 0.0}, turned[JUMPS] = {0.0, 0.0};
    for (int64_t k = s.first; k <= e->seen; k++) {
        const double complex kick = (s.before - s.after) * push_of_forced(e, k, coupling);
        for (int n = 0; n < FINE && k >= e->seen - samples_in(e, LATEST); n++) {
            const double part = (double)n / FINE, since = (double)(k - s.first) + part, left = (double)(s.last - k) - part;
            const orbit there = moved(s.from, s.turn_before, w, since * T), forced = sample_at(e, k)->forced;
            const double complex jump[JUMPS] = {jump_of(&e->k, there, forced), -I * (there.z + forced.z)};
            for (int j = 0; j < JUMPS; j++) {
                orbit o = {there.z, there.v + (s.after - s.before) * jump[j]};
                o = moved(o, s.turn_after, w, left * T);
                o.z += kicked.z;
                o.v += kicked.v;
                push(&o, part * kick, s.turn_after, w, (left + 0.5 * part) * T);
                const double left_over = deviation_of(s.to, o, w);
                most[j] = larger(most[j], left_over);
                if (left_over < least[j]) {
                    least[j] = left_over;
                    turned[j] = orientation(o, s.turn_after, w) - orientation(s.from, s.turn_before, w)
                                + (since * s.turn_before + left * s.turn_after) * T;
                }
            }
        }
        push(&kicked, kick, s.turn_after, w, ((double)(s.last - k) - 0.5) * T);
    }
    const int explained[JUMPS] = {least[0] < EXPLAINED * EXPLAINED * most[0], least[1] < EXPLAINED * EXPLAINED * most[1]};
    if (explained[0] || explained[1]) {
        /* The logarithm: how well a step can be explained depends on what is known by then, so each votes by the ratio. */
        e->unexplained[0] += log(least[0]);
        e->unexplained[1] += log(least[1]);
    }
    const int best = e->unexplained[1] < e->unexplained[0];
    if (explained[best]) {
        e->turned += remainder(turned[best], PI);
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

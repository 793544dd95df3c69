#include "edge.h"

#include "edge_fit.h"
#include "foucault.h"
#include "known_model.h"

#define STEP 1.0       /* change of the rate that is a step [rad/s] */
#define SUDDEN 1e-4    /* within this time [s] */
#define LATEST 6e-4    /* a step lies at most so long before it shows, a small one for longest [s] */
#define MARGIN 3e-4    /* between the motion that is taken as before the step and that [s] */
#define SETTLED 1e-3   /* after which the rate is known again [s] */
#define SPAN 1e-3      /* over which the rate is averaged before and after, and the pattern after [s] */
#define UNEVEN 1e-3    /* change of the electronic turn that spoils a fit [rad/s] */
#define NOISY 4.0      /* after a step the mean rates of half a millisecond differ by 0.03 rad/s of noise, 0.7 of what a step of 10 rad/s may turn by */
#define PULSE 3e-4     /* angle that the rate sweeps beside what it is taken for that is no noise: of the latter are 7e-5, a rate that is open errs by 0.25 rad/s [rad] */
#define SLOPES 3.0      /* standard deviations from which on the slope of the rate after a step is one */
#define LEFT 0.02       /* share of what the tones kick the pattern by (kicked) that a review leaves. It goes with the phase of the tones at the step; on four random
                          devices under `lab`, of kicks of 0.13 deg, 0.003 to 0.005 were left, rms */
#define LOOKED 2e-4    /* of the samples after the step has shown that tell its time [s] */

static int64_t fewer(int64_t a, int64_t b) { return a < b ? a : b; }

static int64_t samples_in(const edge *e, double duration) { return (int64_t)(duration / e->period + 0.5); }

static double mean_rate(const edge *e, int64_t first, int64_t last)
{
    double total = 0.0;
    for (int64_t k = first; k < last; k++) {
        total += sample_at(e, k)->rate;
    }
    return total / (double)(last - first);
}

static double coupling_of(edge *e, const double *estimate)
{
    const double rest[NS] = {0}, none[2] = {0.0, 0.0};
    double still[NS * NS], turning[NS * NS];
    known_coordinates(&e->k, estimate + ESTIMATE_KXX, none, 0.0, e->k.p);
    known_rate_by_state(&e->k, rest, none, 0.0, still);
    known_rate_by_state(&e->k, rest, none, 1.0, turning);
    return rate_coupling(still, turning, 1.0);
}

/* The rate after a step: its mean over the samples from `first` on [rad/s], and its slope where that is one [rad/s2]. */
typedef struct {
    double mean, slope;
    int64_t first;
} later;

static later later_rate(const edge *e, const filter *f)
{
    const int64_t first = e->count - samples_in(e, SPAN);
    const double slope = f->now.z[SLOPE], sigma = sqrt(f->now.P[SLOPE][SLOPE]);
    return (later){mean_rate(e, first, e->count), fabs(slope) > SLOPES * sigma ? slope : 0.0, first};
}

/* The rate at the sample k, of which a fraction counts. */
static double rate_at(const edge *e, const later *l, double k)
{
    return l->mean + l->slope * (k - 0.5 * (double)(l->first + e->count - 1)) * e->period;
}

/* What the pattern turned by beyond its share of the rate where that stepped from `before` [rad/s] at the sample `at`, of which a fraction counts. */
static double turned_in(edge *e, const double *estimate, double at, double before, const later *after)
{
    const int64_t last = after->first, first = e->seen - samples_in(e, LATEST + MARGIN);
    const double coupling = coupling_of(e, estimate), w = sqrt(sample_at(e, first)->omega_squared);
    const double size = hypot(cabs(sample_at(e, first)->free.z), cabs(sample_at(e, first)->free.v) / w);
    /* What the controller turns the pattern by goes on through the step. */
    const double own = -(sample_at(e, last)->turned - sample_at(e, first)->turned) / ((double)(last - first) * e->period);
    const double complex none[TERMS] = {0};
    double complex wrong[TERMS], found[TERMS];
    const turning early = {coupling, own, coupling * before + own}, late = {coupling, own, coupling * rate_at(e, after, (double)last) + own};
    edge_fit(e, TERMS, first - fewer(samples_in(e, FITTED), first - e->reviewed), first, first, &early, w, size, none, wrong);
    const double from = pattern_orientation(pattern_of(wrong[0], wrong[1], early.turn, w), early.turn, w);
    /* The pattern has turned by other than the rate says where that has an error. */
    const double more = -0.5 * cimag(wrong[2] / wrong[0] + wrong[3] / wrong[1]) / FITTED;
    edge_fit(e, PATTERN_TERMS, last, e->count, last, &late, w, size, wrong, found);
    const double to = pattern_orientation(pattern_of(found[0], found[1], late.turn, w), late.turn, w);
    const int64_t whole = (int64_t)at;
    const double until = edge_course(e, &early, first, whole) + early.turn * (at - (double)whole) * e->period;
    const double since = (coupling * rate_at(e, after, 0.5 * (at + (double)last)) + own) * ((double)last - at) * e->period;
    return remainder(to - from + until + since + more * (at - (double)first) * e->period, PI);
}

/* Whether the controller turns the pattern evenly, or not at all, over the samples that a review looks at. */
static int turns_evenly(const edge *e, int64_t begin)
{
    const int64_t middle = (begin + e->count) / 2;
    const double before = sample_at(e, middle)->turned - sample_at(e, begin)->turned;
    const double after = sample_at(e, e->count - 1)->turned - sample_at(e, middle)->turned;
    return fabs(before / (double)(middle - begin) - after / (double)(e->count - 1 - middle)) < UNEVEN * e->period;
}

/* What a step of the rate by `change` [rad/s] turns the pattern by at most, without an Euler force [rad]. */
static double largest_turn(const edge *e, double change)
{
    return 0.5 * fabs(change) / sqrt(sample_at(e, e->seen)->omega_squared);
}

/* What the tones have turned the pattern by until the step showed, SUDDEN at most: the Coriolis force on the motion that they force, 2 m ΔΩ v, was not
   cancelled [rad]. */
static double kicked(const edge *e, double change)
{
    const int64_t count = samples_in(e, SPAN);
    double forced = 0.0, free = 0.0;
    for (int64_t k = e->seen - count; k < e->seen; k++) {
        const double v = cabs(sample_at(e, k)->forced.v), u = cabs(sample_at(e, k)->free.v);
        forced += v * v;
        free += u * u;
    }
    return free > 0.0 ? 2.0 * fabs(change) * SUDDEN * sqrt(forced / free) : 0.0;
}

static double left_by(const edge *e, double change) { return hypot(largest_turn(e, change), kicked(e, change)); }

/* What is left uncertain of the pattern where what the rate did from `before` on can't be reviewed [rad]: as of one step, or of two, of which the
   second takes a part of the first back. */
static double left_open(const edge *e, double before, const later *after)
{
    const int64_t count = samples_in(e, MARGIN);
    double left = left_by(e, after->mean - before);
    for (int64_t k = e->seen + count; k + count <= after->first; k += count) {
        const double rate = mean_rate(e, k, k + count);
        if ((rate - before) * (after->mean - rate) < 0.0) {
            left = larger(left, hypot(left_by(e, rate - before), left_by(e, after->mean - rate)));
        }
    }
    return left;
}

/* Whether the rate after a step from `before` is what it is taken for. Until it has settled that is how it went on. Where it changes by d more from
   one half of a time T to the other and did so from the step, the orientation errs by d T (1 + SETTLED/T)^2: this must be less than what a step
   without an Euler force can turn it by, times NOISY, or than noise makes of it. A slope that begins or ends is no step at all. Nor is a pulse, with
   a second step before the rate has settled: what the rate swept meanwhile tells it. */
static int is_even(const edge *e, double before, const later *after)
{
    const int64_t middle = (after->first + e->count) / 2;
    const double turned = largest_turn(e, after->mean - before), beyond = 1.0 + SETTLED / SPAN;
    const double change = mean_rate(e, middle, e->count) - mean_rate(e, after->first, middle) - 0.5 * SPAN * after->slope;
    const int64_t from = e->seen + samples_in(e, LOOKED);
    const double taken = rate_at(e, after, 0.5 * (double)(from + after->first)) * (double)(after->first - from) * e->period;
    const double beside = sample_at(e, after->first)->swept - sample_at(e, from)->swept - taken;
    const double limit = larger(NOISY * turned, PULSE);
    return fabs(change) * SPAN * beyond * beyond < limit && fabs(beside) < limit;
}

/* Samples that must have gone by since the last step. */
static int64_t needed(const edge *e) { return samples_in(e, LATEST + MARGIN + 2.0 * SPAN); }

/* Finds when the step was, and takes out what it turned the pattern by; where it can't, that is left uncertain. */
static void review(edge *e, const double *estimate, filter *f)
{
    const int64_t first = e->seen - samples_in(e, LATEST + MARGIN);
    const int64_t begin = first - fewer(samples_in(e, FITTED), first - e->reviewed);
    const double before = mean_rate(e, first - samples_in(e, SPAN), first);
    const later after = later_rate(e, f);
    step_found found = {-1.0, 0.0};
    if (e->seen > e->reviewed + needed(e) && turns_evenly(e, begin) && is_even(e, before, &after)) {
        const double rate = rate_at(e, &after, (double)e->seen);
        found = step_time(f, e->seen - samples_in(e, LATEST), e->seen, e->seen + samples_in(e, LOOKED), rate, e->unlikely);
    }
    double left = left_open(e, before, &after);
    if (found.at >= 0.0) {
        e->turned += turned_in(e, estimate, found.at, before, &after);
        left = hypot(coupling_of(e, estimate) * (after.mean - before) * e->period * sqrt(found.variance), LEFT * kicked(e, after.mean - before));
    }
    f->strayed += left * left;
}

void edge_start(edge *e, const double *values, double period)
{
    memset(e, 0, sizeof *e);
    memcpy(e->k.c, values, NC * sizeof *values);
    e->period = period;
    e->seen = -1;
}

void edge_follow(edge *e, const double *estimate, const double in[IN], const double forced[4], const double near[4],
                 double omega_squared, double turned, filter *f)
{
    edge_sample *now = &e->past[e->count & (EDGE_PAST - 1)];
    now->forced.z = forced[0] + I * forced[2];
    now->forced.v = forced[1] + I * forced[3];
    now->near.z = near[0] + I * near[2];
    now->near.v = near[1] + I * near[3];
    now->free.z = estimate[0] + I * estimate[2] - now->forced.z;
    now->free.v = estimate[1] + I * estimate[3] - now->forced.v;
    now->rate = estimate[4];
    now->swept = e->count > 0 ? sample_at(e, e->count - 1)->swept + e->period * sample_at(e, e->count - 1)->rate : 0.0;
    now->omega_squared = omega_squared;
    now->turned = turned;
    memcpy(e->k.in, in, sizeof e->k.in);
    const int64_t wait = samples_in(e, SETTLED + SPAN), sudden = samples_in(e, SUDDEN);
    if (samples_in(e, FITTED) + needed(e) + wait >= EDGE_PAST) {
        return;
    }
    if (f != NULL && e->seen < 0 && e->count > needed(e) &&
        (f->jumped_at == f->sample || fabs(now->rate - sample_at(e, e->count - sudden)->rate) > STEP)) {
        e->seen = e->count;
    }
    e->count++;
    if (e->seen >= 0 && e->count == e->seen + wait) {
        review(e, estimate, f);
        e->seen = -1;
        e->reviewed = e->count;
    }
}

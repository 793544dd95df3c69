#include "edge.h"

#include "edge_fit.h"
#include "foucault.h"
#include "known_model.h"

#define STEP 1.0       /* change of the rate that is a step [rad/s] */
#define SUDDEN 1e-4    /* within this time [s] */
#define LATEST 4e-4    /* a step lies at most so long before it shows [s] */
#define MARGIN 3e-4    /* between the motion that is taken as before the step and that [s] */
#define SETTLED 1e-3   /* after which the rate is known again [s] */
#define SPAN 1e-3      /* over which the rate is averaged before and after, and the pattern after [s] */
#define LOOKED 2e-4    /* over which the pattern is compared once the step has shown [s] */
#define LOOKED_MOST 512 /* samples of that at most */
#define ORBIT 1e-4     /* error of the orbit over its size: of the rates over the time between before and after, of constants that have just been found */
#define ACROSS 2e-5    /* error of a position across the pattern over its size, common to those that are compared */
#define EXPLAINED 0.3  /* share of the deviation that the best time may leave unexplained */
#define JUMPS 2        /* as known, or with the Euler force of a frame that turns */

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

/* The rate that the force which acts from sample k on was computed with; the force is `delay` samples late. */
static double rate_acting(const edge *e, int64_t k, double delay)
{
    const int64_t whole = (int64_t)delay;
    const double part = delay - (double)whole;
    return (1.0 - part) * sample_at(e, k - whole)->rate + part * sample_at(e, k - whole - 1)->rate;
}

/* Jump of the velocity in a step of the rate, per rad/s: as the package is known, or the Euler force of a frame that turns on all of the motion. */
static double complex jump_of(const known *k, int euler, orbit a, orbit b)
{
    double s[NS] = {0}, out[2];
    const double none[2] = {0.0, 0.0};
    if (euler) {
        return -I * (a.z + b.z);
    }
    s[0] = creal(a.z + b.z);
    s[1] = creal(a.v + b.v);
    s[2] = cimag(a.z + b.z);
    s[3] = cimag(a.v + b.v);
    known_jump(k, s, none, 0.0, out);
    return out[0] + I * out[1];
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

/* A step and what is known around it: the pattern `from` at sample `first` and `to` at sample `last`, from which on the rate is known again; samples
   that are compared besides, `seen` to `looked`; what the forces after `looked` that were not cancelled do to the pattern, `rest`; rates [rad/s] and
   how fast the pattern turns [rad/s] before and after; how long a force is late [samples]; the pattern's angular frequency [rad/s] and size [m]; what is
   wrong of the response to the tones, and the positions from `seen` on without it [m]. */
typedef struct {
    int64_t first, looked, last;
    orbit from, to, rest;
    double before, after, turn_before, turn_after, coupling, delay, w, size;
    double complex wrong[TERMS], clean[LOOKED_MOST];
} step;

/* Velocity that the Coriolis force on the forced motion gives over the period after sample k where the rate is `rate`, as far as the loop does not
   cancel it. */
static double complex kick_at(const edge *e, const step *s, int64_t k, double rate)
{
    const double left = rate - rate_acting(e, k, s->delay);
    return -I * s->coupling * left * e->period * (sample_at(e, k)->forced.v + sample_at(e, k + 1)->forced.v);
}

/* With a push of the velocity over the last period. */
static orbit kicked(orbit o, double complex push, double period)
{
    o.z += 0.5 * period * push;
    o.v += push;
    return o;
}

/* The pattern on both sides of the step. */
static void fit_sides(const edge *e, step *s, int64_t begin)
{
    const double complex none[TERMS] = {0};
    double complex found[TERMS];
    edge_fit(e, TERMS, begin, s->first, s->first, s->turn_before, s->w, s->size, none, s->wrong);
    s->from = pattern_of(s->wrong[0], s->wrong[1], s->turn_before, s->w);
    /* The pattern has turned by other than the mean of the rate says where that has an error. */
    s->turn_before -= 0.5 * cimag(s->wrong[2] / s->wrong[0] + s->wrong[3] / s->wrong[1]) / FITTED;
    edge_fit(e, PATTERN_TERMS, s->last, e->count, s->last, s->turn_after, s->w, s->size, s->wrong, found);
    s->to = pattern_of(found[0], found[1], s->turn_after, s->w);
    for (int64_t k = e->seen; k < s->looked; k++) {
        s->clean[k - e->seen] = edge_clean(e, s->wrong, k, s->w, s->size);
    }
}

static step step_of(edge *e, const double *estimate)
{
    step s;
    const int64_t span = samples_in(e, SPAN);
    s.first = e->seen - samples_in(e, LATEST) - samples_in(e, MARGIN);
    s.looked = e->seen + fewer(samples_in(e, LOOKED), LOOKED_MOST);
    s.last = e->count - span;
    s.coupling = coupling_of(e, estimate);
    s.delay = delay_of(e);
    const edge_sample *begun = sample_at(e, s.first);
    s.w = sqrt(begun->omega_squared);
    s.size = hypot(cabs(begun->free.z), cabs(begun->free.v) / s.w);
    s.before = mean_rate(e, s.first - span, s.first);
    s.after = mean_rate(e, s.last, e->count);
    /* What the controller turns the pattern by goes on through the step. */
    const double own = -(sample_at(e, s.last)->turned - sample_at(e, s.first)->turned) / ((double)(s.last - s.first) * e->period);
    s.turn_before = s.coupling * s.before + own;
    s.turn_after = s.coupling * s.after + own;
    fit_sides(e, &s, s.first - fewer(samples_in(e, FITTED), s.first - e->reviewed));
    s.rest.z = s.rest.v = 0.0;
    const advance after = pattern_advance(s.turn_after, s.w, e->period);
    for (int64_t k = s.looked; k < s.last; k++) {
        s.rest = kicked(pattern_moved(s.rest, &after), kick_at(e, &s, k, s.after), e->period);
    }
    return s;
}

/* Follows the pattern through a step at the sample `at`, of which a fraction counts. Returns how badly that explains what was seen, in variances;
   `turned` is what the pattern turned by beyond its share of the rate. */
static double follow(const edge *e, const step *s, double at, int euler, double *turned)
{
    const double T = e->period, part = at - floor(at);
    const advance before = pattern_advance(s->turn_before, s->w, T), after = pattern_advance(s->turn_after, s->w, T);
    const advance to_step = pattern_advance(s->turn_before, s->w, part * T), from_step = pattern_advance(s->turn_after, s->w, (1.0 - part) * T);
    const int64_t stepped = (int64_t)floor(at);
    orbit o = s->from;
    double total = 0.0, angle = pattern_orientation(o, s->turn_before, s->w);
    for (int64_t k = s->first; k < s->looked; k++) {
        const double old = k < stepped ? 1.0 : k > stepped ? 0.0 : part;
        if (k == stepped) {
            o = pattern_moved(o, &to_step);
            o.v += (s->after - s->before) * jump_of(&e->k, euler, o, sample_at(e, k)->forced);
            o = pattern_moved(o, &from_step);
        } else {
            o = pattern_moved(o, k < stepped ? &before : &after);
        }
        o = kicked(o, kick_at(e, s, k, old * s->before + (1.0 - old) * s->after), T);
        angle -= (old * s->turn_before + (1.0 - old) * s->turn_after) * T;
        if (k + 1 >= e->seen && k + 1 < s->looked) {
            const double across = cimag((cos(angle) - I * sin(angle)) * (s->clean[k + 1 - e->seen] - o.z));
            total += across * across;
        }
    }
    const advance remaining = pattern_advance(s->turn_after, s->w, (double)(s->last - s->looked) * T);
    o = pattern_moved(o, &remaining);
    o.z += s->rest.z;
    o.v += s->rest.v;
    angle -= s->turn_after * (double)(s->last - s->looked) * T;
    *turned = remainder(pattern_orientation(o, s->turn_after, s->w) - angle, PI);
    return total / (ACROSS * ACROSS * s->size * s->size * (double)(s->looked - e->seen)) + pattern_deviation(s->to, o, s->w) / (ORBIT * ORBIT);
}

/* The time at which a step explains best what was seen [samples], by a parabola through the least and its neighbours, or below zero where there is
   none; how badly the best and the worst time explain it. */
static double find_step(const edge *e, const step *s, int euler, double *least, double *worst)
{
    const int64_t earliest = e->seen - samples_in(e, LATEST);
    double middle = 0.0, old = 0.0, turned, best = -1.0;
    *worst = 0.0;
    *least = INFINITY;
    for (int64_t k = earliest; k <= e->seen; k++) {
        const double found = follow(e, s, (double)k, euler, &turned);
        *worst = larger(*worst, found);
        if (k >= earliest + 2 && middle <= old && middle <= found && middle < *least) {
            const double bend = old - 2.0 * middle + found;
            *least = middle;
            best = (double)(k - 1) + (bend > 0.0 ? 0.5 * (old - found) / bend : 0.0);
        }
        old = middle;
        middle = found;
    }
    return best;
}

/* Finds when the step was, and takes out what it turned the pattern by. */
static void review(edge *e, const double *estimate)
{
    const step s = step_of(e, estimate);
    double at[JUMPS], turned;
    int explained[JUMPS];
    for (int j = 0; j < JUMPS; j++) {
        double least, worst;
        at[j] = find_step(e, &s, j, &least, &worst);
        explained[j] = least < EXPLAINED * EXPLAINED * worst;
        /* The logarithm: how well a step can be explained depends on what is known by then, so each votes by the ratio. */
        e->unexplained[j] += log(smaller(least, worst));
    }
    const int best = e->unexplained[1] < e->unexplained[0];
    if (explained[best]) {
        (void)follow(e, &s, at[best], best, &turned);
        e->turned += turned;
    }
}

void edge_start(edge *e, const double *values, double period)
{
    memset(e, 0, sizeof *e);
    memcpy(e->k.c, values, NC * sizeof *values);
    e->period = period;
    e->seen = -1;
}

void edge_follow(edge *e, const double *estimate, const double in[IN], const double forced[4], const double near[4],
                 double omega_squared, double turned)
{
    edge_sample *now = &e->past[e->count & (EDGE_PAST - 1)];
    now->forced.z = forced[0] + I * forced[2];
    now->forced.v = forced[1] + I * forced[3];
    now->near.z = near[0] + I * near[2];
    now->near.v = near[1] + I * near[3];
    now->free.z = estimate[0] + I * estimate[2] - now->forced.z;
    now->free.v = estimate[1] + I * estimate[3] - now->forced.v;
    now->rate = estimate[4];
    now->omega_squared = omega_squared;
    now->turned = turned;
    memcpy(e->k.in, in, sizeof e->k.in);
    const int64_t needed = samples_in(e, LATEST + MARGIN + 2.0 * SPAN), wait = samples_in(e, SETTLED + SPAN), sudden = samples_in(e, SUDDEN);
    if (samples_in(e, FITTED) + needed + wait >= EDGE_PAST) {
        return;
    }
    if (e->seen < 0 && e->count > e->reviewed + needed && fabs(now->rate - sample_at(e, e->count - sudden)->rate) > STEP) {
        e->seen = e->count;
    }
    e->count++;
    if (e->seen >= 0 && e->count == e->seen + wait) {
        review(e, estimate);
        e->seen = -1;
        e->reviewed = e->count;
    }
}

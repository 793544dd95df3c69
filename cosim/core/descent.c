#include "descent.h"

#include "block.h"
#include "carried.h"
#include "correction.h"
#include "late.h"
#include "prediction.h"
#include "rate.h"
#include "straight.h"
#include "take_up.h"
#include "unseen.h"

#define ROUNDS 8     /* filterings of a block at most */
#define MOVED 0.3    /* change of p in its new standard deviations, all together, that is worth another one */
#define WORTH 0.1      /* fall of the sum of squares that is worth another one */
#define AHEAD 4        /* whole steps more that may bring what the first one has not */
#define SHORTEST 0.003 /* part of a step that is worth a filtering */
#define EARLY 0.25     /* part of a start that tells which of several lags, or of couplings, it is: a filtering of all takes four times as long */
#define TELLING 64     /* samples from which a fit beside whole periods, or that leaves more than noise, is looked for elsewhere */
#define ASTRAY 5.0     /* deviations from what noise makes by which its sum of squares is then more */
#define AGAIN 3        /* times that a look goes on where it has not come to rest */
#define FAR_OFF 2.0    /* mean squared innovation up to which that is worth it */
#define SEES 256       /* samples that tell what voltages see at some frequencies: fewer tell the motion alone, in which that is no straight way */

/* Filters the block again from its beginning at the constants as they are now; returns the sum of squared innovations. */
static double filter_again(filter *f)
{
    const int64_t last = f->sample;
    double total = 0.0;
    f->effort -= (double)f->in_block;
    f->now = f->begun;
    for (int i = 0; i < NZ; i++) {
        for (int q = 0; q < NP; q++) {
            f->now.z[i] += f->begun.Y[i][q] * (f->k.p[q] - f->p_begun[q]);
        }
    }
    f->rows = 0;
    f->sample = f->block_begun;
    filter_enter(f, f->in[0]);
    filter_form(f);
    for (int64_t k = f->block_begun; k <= last; k++) {
        const int64_t place = k - f->block_begun;
        f->sample = k;
        filter_enter(f, f->in[place]);
        if (k > f->origin) {
            filter_predict(f);
            filter_correct(f, f->v[place]);
        } else {
            filter_take_up(f, f->v[place]);
        }
        if (f->opened[place]) {
            rate_drop_recent(f);
            rate_open(f);
        }
    }
    for (int64_t r = 0; r < f->rows; r++) {
        total += f->r[r] * f->r[r];
    }
    memset(f->now.sum, 0, sizeof f->now.sum);
    memset(f->now.sum_variance, 0, sizeof f->now.sum_variance);
    return total;
}

/* The information of a start; what a whole one does not see is found first, and left out. */
static double inform(filter *f, int whole, double L[NP][NP], double b[NP])
{
    f->unseen_count = f->hidden = 0;
    double trace = block_information(f, L, b);
    if (whole) {
        /* Moved along what it does not see, the block would not be consistent with what its motion was filtered at. */
        unseen_find(f, L);
        trace = f->unseen_count > 0 ? block_information(f, L, b) : trace;
    }
    return trace;
}

double descent_step(const filter *f, double L[NP][NP], const double b[NP], double step[NP])
{
    double pull[NP], half[NP], end[NP];
    for (int i = 0; i < NP; i++) {
        pull[i] = b[i] - f->eta[i];
    }
    block_solve(L, pull, step, half);
    unseen_leave_out(f, step);
    for (int i = 0; i < NP; i++) {
        end[i] = f->eta[i] + step[i];
    }
    block_keep_in_bounds(f, L, end);
    for (int i = 0; i < NP; i++) {
        step[i] = end[i] - f->eta[i];
    }
    return block_distance(L, end, f->eta);
}

/* f->eta becomes `from` and a `way` from there, straight in what the voltages see; the start is filtered there. Returns the sum of squares. */
static double go_along(filter *f, const double from[NP], const double way[NP])
{
    double change[NP];
    for (int i = 0; i < NP; i++) {
        f->eta[i] = from[i] + way[i];
    }
    if (f->in_block >= SEES) {
        straight_step(f, from, way, f->eta);
    }
    block_set_constants(f, f->eta, change);
    return block_squared(f->eta) + filter_again(f);
}

/* Goes on by whole steps from where one has led, the sum of squares there being `cost`, until that is below `limit` or they climb on: along a curved
   valley the first one climbs its side, and the next come down to its bottom, while shortened ones creep. Returns the sum. */
static double go_on(filter *f, double cost, double limit, double reserve)
{
    const double first = cost;
    double L[NP][NP], b[NP], from[NP], way[NP];
    for (int more = 0; more < AHEAD && cost <= first && !(cost < limit) && f->effort > reserve; more++) {
        (void)block_information(f, L, b);
        (void)descent_step(f, L, b, way);
        memcpy(from, f->eta, sizeof from);
        cost = go_along(f, from, way);
    }
    return cost;
}

/* Moves f->eta by `step` and, where it `goes_on`, some more, or by a part of it, or not at all: to where the sum of squares is below `limit`. Leaves
   the start filtered there and returns the sum. */
static double descend(filter *f, const double step[NP], double limit, double reserve, int goes_on)
{
    double from[NP];
    memcpy(from, f->eta, sizeof from);
    for (double part = 1.0;; part *= 0.3) {
        double way[NP];
        /* The last way left is none. */
        part = part > SHORTEST && f->effort > reserve ? part : 0.0;
        for (int i = 0; i < NP; i++) {
            way[i] = part * step[i];
        }
        double next = go_along(f, from, way);
        if (goes_on && part == 1.0) {
            next = go_on(f, next, limit, reserve);
        }
        if (part <= 0.0 || next < limit) {
            return next;
        }
    }
}

/* Gauss-Newton on |eta|^2 + |r(eta)|^2 from f->eta, where that is `cost`, filtering a start again up to ROUNDS times, p = p_begun + W eta. Leaves the
   start filtered where it ends and the Cholesky factor of its Hessian in L. */
static descent come_down(filter *f, int whole, double L[NP][NP], double cost)
{
    const double reserve = whole ? 0.0 : FOR_WHOLE * f->settings.start;
    double b[NP], step[NP];
    descent d = {.cost = cost};
    for (int round = 0, ends = 0, stuck = 0;; round++) {
        d.trace = inform(f, whole, L, b);
        d.off = descent_step(f, L, b, step);
        /* What no sample seemed to show may have come to light in the last step. */
        if (stuck || (ends && (!whole || d.off < OFF)) || round > ROUNDS) {
            return d;
        }
        ends = d.off < MOVED || f->effort <= reserve;
        /* What is found before the start is complete need not be best, and may have to climb to become better. */
        const double next = descend(f, step, whole ? d.cost + WORTH : 1.001 * d.cost + 1.0, reserve, whole && d.off > OFF);
        stuck = whole && d.cost - next < WORTH && !ends;
        d.cost = next;
    }
}

/* Goes to eta and filters the start again; returns its sum. */
static double go_to(filter *f, const double eta[NP])
{
    double change[NP];
    memcpy(f->eta, eta, sizeof f->eta);
    block_set_constants(f, f->eta, change);
    return block_squared(f->eta) + filter_again(f);
}

/* Looks for a better fit where `step` leads from that which has been found, d; leaves the start at the better one. */
static descent look_there(filter *f, int whole, double L[NP][NP], descent d, const double step[NP])
{
    double found[NP], lowest[NP], other[NP], b[NP];
    memcpy(found, f->eta, sizeof found);
    memcpy(lowest, f->lowest, sizeof lowest);
    known target = f->k;
    for (int i = 0; i < NP; i++) {
        other[i] = found[i] + step[i];
    }
    for (int i = 0; i < NP; i++) {
        target.p[i] = block_constant_at(f, other, i);
    }
    /* Straight in what the voltages see is not straight in the delay, which must not slip to the other side of whole periods; and where that has led
       above them by itself, the fit stays above. */
    late_keep_side(f, &target);
    straight_step(f, found, step, other);
    const double cost = go_to(f, other);
    late_keep_side(f, &f->k);
    descent there = come_down(f, whole, L, cost);
    for (int more = 0; more < AGAIN && there.off > OFF && there.cost > d.cost - WORTH && there.cost < FAR_OFF * (double)f->rows; more++) {
        there = come_down(f, whole, L, there.cost);
    }
    if (there.cost < d.cost - WORTH) {
        /* From below it may have come up. */
        late_keep_side(f, &f->k);
        return there;
    }
    memcpy(f->lowest, lowest, sizeof lowest);
    d.cost = go_to(f, found);
    d.trace = inform(f, whole, L, b);
    return d;
}

/* Looks for a better fit at each of `count` other places: `place` gives the change of eta to one that is worth it. */
static descent look_elsewhere(filter *f, int whole, double L[NP][NP], descent d, int (*place)(const filter *, int, double[NP]), int count)
{
    double step[NP];
    for (int which = 0; which < count; which++) {
        if (place(f, which, step)) {
            d = look_there(f, whole, L, d, step);
        }
    }
    return d;
}

/* Beside whole periods of delay: goes on from where the fit has come to rest, which may be at their kink, on this side of it, and looks on the other. */
static descent look_on_both_sides(filter *f, int whole, double L[NP][NP], descent d)
{
    double step[NP];
    if (!late_other_side(f, step)) {
        return d;
    }
    late_keep_side(f, &f->k);
    d = come_down(f, whole, L, d.cost);
    return late_other_side(f, step) ? look_there(f, whole, L, d, step) : d;
}

/* Whether this is the first fit that has an early part of the start; blocks double. */
static int is_early(const filter *f)
{
    const double early = EARLY * f->settings.start, samples = (double)f->in_block;
    return samples >= early && samples < 2.0 * early;
}

descent descent_find(filter *f, double L[NP][NP])
{
    const int whole = f->in_block >= (int64_t)f->settings.start;
    double cost = block_squared(f->eta);
    if (whole) {
        /* As later rounds are: with the walk of the rate as it is by now. */
        (void)filter_again(f);
    }
    for (int64_t r = 0; r < f->rows; r++) {
        cost += f->r[r] * f->r[r];
    }
    descent d = come_down(f, whole, L, cost);
    const int astray = !whole && f->in_block >= TELLING && d.cost > (double)f->rows + ASTRAY * sqrt(2.0 * (double)f->rows);
    const int early = is_early(f);
    if (astray || early) {
        d = look_elsewhere(f, whole, L, d, late_other_lag, LATE_LAGS);
    }
    if (whole || f->in_block >= TELLING) {
        d = look_on_both_sides(f, whole, L, d);
    }
    if (whole || astray || early) {
        d = look_elsewhere(f, whole, L, d, late_whole_periods, LATE_WHOLES);
    }
    if (early) {
        d = look_elsewhere(f, whole, L, d, carried_other, CARRIED_SIZES);
    }
    return d;
}

#include "fit.h"

#include "block.h"
#include "correction.h"
#include "known_model.h"
#include "late.h"
#include "prediction.h"
#include "rate.h"
#include "restart.h"
#include "straight.h"
#include "take_up.h"
#include "unseen.h"

#define ROUNDS 8     /* filterings of a block at most */
#define MOVED 0.3    /* change of p in its new standard deviations, all together, that is worth another one */
#define WORTH 0.1      /* fall of the sum of squares that is worth another one */
#define AHEAD 4        /* whole steps more that may bring what the first one has not */
#define SHORTEST 0.003 /* part of a step that is worth a filtering */
#define FOR_WHOLE 10.0 /* filterings of a whole start that are saved up for it */
#define FORGET_SHARE 0.05 /* of a block in the running mean that forgetting follows */
#define FORGET_SIGMAS 5.0 /* standard deviations at which it counts as moving */
#define FORGET_MIN 0.1 /* where forgetting begins [1/s] */
#define FORGOTTEN 1e-3 /* below which forgetting is none [1/s] */
#define LEARNED 1e-9   /* share of what is known of a constant that a block must add to say whether it moves */
#define LOST 1e4     /* mean squared innovation of a whole start that has found nothing */
#define TRIES 3        /* further starts at most where one ends beside its fit, and so claims what it does not know */
#define ANOTHER 2.0    /* mean squared innovation of a start that may have found another device */
#define UNFIT 1.035    /* mean squared innovation that a device as the design means it does not leave: 32768 numbers leave 1 by 0.008 */
#define OFF 1.0       /* deviations beside its fit from which a start has not found it */
#define FASTEST 1e4  /* rate that is no device's [rad/s]: far from the device it explains more than constants do */
#define FARTHEST 10.0 /* standard deviations of the design that an effect may be away from it */
#define SETTLING 256   /* samples at the beginning of a start that tell a long one nothing where voltages lag: the motion is as unknown there as the
                          design leaves it, and the product of its error and one of the lag, which slopes leave out, would pass for knowledge */
#define LONG 4096      /* samples of a long one */
#define SEES 256       /* samples that tell what voltages see at some frequencies: fewer tell the motion alone, in which that is no straight way */
#define WATCHED 0.005 /* over which innovations are averaged [s] */
#define FIRST 4      /* samples of the first block at its first fit: of some tenths of a period what moves is nearly linear in the stiffness */
#define FEWEST 16    /* samples of another block */

/* Where the next block ends. One that grows doubles, from FIRST samples on; another is a sixteenth of what went before. */
static void plan_block(filter *f)
{
    const double age = (double)(f->sample + 1 - f->since);
    if (f->growing) {
        f->length = f->in_block > 0 ? 2 * f->in_block : FIRST;
    } else {
        f->length = (int64_t)smaller(larger(floor(age / 16.0), FEWEST), smaller(f->settings.block, BLOCK_MAX));
    }
}

void fit_begin(filter *f)
{
    f->in_block = 0;
    f->block_begun = f->sample + 1;
    f->begun = f->now;
    memcpy(f->p_begun, f->k.p, sizeof f->p_begun);
    memset(f->eta, 0, sizeof f->eta);
    unseen_scale(f);
    plan_block(f);
}

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
        f->rows = HAS_LAG && place == SETTLING && f->in_block >= LONG ? 0 : f->rows;
    }
    for (int64_t r = 0; r < f->rows; r++) {
        total += f->r[r] * f->r[r];
    }
    memset(f->now.sum, 0, sizeof f->now.sum);
    memset(f->now.sum_variance, 0, sizeof f->now.sum_variance);
    return total;
}

/* Innovations of the block that say something: those at the end of the converter are zero. */
static double told(const filter *f)
{
    int64_t count = 0;
    for (int64_t r = 0; r < f->rows; r++) {
        count += f->r[r] != 0.0;
    }
    return (double)count;
}

/* Follows how large and how white the innovations are. Those of a start that has just been filtered at its own fit are taken as they are; others also
   carry what was not known of the constants beforehand. */
static void watch(filter *f)
{
    const double count = told(f);
    if (count == 0.0) {
        return;
    }
    const double pace = f->growing ? 1.0 : smaller(1.0, (double)f->in_block * f->m.period / WATCHED);
    const double expected = f->growing ? 1.0 : 1.0 + f->share;
    const double none[2] = {0.0, 0.0};
    double total = 0.0, product[2] = {0.0, 0.0}, pink[4];
    for (int64_t r = 0; r < f->rows; r++) {
        total += f->r[r] * f->r[r];
        product[r & 1] += f->r[r] * f->last_r[r & 1];
        f->last_r[r & 1] = f->r[r];
    }
    known_pink(&f->k, f->now.z, none, 0.0, pink);
    const double lacking = 0.5 * (pink[0] * f->inverse[0] + pink[2] * f->inverse[1]);
    f->chi2 += pace * (total / (count * expected) + lacking - f->chi2);
    for (int a = 0; a < 2; a++) {
        const double neighbours = product[a] / (0.5 * count * expected);
        f->pink[a] = pink[2 * a + 1] * f->inverse[a];
        f->white[a] += pace * (neighbours - f->pink[a] - f->white[a]);
    }
}

/* What a fit has left, its sum of squares being `cost`, and what its constants explain. */
static void note_fit(filter *f, double cost, double trace)
{
    const double count = told(f);
    f->fit = count > 0.0 ? cost / count : 1.0;
    f->share = count > 0.0 ? trace / count : f->share;
    watch(f);
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

/* The step from f->eta that the block and what was known before it make most likely, L being the factor of its Hessian: within the bounds. Returns
   how many deviations long it is. */
static double find_step(const filter *f, double L[NP][NP], const double b[NP], double step[NP])
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
        (void)find_step(f, L, b, way);
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
   start filtered where it ends, the sum there in `cost` and the Cholesky factor of its Hessian in L. Returns how many deviations away its slopes say
   that the most likely constants are. */
static double come_down(filter *f, int whole, double L[NP][NP], double *cost, double *trace)
{
    const double reserve = whole ? 0.0 : FOR_WHOLE * f->settings.start;
    double b[NP], step[NP], moved;
    *trace = inform(f, whole, L, b);
    for (int round = 0, ends = 0, stuck = 0;; round++) {
        moved = find_step(f, L, b, step);
        /* What no sample seemed to show may have come to light in the last step. */
        if (stuck || (ends && (!whole || moved < OFF)) || round > ROUNDS) {
            break;
        }
        ends = moved < MOVED || f->effort <= reserve;
        /* What is found before the start is complete need not be best, and may have to climb to become better. */
        const double next = descend(f, step, whole ? *cost + WORTH : 1.001 * *cost + 1.0, reserve, whole && moved > OFF);
        stuck = whole && *cost - next < WORTH && !ends;
        *cost = next;
        *trace = inform(f, whole, L, b);
    }
    return moved;
}

/* Goes to eta and filters the start again; returns its sum. */
static double go_to(filter *f, const double eta[NP])
{
    double change[NP];
    memcpy(f->eta, eta, sizeof f->eta);
    block_set_constants(f, f->eta, change);
    return block_squared(f->eta) + filter_again(f);
}

/* Finds the constants that a start and what was known before it make most likely. A whole one that ends with a delay beside whole periods
   is looked for on their other side, too. */
static double find_start(filter *f, double L[NP][NP])
{
    const int whole = f->in_block >= (int64_t)f->settings.start;
    double cost = block_squared(f->eta), trace, step[NP];
    if (whole) {
        /* As later rounds are: with the walk of the rate as it is by now. */
        (void)filter_again(f);
    }
    for (int64_t r = 0; r < f->rows; r++) {
        cost += f->r[r] * f->r[r];
    }
    double moved = come_down(f, whole, L, &cost, &trace);
    if (whole && late_other_side(f, step)) {
        double found[NP], other[NP], b[NP];
        memcpy(found, f->eta, sizeof found);
        straight_step(f, found, step, other);
        double there = go_to(f, other);
        const double off = come_down(f, whole, L, &there, &trace);
        if (there < cost - WORTH) {
            cost = there;
            moved = off;
        } else {
            cost = go_to(f, found);
            trace = inform(f, whole, L, b);
        }
    }
    note_fit(f, cost, trace);
    return moved;
}

/* Moves the constants to what the block and what was known before it make most likely, and with them the motion and the rows that are left for the
   next one. Leaves the Cholesky factor of its information in L. */
static void find_block(filter *f, double L[NP][NP])
{
    double b[NP], step[NP], change[NP], cost = 0.0;
    const double trace = block_information(f, L, b);
    for (int64_t r = 0; r < f->rows; r++) {
        cost += f->r[r] * f->r[r];
    }
    (void)find_step(f, L, b, step);
    for (int i = 0; i < NP; i++) {
        f->eta[i] += step[i];
    }
    block_set_constants(f, f->eta, change);
    for (int i = 0; i < NZ; i++) {
        for (int q = 0; q < NP; q++) {
            f->now.z[i] += f->now.Y[i][q] * change[q];
        }
    }
    for (int64_t r = f->rows; r < f->rows + f->kept; r++) {
        for (int q = 0; q < NP; q++) {
            f->r[r] -= f->H[r][q] * change[q];
        }
    }
    note_fit(f, cost, trace);
}

/* A constant that moves while the others stand still shifts eta along d, its column of W^-1. Along it the block's step has the variance
   d' (I - J^-1) d if nothing moves. Where the data say so, forgetting of it grows; else it dies away, and what is constant is remembered. */
static void adapt_forgetting(filter *f, double L[NP][NP], double conditional[NP])
{
    /* The ratio's variance is 2; the running mean takes the share of it below. */
    const double noise = sqrt(2.0 * 0.5 * FORGET_SHARE), rate = f->settings.forget_rate;
    for (int i = 0; i < NP; i++) {
        double unit[NP] = {0.0}, d[NP], half[NP], shift = 0.0, size = 0.0, left = 0.0;
        unit[i] = 1.0;
        block_scale(f, unit, d);
        block_halve(L, d, half);
        for (int j = 0; j < NP; j++) {
            shift += d[j] * f->eta[j];
            size += d[j] * d[j];
            left += half[j] * half[j];
        }
        conditional[i] = 1.0 / size;
        /* What the block says nothing of does not show whether it moves. */
        const double learned = size - left;
        const double ratio = learned > LEARNED * size ? smaller(shift * shift / learned, 10.0) : 1.0;
        f->moving[i] += FORGET_SHARE * (ratio - 1.0 - f->moving[i]);
        if (f->moving[i] > FORGET_SIGMAS * noise) {
            f->forget[i] = smaller(larger(f->forget[i], FORGET_MIN) * exp(rate * f->moving[i]), f->settings.forget_max);
        } else {
            f->forget[i] *= exp(-rate * FORGET_SHARE);
        }
    }
}

void fit_fold(filter *f, double L[NP][NP])
{
    double conditional[NP];
    memset(conditional, 0, sizeof conditional);
    if (!f->growing) {
        adapt_forgetting(f, L, conditional);
    }
    block_shrink(f, L);
    if (!f->growing) {
        straight_follow(f);
    }
    for (int i = 0; i < NP; i++) {
        if (f->forget[i] > FORGOTTEN) {
            /* Added, not scaled: the scaled row of one of two constants that move together would pass for knowledge of both. */
            block_widen(f, i, sqrt(2.0 * f->forget[i] * (double)f->in_block * f->m.period * conditional[i]));
        }
    }
    memcpy(f->W_now, f->W, sizeof f->W_now);
    memmove(f->H, f->H + f->rows, (size_t)f->kept * sizeof *f->H);
    memmove(f->r, f->r + f->rows, (size_t)f->kept * sizeof *f->r);
    f->rows = f->kept;
    f->kept = 0;
    f->growing = 0;
    filter_form(f);
    fit_begin(f);
}

/* Whether a constant of the electronics is where the design can't mean it: samples of a pickoff at its end lead there, and what no sample shows
   keeps it there. */
static int is_another_device(const filter *f)
{
    int far = 0;
    for (int i = 6; i < INVERSE_MASS; i++) {
        far |= fabs(f->k.p[i] - f->first_p[i]) > FARTHEST * f->prior[i];
    }
    return far;
}

/* Leaves the block as it is fitted, L being its Cholesky factor, and lets it grow on. */
static void grow_on(filter *f, double L[NP][NP])
{
    double known_W[NP][NP];
    memcpy(known_W, f->W, sizeof known_W);
    block_shrink(f, L);
    memcpy(f->W_now, f->W, sizeof f->W_now);
    memcpy(f->W, known_W, sizeof known_W);
    plan_block(f);
}

/* A whole start has been fitted, `off` deviations beside where its slopes say. */
static void end_start(filter *f, double L[NP][NP], double off)
{
    f->lost = !(f->fit < LOST) || (f->fit > ANOTHER && is_another_device(f));
    fit_fold(f, L);
    f->left = off > OFF ? HUGE_VAL : f->chi2;
}

void fit_end(filter *f)
{
    double L[NP][NP];
    if (f->growing) {
        const double off = find_start(f, L);
        filter_form(f);
        if (f->in_block < (int64_t)f->settings.start) {
            grow_on(f, L);
            f->lost = f->in_block >= FOUND && fabs(f->now.z[OMEGA]) > FASTEST;
        } else {
            end_start(f, L, off);
        }
    } else {
        const int64_t recent = 2 * (int64_t)f->settings.settle;
        f->kept = f->rows > recent ? recent : f->rows;
        f->rows -= f->kept;
        unseen_look(f);
        find_block(f, L);
        fit_fold(f, L);
        if (f->left > UNFIT && (f->tries < TRIES || !isfinite(f->left)) && f->effort > FOR_WHOLE * f->settings.start) {
            f->tries++;
            restart_to_look(f);
        }
    }
    f->fresh = 1;
}

void fit_cut(filter *f)
{
    double L[NP][NP];
    find_block(f, L);
    fit_fold(f, L);
    f->fresh = 1;
}

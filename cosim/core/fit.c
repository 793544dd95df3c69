#include "fit.h"

#include "block.h"
#include "descent.h"
#include "known_model.h"
#include "no_lag.h"
#include "prediction.h"
#include "restart.h"
#include "straight.h"
#include "unseen.h"

#define FORGET_SHARE 0.05 /* of a block in the running mean that forgetting follows */
#define FORGET_SIGMAS 5.0 /* standard deviations at which it counts as moving */
#define FORGET_MIN 0.1 /* where forgetting begins [1/s] */
#define FORGOTTEN 1e-3 /* below which forgetting is none [1/s] */
#define HELD 5.0       /* deviations from its lowest value, the others given, within which a constant may be held by it */
#define LEARNED 1e-9   /* share of what is known of a constant that a block must add to say whether it moves */
#define LOST 1e4     /* mean squared innovation of a whole start that has found nothing */
#define TRIES 3        /* further starts at most where one ends beside its fit, and so claims what it does not know */
#define ANOTHER 2.0    /* mean squared innovation of a start that may have found another device */
#define UNFIT 1.035    /* mean squared innovation that a device as the design means it does not leave: 32768 numbers leave 1 by 0.008 */
#define FASTEST 1e4  /* rate that is no device's [rad/s]: far from the device it explains more than constants do */
#define FARTHEST 10.0 /* standard deviations of the design that an effect may be away from it */
#define ASTRAY 0.5   /* share of the fastest forgetting at which a damping has gone astray; one that noise begins dies away at a tenth */
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

/* Moves the constants to what the block and what was known before it make most likely, and with them the motion and the rows that are left for the
   next one. Leaves the Cholesky factor of its information in L. */
static void find_block(filter *f, double L[NP][NP])
{
    double b[NP], step[NP], change[NP], cost = 0.0;
    const double trace = block_information(f, L, b);
    for (int64_t r = 0; r < f->rows; r++) {
        cost += f->r[r] * f->r[r];
    }
    (void)descent_step(f, L, b, step);
    no_lag_look(f, L, step);
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
        /* What the block says nothing of does not show whether it moves; nor does what stands at its lowest value, which holds it and pushes others. */
        const double learned = size - left;
        const int speaks = learned > LEARNED * size && f->k.p[i] - f->lowest[i] > HELD * sqrt(conditional[i]);
        const double ratio = speaks ? smaller(shift * shift / learned, 10.0) : 1.0;
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
        block_widen(f, f->reopened);
        memset(f->reopened, 0, sizeof f->reopened);
        unseen_follow(f);
        straight_follow(f);
    } else {
        straight_begin(f);
    }
    for (int i = 0; i < NP; i++) {
        if (f->forget[i] > FORGOTTEN) {
            /* Added, not scaled: the scaled row of one of two constants that move together would pass for knowledge of both. */
            double wide[NP] = {0.0};
            wide[i] = sqrt(2.0 * f->forget[i] * (double)f->in_block * f->m.period * conditional[i]);
            block_widen(f, wide);
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

/* Whether a damping seems to move since the blocks after a start go astray: along what it hardly told, which bends, and away from what it told well, until
   each block pulls further the same way. */
static int goes_astray(const filter *f)
{
    const double most = larger(larger(f->forget[3], f->forget[4]), f->forget[5]);
    return f->hardly_told && most > ASTRAY * f->settings.forget_max;
}

/* Whether another start is to tell what the last one could not. Dampings that do move ask for one alone. */
static int looks_again(const filter *f)
{
    const int unfit = f->left > UNFIT && (f->tries < TRIES || !isfinite(f->left));
    return (unfit || (f->tries == 0 && goes_astray(f))) && f->effort > FOR_WHOLE * f->settings.start;
}

void fit_end(filter *f)
{
    double L[NP][NP];
    if (f->growing) {
        const descent found = descent_find(f, L);
        note_fit(f, found.cost, found.trace);
        filter_form(f);
        if (f->in_block < (int64_t)f->settings.start) {
            grow_on(f, L);
            f->lost = f->in_block >= FOUND && fabs(f->now.z[OMEGA]) > FASTEST;
        } else {
            end_start(f, L, found.off);
        }
    } else {
        const int64_t recent = 2 * (int64_t)f->settings.settle;
        f->kept = f->rows > recent ? recent : f->rows;
        f->rows -= f->kept;
        unseen_look(f);
        find_block(f, L);
        fit_fold(f, L);
        if (looks_again(f)) {
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

#include "filter.h"

#include "block.h"
#include "known_model.h"
#include "prediction.h"

#define OUTLIER 15.0 /* squared innovation over its fast variance from which the full one is worth working out */
#define ROUNDS 8     /* filterings of a block at most */
#define MOVED 0.3    /* change of p in its new standard deviations, all together, that is worth another one */
#define FITS 2.0     /* mean squared innovation of a start that has found the device; before that every sample may surprise */
#define FORGET_SHARE 0.05 /* of a block in the running mean that forgetting follows */
#define FORGET_SIGMAS 5.0 /* standard deviations at which it counts as moving */
#define FORGET_MIN 0.1 /* where forgetting begins [1/s] */
#define FORGOTTEN 1e-3 /* below which forgetting is none [1/s] */
#define LEARNED 1e-9   /* share of what is known of a constant that a block must add to say whether it moves */
#define UNFOUND 1e6  /* running mean of squared innovations of a device that has not been found yet */
#define LOST 1e4     /* mean squared innovation of a whole start that has found nothing */
#define EFFORT 2.0   /* samples filtered again for each new one, in the long run */
#define EFFORT_MAX 200000.0 /* saved up at most */
#define NOISE_SHARE 0.01 /* of a sample in the running mean of 1/S */
#define WATCHED 0.005 /* over which innovations are averaged [s] */
#define FIRST 16     /* samples of the first block at its first fit */

/* Of constant i. */
static double variance_of(const filter *f, int i)
{
    double total = 0.0;
    for (int j = i; j < NP; j++) {
        total += f->W[i][j] * f->W[i][j];
    }
    return total;
}

/* |W' h|^2: what the uncertainty of p adds to the variance of a measurement. */
static double uncertainty(const filter *f, const double *h)
{
    double total = 0.0;
    for (int j = 0; j < NP; j++) {
        double sum = 0.0;
        for (int i = 0; i <= j; i++) {
            sum += f->W_now[i][j] * h[i];
        }
        total += sum * sum;
    }
    return total;
}

/* Corrects with one axis, e being its innovation [V]; returns its squared size over the full variance where that is large, else 0. */
static double correct_axis(filter *f, const double *c, const double *by_p, double noise, double e)
{
    moving *n = &f->now;
    double Pc[NZ], gain[NZ], h[NP], S = noise, surprise = 0.0;
    memcpy(h, by_p, sizeof h);
    for (int i = 0; i < NZ; i++) {
        Pc[i] = 0.0;
        for (int j = 0; j < NZ; j++) {
            Pc[i] += n->P[i][j] * c[j];
        }
        S += c[i] * Pc[i];
        if (c[i] != 0.0) {
            for (int q = 0; q < NP; q++) {
                h[q] += c[i] * n->Y[i][q];
            }
        }
    }
    const double root = 1.0 / sqrt(S);
    if (e * e > OUTLIER * S) {
        surprise = e * e / (S + uncertainty(f, h));
    }
    double *row = f->H[f->rows];
    for (int q = 0; q < NP; q++) {
        row[q] = h[q] * root;
    }
    f->r[f->rows] = e * root;
    if (isfinite(1.0 / S)) {
        /* Trials of a start may have lost their numbers. */
        f->inverse[f->rows & 1] += NOISE_SHARE * (1.0 / S - f->inverse[f->rows & 1]);
    }
    f->rows++;
    for (int i = 0; i < NZ; i++) {
        gain[i] = Pc[i] / S;
        n->z[i] += gain[i] * e;
        for (int q = 0; q < NP; q++) {
            n->Y[i][q] -= gain[i] * h[q];
        }
    }
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < NZ; j++) {
            n->P[i][j] -= gain[i] * Pc[j];
        }
    }
    n->sum += gain[OMEGA] * e;
    n->sum_variance += gain[OMEGA] * gain[OMEGA] * S * (1.0 + f->share);
    return surprise;
}

/* Corrects with the sample of both axes; returns the surprise. */
static double correct(filter *f, const double v[2])
{
    double expected[2], C[2][NZ], by_p[2 * NP], noise[2], was[NZ];
    filter_expect(f, expected, C, by_p, noise);
    memcpy(was, f->now.z, sizeof was);
    double surprise = correct_axis(f, C[0], by_p, noise[0], v[0] - expected[0]);
    double e = v[1] - expected[1];
    for (int i = 0; i < NZ; i++) {
        e -= C[1][i] * (f->now.z[i] - was[i]);
    }
    return surprise + correct_axis(f, C[1], by_p + NP, noise[1], e);
}

/* Solves a x = b for 2 x 2 a, `columns` right-hand sides [2 * columns], in place. */
static void solve_pair(const double a[4], double *b, int columns)
{
    const double det = a[0] * a[3] - a[1] * a[2];
    for (int q = 0; q < columns; q++) {
        const double first = b[q], second = b[columns + q];
        b[q] = (a[3] * first - a[1] * second) / det;
        b[columns + q] = (a[0] * second - a[2] * first) / det;
    }
}

/* The position from the first sample, exactly through the pickoff's curve: what is uncertain of it is the sample's noise and p. */
static void begin_motion(filter *f, const double v[2])
{
    enum { STEPS = 6 };
    moving *n = &f->now;
    const double none[2] = {0.0, 0.0};
    double l[2] = {v[0], v[1]}, through[4], l_by_p[2 * NP], q[2] = {0.0, 0.0}, by_q[4], by_s[2 * NS], by_p[2 * NP], noise[2], u[2];
    double *z = n->z;
    known_actuate(&f->k, z, filter_command(f, 0), z[OMEGA], u);
    for (int i = 0; i < STEPS; i++) {
        double e[2];
        known_amplify(&f->k, z, l, z[OMEGA], e);
        known_amplify_by_voltage(&f->k, z, l, z[OMEGA], through);
        e[0] = v[0] - e[0];
        e[1] = v[1] - e[1];
        solve_pair(through, e, 1);
        l[0] += e[0];
        l[1] += e[1];
    }
    for (int i = 0; i < STEPS; i++) {
        double e[2];
        z[0] = q[0];
        z[2] = q[1];
        known_pick_off(&f->k, z, u, z[OMEGA], e);
        known_pick_off_by_state(&f->k, z, u, z[OMEGA], by_s);
        const double slopes[4] = {by_s[0], by_s[2], by_s[NS], by_s[NS + 2]};
        memcpy(by_q, slopes, sizeof by_q);
        e[0] = l[0] - e[0];
        e[1] = l[1] - e[1];
        solve_pair(by_q, e, 1);
        q[0] += e[0];
        q[1] += e[1];
    }
    z[0] = q[0];
    z[2] = q[1];
    const double one[4] = {1.0, 0.0, 0.0, 1.0};
    memset(l_by_p, 0, sizeof l_by_p);
    memset(by_p, 0, sizeof by_p);
    spread_amplify_by_parameter(&f->k, z, l, z[OMEGA], one, 2, l_by_p);
    spread_pick_off_by_parameter(&f->k, z, u, z[OMEGA], one, 2, by_p);
    known_noise(&f->k, z, none, z[OMEGA], noise);
    solve_pair(through, l_by_p, NP);
    /* The noise of the sample moves the voltages by `root`, and the position by by_q^-1 of it. */
    double root[4] = {sqrt(noise[0]), 0.0, 0.0, sqrt(noise[1])}, spread[NZ][2];
    memset(spread, 0, sizeof spread);
    solve_pair(through, root, 2);
    if (HAS_LAG) {
        for (int a = 0; a < 2; a++) {
            z[NZ - 2 + a] = l[a];
            memcpy(spread[NZ - 2 + a], root + 2 * a, 2 * sizeof *root);
            for (int q_ = 0; q_ < NP; q_++) {
                n->Y[NZ - 2 + a][q_] = -l_by_p[a * NP + q_];
            }
        }
    }
    for (int i = 0; i < 2 * NP; i++) {
        by_p[i] = -l_by_p[i] - by_p[i];
    }
    solve_pair(by_q, by_p, NP);
    solve_pair(by_q, root, 2);
    for (int a = 0; a < 2; a++) {
        memcpy(n->Y[2 * a], by_p + a * NP, NP * sizeof *by_p);
        memcpy(spread[2 * a], root + 2 * a, 2 * sizeof *root);
    }
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < NZ; j++) {
            if (spread[i][0] != 0.0 || spread[i][1] != 0.0) {
                n->P[i][j] = n->P[j][i] = spread[i][0] * spread[j][0] + spread[i][1] * spread[j][1];
            }
        }
    }
}

static void open_rate(filter *f);

/* Where the next block ends. One that grows doubles, from FIRST samples on; another is a sixteenth of what went before. */
static void plan_block(filter *f)
{
    const double age = (double)(f->sample + 1 - f->since);
    if (f->growing) {
        f->length = f->in_block > 0 ? 2 * f->in_block : FIRST;
    } else {
        f->length = (int64_t)smaller(larger(floor(age / 16.0), FIRST), smaller(f->settings.block, BLOCK_MAX));
    }
}

static void begin_block(filter *f)
{
    f->in_block = 0;
    f->block_begun = f->sample + 1;
    f->begun = f->now;
    memcpy(f->p_begun, f->k.p, sizeof f->p_begun);
    memset(f->eta, 0, sizeof f->eta);
    plan_block(f);
}

/* Leaves out the rows of the samples in which a surprise may have been under way: what they tell is of the rate, not of the constants. */
static void drop_recent(filter *f)
{
    const int64_t recent = 2 * ((int64_t)f->settings.settle + 1);
    f->rows = f->rows > recent ? f->rows - recent : 0;
}

static void enter(filter *f, const double in[IN])
{
    const int changed = memcmp(f->k.in, in, sizeof f->k.in) != 0;
    memcpy(f->k.in, in, sizeof f->k.in);
    if (changed) {
        /* Parameter laws follow the inputs. */
        filter_form(f);
    }
    f->k.t = (double)f->sample * f->m.period;
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
    enter(f, f->in[0]);
    filter_form(f);
    for (int64_t k = f->block_begun; k <= last; k++) {
        const int64_t place = k - f->block_begun;
        f->sample = k;
        enter(f, f->in[place]);
        if (k > f->origin) {
            filter_predict(f);
            correct(f, f->v[place]);
        } else {
            begin_motion(f, f->v[place]);
        }
        if (f->opened[place]) {
            drop_recent(f);
            open_rate(f);
        }
    }
    for (int64_t r = 0; r < f->rows; r++) {
        total += f->r[r] * f->r[r];
    }
    f->now.sum = f->now.sum_variance = 0.0;
    return total;
}

/* Follows how large and how white the innovations are. Those of a start that has just been filtered at its own fit are taken as they are; others also
   carry what was not known of the constants beforehand. */
static void watch(filter *f)
{
    if (f->rows == 0) {
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
    f->chi2 += pace * (total / ((double)f->rows * expected) + lacking - f->chi2);
    for (int a = 0; a < 2; a++) {
        const double neighbours = product[a] / (0.5 * (double)f->rows * expected);
        f->pink[a] = pink[2 * a + 1] * f->inverse[a];
        f->white[a] += pace * (neighbours - f->pink[a] - f->white[a]);
    }
}

/* Finds the constants that the block and what was known before it make most likely, filtering it again up to `rounds` times: Gauss-Newton on
   |eta|^2 + |r(eta)|^2, with p = p_begun + W eta. Leaves the Cholesky factor of its Hessian in L. */
static void find_constants(filter *f, int rounds, double L[NP][NP])
{
    double b[NP], step[NP], half[NP], change[NP], eta[NP], trial[NP];
    memcpy(eta, f->eta, sizeof eta);
    double trace = block_information(f, L, b), cost = block_squared(eta);
    for (int64_t r = 0; r < f->rows; r++) {
        cost += f->r[r] * f->r[r];
    }
    for (int round = 0;; round++) {
        for (int i = 0; i < NP; i++) {
            b[i] -= eta[i];
        }
        block_solve(L, b, step, half);
        double part = 1.0;
        for (int i = 0; i < NP; i++) {
            trial[i] = eta[i] + step[i];
        }
        block_keep_in_bounds(f, L, trial);
        const double moved = block_distance(L, trial, eta);
        for (int i = 0; i < NP; i++) {
            step[i] = trial[i] - eta[i];
        }
        block_set_constants(f, trial, change);
        if (round >= rounds || moved < MOVED || f->effort <= 0.0) {
            break;
        }
        double next = block_squared(trial) + filter_again(f);
        while (!(next < cost * 1.001 + 1.0) && part > 0.01 && f->effort > 0.0) {
            part *= 0.3;
            for (int i = 0; i < NP; i++) {
                trial[i] = eta[i] + part * step[i];
            }
            block_set_constants(f, trial, change);
            next = block_squared(trial) + filter_again(f);
        }
        memcpy(eta, trial, sizeof eta);
        cost = next;
        trace = block_information(f, L, b);
    }
    memcpy(f->eta, trial, sizeof trial);
    f->fit = f->rows > 0 ? cost / (double)f->rows : 1.0;
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
    if (f->rows > 0) {
        f->share = trace / (double)f->rows;
        watch(f);
    }
}

/* A constant that moves while the others stand still shifts eta along d, its column of W^-1. Along it the block's step has the variance
   d' (I - J^-1) d if nothing moves. Where the data say so, forgetting of it grows; else it dies away, and what is constant is remembered. */
static void adapt_forgetting(filter *f, double L[NP][NP], double conditional[NP])
{
    /* The ratio's variance is 2; the running mean takes the share of it below. */
    const double noise = sqrt(2.0 * 0.5 * FORGET_SHARE), rate = f->settings.forget_rate;
    for (int i = 0; i < NP; i++) {
        double d[NP], half[NP], shift = 0.0, size = 0.0, left = 0.0;
        block_along(f, i, d);
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

static void fold(filter *f, double L[NP][NP])
{
    double conditional[NP];
    memset(conditional, 0, sizeof conditional);
    if (!f->growing) {
        adapt_forgetting(f, L, conditional);
    }
    block_shrink(f, L);
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
    begin_block(f);
}

/* The block is full: one that grows goes on, any other is folded into the constants, but for the rows of its last samples, in which a jump of
   the rate may be under way that has not surprised yet. */
static void end_block(filter *f)
{
    double L[NP][NP];
    if (f->growing) {
        find_constants(f, ROUNDS, L);
        filter_form(f);
        if (f->in_block < (int64_t)f->settings.start) {
            double known_W[NP][NP];
            memcpy(known_W, f->W, sizeof known_W);
            block_shrink(f, L);
            memcpy(f->W_now, f->W, sizeof f->W_now);
            memcpy(f->W, known_W, sizeof known_W);
            filter_again(f);
            watch(f);
            plan_block(f);
        } else {
            f->lost = !(f->fit < LOST);
            fold(f, L);
        }
    } else {
        const int64_t recent = 2 * (int64_t)f->settings.settle;
        f->kept = f->rows > recent ? recent : f->rows;
        f->rows -= f->kept;
        find_constants(f, 0, L);
        fold(f, L);
    }
    f->fresh = 1;
}

/* Folds what there is of the block. */
static void cut_block(filter *f)
{
    double L[NP][NP];
    find_constants(f, 0, L);
    fold(f, L);
    f->fresh = 1;
}

/* What is uncertain of z by way of p becomes its own, so that p can be opened anew. */
static void part_from_constants(filter *f)
{
    moving *n = &f->now;
    double YW[NZ][NP];
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < NP; j++) {
            YW[i][j] = 0.0;
            for (int q = 0; q <= j; q++) {
                YW[i][j] += n->Y[i][q] * f->W[q][j];
            }
        }
    }
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < NZ; j++) {
            for (int q = 0; q < NP; q++) {
                n->P[i][j] += YW[i][q] * YW[j][q];
            }
        }
    }
    memset(n->Y, 0, sizeof n->Y);
}

/* Begins again with what the design says, at the next sample. */
static void begin_anew(filter *f)
{
    f->restarted_at = f->k.t;
    memcpy(f->k.p, f->first_p, sizeof f->k.p);
    memcpy(f->W, f->first_W, sizeof f->W);
    memcpy(f->W_now, f->first_W, sizeof f->W_now);
    f->now = f->first;
    f->walk = f->settings.omega_walk_max;
    f->surprises = f->restarts = f->share = 0.0;
    /* Afresh: what made the filter lose its numbers may be in these means, and would never leave them. */
    f->chi2 = UNFOUND;
    memset(f->white, 0, sizeof f->white);
    memset(f->last_r, 0, sizeof f->last_r);
    memset(f->moving, 0, sizeof f->moving);
    memset(f->forget, 0, sizeof f->forget);
    f->rows = f->kept = 0;
    f->lost = 0;
    f->fit = 2.0 * FITS;
    f->growing = 1;
    f->origin = f->since = f->sample + 1;
    f->fresh = 1;
    filter_form(f);
    begin_block(f);
}

/* Opens the constants of the plant again; what the electronics are stays known. After several times in a row everything begins anew. */
static void restart(filter *f)
{
    f->restarts += 1.0;
    f->surprises = 0.0;
    cut_block(f);
    part_from_constants(f);
    if (f->restarts > f->settings.restart_limit) {
        begin_anew(f);
        return;
    }
    for (int i = 0; i < NP; i++) {
        const int plant = i < 6 || i == INVERSE_MASS, damping = i >= 3 && i < 6;
        if (plant) {
            const double variance = variance_of(f, i), share = damping ? f->settings.restart_damping : f->settings.restart_stiffness;
            const double own = larger(share * fabs(f->k.p[i]), 0.01 * share * f->prior[i]);
            for (int j = i; j < NP; j++) {
                f->W[i][j] = 0.0;
            }
            f->W[i][i] = larger(own, sqrt(variance));
        } else {
            const double variance = variance_of(f, i);
            for (int j = i; j < NP; j++) {
                f->W[i][j] = 0.0;
            }
            f->W[i][i] = sqrt(variance);
        }
    }
    for (int i = 0; i < 6; i++) {
        f->W[i][INVERSE_MASS] = f->k.p[i] / f->k.p[INVERSE_MASS] * f->W[INVERSE_MASS][INVERSE_MASS];
    }
    memcpy(f->W_now, f->W, sizeof f->W_now);
    f->since = f->sample;
    f->growing = 1;
    begin_block(f);
}

/* Opens the rate, and the state by what a jump of the rate did in the last `settle` samples. */
static void open_rate(filter *f)
{
    moving *n = &f->now;
    const filter_settings *s = &f->settings;
    const double span = s->settle * f->m.period, *z = n->z, *p = f->k.p;
    double energy = z[1] * z[1] + z[3] * z[3] + fabs(p[0]) * z[0] * z[0] + fabs(p[1]) * z[2] * z[2];
    const double velocity = 4.0 * s->omega_jump * s->omega_jump * span * span * energy;
    for (int i = 0; i < 4; i++) {
        n->P[i][i] += 0.01 * velocity * (i % 2 == 1 ? 1.0 : 0.25 * span * span);
    }
    /* The Coriolis acceleration of a jump, held for the typical age at which it shows, 0.3 of `settle`. */
    const double lag = 0.3 * span;
    double v[NZ] = {0.0};
    v[0] = z[3] * lag * lag;
    v[1] = 2.0 * z[3] * lag;
    v[2] = -z[1] * lag * lag;
    v[3] = -2.0 * z[1] * lag;
    v[OMEGA] = 1.0;
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < NZ; j++) {
            n->P[i][j] += s->omega_jump * s->omega_jump * v[i] * v[j];
        }
    }
}

/* A sample that is too far off: the rate has jumped. Surprises that go on say that the constants have changed. */
static void take_surprise(filter *f)
{
    f->surprises += 1.0;
    f->wait = f->settings.settle;
    drop_recent(f);
    if (f->growing) {
        f->opened[f->in_block - 1] = 1;
    } else {
        cut_block(f);
    }
    open_rate(f);
    if (f->surprises > f->settings.surprise_limit) {
        restart(f);
    }
}

static void adapt_walk(filter *f)
{
    moving *n = &f->now;
    double ratio = 10.0;
    if (n->sum_variance > 0.0) {
        ratio = smaller(n->sum * n->sum / n->sum_variance, 10.0);
    }
    n->sum = n->sum_variance = 0.0;
    const double walk = f->walk * exp(0.5 * f->settings.omega_walk_rate * (ratio - 1.0));
    f->walk = smaller(larger(walk, f->settings.omega_walk_min), f->settings.omega_walk_max);
}

static void advance(filter *f, const double u[2], const double in[IN])
{
    f->sample++;
    if (f->sample > 0) {
        memcpy(f->u[(f->sample - 1) & (QUEUE - 1)], u, 2 * sizeof *u);
    }
    memcpy(f->in[f->in_block], in, sizeof f->k.in);
    enter(f, in);
    f->opened[f->in_block] = 0;
    if (f->sample > f->origin) {
        filter_predict(f);
    }
}

/* Whether the filter still has numbers, and a start that has used all its samples has found a device. */
static int is_sound(const filter *f)
{
    double total = 0.0;
    for (int i = 0; i < NZ; i++) {
        total += f->now.z[i] * 0.0 + f->now.P[i][i] * 0.0;
    }
    for (int i = 0; i < NP && f->fresh; i++) {
        total += f->k.p[i] * 0.0 + f->W_now[i][i] * 0.0;
    }
    return total == 0.0 && !(f->fresh && f->lost);
}

void filter_step(filter *f, const double u[2], const double v[2], const double in[IN])
{
    const filter_settings *s = &f->settings;
    advance(f, u, in);
    memcpy(f->v[f->in_block], v, 2 * sizeof *v);
    double surprise = 0.0;
    if (f->sample > f->origin) {
        surprise = correct(f, v);
    } else {
        begin_motion(f, v);
    }
    f->in_block++;
    f->effort = smaller(f->effort + EFFORT, EFFORT_MAX);
    f->fresh = 0;
    f->surprises *= 1.0 - 1.0 / s->surprise_memory;
    f->restarts *= 1.0 - 0.1 / s->surprise_memory;
    f->wait -= 1.0;
    if (surprise > s->surprise && f->wait < 0.0 && (!f->growing || f->fit < FITS)) {
        take_surprise(f);
    }
    if (f->sample % 64 == 63) {
        adapt_walk(f);
    }
    if (f->in_block >= f->length) {
        end_block(f);
    }
    if (!is_sound(f)) {
        begin_anew(f);
    }
}

void filter_step_told(filter *f, const double u[2], const double *z_true, const double in[IN])
{
    advance(f, u, in);
    memcpy(f->now.z, z_true, (OMEGA + 1) * sizeof *z_true);
    double expected[2], C[2][NZ], by_p[2 * NP], noise[2];
    filter_expect(f, expected, C, by_p, noise);
    for (int a = 0; a < 2; a++) {
        correct_axis(f, C[a], by_p + a * NP, noise[a], 0.0);
    }
    f->in_block++;
    if (f->in_block >= f->length) {
        double L[NP][NP], b[NP];
        (void)block_information(f, L, b);
        fold(f, L);
    }
}

void filter_start(filter *f, const filter_settings *settings, const double *c, const double *z, const double *dz, const double *p,
                  const double *W, const double *lowest, double period)
{
    memset(f, 0, sizeof *f);
    f->settings = *settings;
    memcpy(f->k.c, c, NC * sizeof *c);
    memcpy(f->k.p, p, sizeof f->k.p);
    memcpy(f->W, W, sizeof f->W);
    memcpy(f->first_W, W, sizeof f->W);
    memcpy(f->W_now, W, sizeof f->W);
    memcpy(f->lowest, lowest, sizeof f->lowest);
    f->m.period = period;
    for (int i = 0; i < NZ; i++) {
        f->now.z[i] = z[i];
        f->now.P[i][i] = dz[i] * dz[i];
    }
    for (int i = 0; i < NP; i++) {
        f->prior[i] = sqrt(variance_of(f, i));
    }
    memcpy(f->first_p, p, sizeof f->first_p);
    f->first = f->now;
    f->walk = settings->omega_walk_max;
    f->sample = -1;
    f->restarted_at = -1.0;
    f->chi2 = UNFOUND;
    f->effort = EFFORT_MAX;
    f->growing = 1;
    f->fit = 2.0 * FITS;
    filter_form(f);
    begin_block(f);
}

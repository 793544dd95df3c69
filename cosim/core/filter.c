#include "filter.h"

#include "block.h"
#include "correction.h"
#include "covariance.h"
#include "fit.h"
#include "known_model.h"
#include "prediction.h"
#include "rate.h"
#include "restart.h"
#include "take_up.h"

#define EFFORT 2.0   /* samples filtered again for each new one, in the long run */
#define STEPPED 6.0  /* deviations of its walk by which a rate that is told has stepped */
#define EFFORT_MAX 2000000.0 /* saved up at most */
/* Deviations of the design above its lowest value that a constant stays which shows by its square, and has no slope there: of the inverse of a gap under
   `lab` as far as a gap of 8 mm, 2e-8 of the voltage at 1 um. */
#define FLAT 0.01

static void advance(filter *f, const double u[2], const double in[IN])
{
    f->sample++;
    if (f->sample > 0) {
        memcpy(f->u[(f->sample - 1) & (QUEUE - 1)], u, 2 * sizeof *u);
    }
    memcpy(f->in[f->in_block], in, sizeof f->k.in);
    filter_enter(f, in);
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

/* Keeps what was measured, and now and then the motion. */
static void remember(filter *f, const double v[2], const double in[IN])
{
    heard *h = &f->heard[f->sample & (RECENT - 1)];
    memcpy(h->v, v, sizeof h->v);
    memcpy(h->in, in, sizeof h->in);
    if (f->sample % EVERY == 0) {
        before_now *b = &f->past[f->sample / EVERY % (RECENT / EVERY)];
        memcpy(b->z, f->now.z, sizeof b->z);
        memcpy(b->P, f->now.P, sizeof b->P);
        covariance_add_constants(&f->now, f->W_now, b->P);
    }
}

/* A voltage that comes back to the bit, and never a larger one, is the end of the converter. */
static void look_for_end(filter *f, const double v[2])
{
    for (int a = 0; a < 2; a++) {
        f->clipped = fabs(v[a]) > f->top ? 0 : f->clipped || fabs(v[a]) == f->top;
        f->top = larger(f->top, fabs(v[a]));
    }
}

/* Whether a sample can tell that the rate has jumped: not while the start still looks for the device. Another start is as long as it will be at
   once. */
static int knows_device(const filter *f) { return !f->growing || (f->fit < FITS && f->length > FOUND); }

void filter_step(filter *f, const double u[2], const double v[2], const double in[IN])
{
    const filter_settings *s = &f->settings;
    advance(f, u, in);
    look_for_end(f, v);
    memcpy(f->v[f->in_block], v, 2 * sizeof *v);
    double surprise = 0.0;
    if (f->sample > f->origin) {
        surprise = filter_correct(f, v);
    } else {
        filter_take_up(f, v);
    }
    f->in_block++;
    f->effort = smaller(f->effort + EFFORT, EFFORT_MAX);
    f->fresh = 0;
    f->surprises *= 1.0 - 1.0 / s->surprise_memory;
    f->restarts *= 1.0 - 0.1 / s->surprise_memory;
    f->wait -= 1.0;
    if (surprise > s->surprise && f->wait < 0.0 && knows_device(f)) {
        restart_on_surprise(f);
    } else if (!f->growing && f->wait < 0.0 && rate_strays(f)) {
        restart_rate(f);
    }
    if (f->sample % 64 == 63) {
        rate_adapt_walk(f);
    }
    if (f->in_block >= f->length) {
        fit_end(f);
    }
    if (!is_sound(f)) {
        restart_from_design(f);
    }
    remember(f, v, in);
}

void filter_step_told(filter *f, const double u[2], const double *z_true, const double in[IN])
{
    advance(f, u, in);
    const double change = z_true[OMEGA] - f->now.z[OMEGA];
    memcpy(f->now.z, z_true, (OMEGA + 1) * sizeof *z_true);
    if (f->sample > f->origin) {
        /* Nobody tells when a rate steps: taken for its walk, a step would be a clock by which to tell a delay from a lag. It may as well have come a
           sample later. */
        const int steps = change * change > STEPPED * STEPPED * f->walk * f->walk * f->m.period;
        if (steps || f->sample == f->jumped_at + 1) {
            f->now.P[OMEGA][OMEGA] += f->settings.omega_jump * f->settings.omega_jump;
        }
        f->jumped_at = steps ? f->sample : f->jumped_at;
        double expected[2], C[2][NZ], by_p[2 * NW], noise[2];
        filter_expect(f, expected, C, by_p, noise);
        for (int a = 0; a < 2; a++) {
            filter_correct_axis(f, C[a], by_p + a * NW, noise[a], 0.0);
        }
    } else {
        filter_take_up_told(f);
    }
    f->in_block++;
    if (f->in_block >= f->length) {
        double L[NP][NP], b[NP];
        (void)block_information(f, L, b);
        fit_fold(f, L);
    }
}

void filter_start(filter *f, const filter_settings *settings, const double *c, const double *z, const double *dz, const double *p,
                  const double *W, const double *lowest, double period)
{
    memset(f, 0, sizeof *f);
    f->settings = *settings;
    memcpy(f->k.c, c, NC * sizeof *c);
    memcpy(f->first_p, p, sizeof f->first_p);
    memcpy(f->first_W, W, sizeof f->first_W);
    memcpy(f->first_lowest, lowest, sizeof f->first_lowest);
    f->m.period = period;
    for (int i = 0; i < NZ; i++) {
        f->first.z[i] = z[i];
        f->first.P[i][i] = dz[i] * dz[i];
    }
    f->sample = f->jumped_at = -1;
    f->effort = EFFORT_MAX;
    restart_from_design(f);
    f->restarted_at = -1.0;
    for (int i = 0; i < NP; i++) {
        f->prior[i] = sqrt(block_variance(f, i));
        f->first_lowest[i] += known_is_flat(i) ? FLAT * f->prior[i] : 0.0;
        f->lowest[i] = f->first_lowest[i];
    }
}

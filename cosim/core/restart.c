#include "restart.h"

#include "block.h"
#include "covariance.h"
#include "fit.h"
#include "prediction.h"
#include "rate.h"
#include "take_up.h"

#define SEVEN 7      /* constants of the plant; beside them there may be effects */
#define UNTRUE (NP > SEVEN ? HUGE_VAL : 1.0) /* what a start has left that is not whole yet: with effects beside the seven it claims more than it knows */
#define UNFOUND 1e6  /* running mean of squared innovations of a device that has not been found yet */

/* What is uncertain of z by way of p becomes its own, so that p can be opened anew. */
static void part_from_constants(filter *f)
{
    moving *n = &f->now;
    covariance_add_constants(n, f->W, n->P);
    memset(n->Y, 0, sizeof n->Y);
}

void restart_from_design(filter *f)
{
    f->restarted_at = f->k.t;
    memcpy(f->k.p, f->first_p, sizeof f->k.p);
    memcpy(f->lowest, f->first_lowest, sizeof f->lowest);
    memcpy(f->W, f->first_W, sizeof f->W);
    memcpy(f->W_now, f->first_W, sizeof f->W_now);
    f->now = f->first;
    f->walk = f->settings.omega_walk_max;
    f->slope_walk = f->settings.slope_walk_max;
    f->roaming = 0.0;
    rate_jumped(f);
    f->surprises = f->restarts = f->share = 0.0;
    /* Afresh: what made the filter lose its numbers may be in these means, and would never leave them. */
    f->chi2 = UNFOUND;
    memset(f->white, 0, sizeof f->white);
    memset(f->last_r, 0, sizeof f->last_r);
    memset(f->moving, 0, sizeof f->moving);
    memset(f->forget, 0, sizeof f->forget);
    f->rows = f->kept = 0;
    f->lost = 0;
    f->tries = 0;
    f->left = UNTRUE;
    f->unseen_count = f->hidden = f->hardly_told = 0;
    f->fit = 2.0 * FITS;
    f->growing = 1;
    f->origin = f->since = f->sample + 1;
    f->fresh = 1;
    filter_form(f);
    fit_begin(f);
}

void restart_to_look(filter *f)
{
    double change[NP];
    /* The motion begins as unknown as the first did: how it follows from the constants is told by slopes, which bend far from here. */
    memcpy(f->now.P, f->first.P, sizeof f->now.P);
    filter_open_states(f);
    memset(f->now.Y, 0, sizeof f->now.Y);
    memcpy(f->W, f->first_W, sizeof f->W);
    f->rows = f->kept = 0;
    f->left = HUGE_VAL;
    f->unseen_count = f->hidden = f->hardly_told = 0;
    f->since = f->sample;
    f->growing = 1;
    fit_begin(f);
    f->length = (int64_t)f->settings.start;
    memcpy(f->p_begun, f->first_p, sizeof f->p_begun);
    for (int i = 0; i < NP; i++) {
        change[i] = f->k.p[i] - f->first_p[i];
    }
    block_scale(f, change, f->eta);
}

/* Opens the constants of the plant again; what the electronics are stays known. After several times in a row everything begins anew, and so it does
   where the first start is not over: what some samples of it say of the electronics is more than they know. */
static void restart(filter *f)
{
    const int over = NP == SEVEN || !(f->growing && f->block_begun == f->origin);
    f->restarts += 1.0;
    f->surprises = 0.0;
    fit_cut(f);
    part_from_constants(f);
    if (f->restarts > f->settings.restart_limit || !over) {
        restart_from_design(f);
        return;
    }
    for (int i = 0; i < NP; i++) {
        const int plant = i < 6 || i == INVERSE_MASS, damping = i >= 3 && i < 6;
        const double share = damping ? f->settings.restart_damping : f->settings.restart_stiffness;
        const double opened = plant ? larger(share * fabs(f->k.p[i]), 0.01 * share * f->prior[i]) : 0.0;
        const double known = sqrt(block_variance(f, i));
        memset(&f->W[i][i], 0, (size_t)(NP - i) * sizeof f->W[i][i]);
        f->W[i][i] = larger(opened, known);
    }
    for (int i = 0; i < 6; i++) {
        f->W[i][INVERSE_MASS] = f->k.p[i] / f->k.p[INVERSE_MASS] * f->W[INVERSE_MASS][INVERSE_MASS];
    }
    memcpy(f->W_now, f->W, sizeof f->W_now);
    f->since = f->sample;
    f->left = UNTRUE;
    f->unseen_count = f->hidden = f->hardly_told = 0;
    f->growing = 1;
    fit_begin(f);
}

void restart_rate(filter *f)
{
    f->jumped_at = f->sample;
    f->wait = f->settings.settle;
    rate_drop_recent(f);
    rate_jumped(f);
    if (f->growing) {
        f->opened[f->in_block - 1] = 1;
    } else {
        fit_cut(f);
    }
    rate_open(f);
}

void restart_on_surprise(filter *f)
{
    f->surprises += 1.0;
    restart_rate(f);
    if (f->surprises > f->settings.surprise_limit) {
        restart(f);
    }
}

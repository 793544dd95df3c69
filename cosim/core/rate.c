#include "rate.h"

void rate_open(filter *f)
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

void rate_drop_recent(filter *f)
{
    const int64_t recent = 2 * ((int64_t)f->settings.settle + 1);
    f->rows = f->rows > recent ? f->rows - recent : 0;
}

void rate_adapt_walk(filter *f)
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

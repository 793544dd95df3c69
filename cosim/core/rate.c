#include "rate.h"

#include "known_model.h"

#define STRETCH 0.01 /* over which changes of the slope are compared with their noise [s] */
#define MOST 1e4     /* walk of the slope that these ask for at most [rad/s2 per s^0.5] */
#define CORNER (1.0 / 3.0) /* highest corner of the filter over the frequency of the oscillation */
#define STRAYED 6.0  /* standard deviations of their sum: steps of 0.6 rad/s reach it in 0.3 ms, sines of 10 rad/s at 50 Hz stay below */
#define FADED 0.8    /* share of the sums of corrections that is left at each call: 320 samples, some times 1/corner; over less a walk too large does not show */
#define JUMP_SLOPE 100.0 /* what a jump of the rate leaves unknown of its slope [rad/s2] */
#define KEPT 0.1     /* in which what that has found is forgotten, by a factor e [s]: a swing that turns round stands still for a moment */
#define SETTLED 2e-3 /* after a jump of the rate, until its estimate has settled [s] */

void rate_open(filter *f)
{
    moving *n = &f->now;
    const filter_settings *s = &f->settings;
    const double span = s->settle * f->m.period, *z = n->z, *p = f->k.p;
    double energy = z[1] * z[1] + z[3] * z[3] + fabs(p[0]) * z[0] * z[0] + fabs(p[1]) * z[2] * z[2];
    /* A jump is as old as `span` at most when it shows. With a hundredth of this variance each step told when it was: by the steps of a second the
       truth was 4 deviations of a lag off. */
    const double velocity = 4.0 * s->omega_jump * s->omega_jump * span * span * energy;
    for (int i = 0; i < 4; i++) {
        n->P[i][i] += velocity * (i % 2 == 1 ? 1.0 : 0.25 * span * span);
    }
    /* The Coriolis acceleration of a jump, held for the typical age at which it shows, 0.3 of `settle`. */
    const double lag = 0.3 * span;
    double v[NZ] = {0.0};
    v[0] = z[3] * lag * lag;
    v[1] = 2.0 * z[3] * lag;
    v[2] = -z[1] * lag * lag;
    v[3] = -2.0 * z[1] * lag;
    v[OMEGA] = 1.0;
    n->P[SLOPE][SLOPE] += JUMP_SLOPE * JUMP_SLOPE;
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

void rate_jumped(filter *f)
{
    f->roamed_at = f->sample + (int64_t)(SETTLED / f->m.period);
    memset(f->now.sum, 0, sizeof f->now.sum);
    memset(f->now.sum_variance, 0, sizeof f->now.sum_variance);
}

int rate_strays(const filter *f) { return f->now.sum[0] * f->now.sum[0] > STRAYED * STRAYED * f->now.sum_variance[0]; }

/* Mean square by which the slope has changed per time beyond its noise, over a stretch. A walk that merely makes the least error follows by a lag as
   large as the noise, and constants take a lag, which goes on, for their own. */
static void watch_roaming(filter *f)
{
    const double slope = f->now.z[SLOPE], variance = f->now.P[SLOPE][SLOPE];
    const double elapsed = (double)(f->sample - f->roamed_at) * f->m.period;
    if (elapsed >= STRETCH) {
        const double change = slope - f->roamed_from;
        f->roaming = larger(f->roaming * exp(-elapsed / KEPT), (change * change - variance - f->roamed_variance) / elapsed);
    }
    if (elapsed >= STRETCH || elapsed <= 0.0) {
        f->roamed_from = slope;
        f->roamed_variance = variance;
        f->roamed_at = elapsed > 0.0 ? f->sample : f->roamed_at;
    }
}

/* Walk of the slope at which the filter's corner is the highest, R being the density of the noise with which samples tell the pattern's angle: that
   of a whole cycle, which holds for what is slower. */
static double highest_slope_walk(const filter *f)
{
    const double none[2] = {0.0, 0.0}, *z = f->now.z, stiffness = 0.5 * (fabs(f->k.p[0]) + fabs(f->k.p[1]));
    const double corner = CORNER * sqrt(stiffness);
    double by_s[2 * NS], told = 0.0;
    known_pick_off_by_state(&f->k, z, none, z[OMEGA], by_s);
    for (int a = 0; a < 2; a++) {
        for (int i = 0; i < 4; i += 2) {
            /* A turn moves x by -y and y by x; mean squares over a cycle. */
            const double other = z[2 - i], velocity = z[3 - i], by = by_s[a * NS + i];
            told += f->inverse[a] * by * by * 0.5 * (other * other + velocity * velocity / stiffness);
        }
    }
    const double most = f->settings.slope_walk_max;
    return told > 0.0 ? smaller(corner * corner * corner * sqrt(f->m.period / told), most) : most;
}

/* The size of a walk that the corrections lately ask for, within its limits. */
static double adapted(double walk, double rate, double sum, double variance, double least, double most)
{
    const double ratio = variance > 0.0 ? smaller(sum * sum / variance, 10.0) : 10.0;
    return smaller(larger(walk * exp(0.5 * rate * (ratio - 1.0)), least), most);
}

void rate_adapt_walk(filter *f)
{
    moving *n = &f->now;
    const filter_settings *s = &f->settings;
    watch_roaming(f);
    f->walk = adapted(f->walk, s->omega_walk_rate, n->sum[0], n->sum_variance[0], s->omega_walk_min, s->omega_walk_max);
    const double most = highest_slope_walk(f), least = smaller(larger(s->slope_walk_min, smaller(sqrt(f->roaming), MOST)), most);
    f->slope_walk = adapted(f->slope_walk, s->omega_walk_rate, n->sum[1], n->sum_variance[1], least, most);
    for (int i = 0; i < 2; i++) {
        n->sum[i] *= FADED;
        n->sum_variance[i] *= FADED * FADED;
    }
}

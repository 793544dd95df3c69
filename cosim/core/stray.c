/* The force of a sample is computed from estimates that are off by e, with the covariance P. It turns the pattern by b e more than it should, and the
   estimates follow the motion that it makes. So what the pattern has strayed by, s, has beside e the covariance g = E s e' and grows by

       s+ = s + b e,   E s^2+ = E s^2 + 2 b g + b P b',   g+ = g + P b'

   Between samples g goes with e: g = F g, and where a sample corrects e it corrects g (covariance.c, correction.c). */

#include "stray.h"

/* How the angle phi of the pattern, an oscillator of angular frequency w, answers to x, x', y, y': phi = atan2(S, C)/2,
   S = 2 (w^2 x y + x' y'), C = w^2 (x^2 - y^2) + x'^2 - y'^2. */
static void angle_by_state(const double s[4], double omega_squared, double by[4])
{
    const double x = s[0], u = s[1], y = s[2], v = s[3];
    const double S = 2.0 * (omega_squared * x * y + u * v), C = omega_squared * (x * x - y * y) + u * u - v * v, size = S * S + C * C;
    const double scale = size > 0.0 ? 1.0 / size : 0.0;
    by[0] = scale * omega_squared * (C * y - S * x);
    by[1] = scale * (C * v - S * u);
    by[2] = scale * omega_squared * (C * x + S * y);
    by[3] = scale * (C * u + S * v);
}

/* How what the pattern turns by over the period answers to the estimates, by [NZ]. That a delay lies between is left out: the motion and its error go on
   together until then. */
static void turn_by_estimates(const foucault *c, const double *z, const double forced[4], double by[NZ])
{
    const double w = c->omega, cosine = c->turn.cosine, sine = c->turn.sine;
    double end[4], by_end[4], by_force[2] = {0.0, 0.0};
    for (int i = 0; i < 4; i += 2) {
        const double q = z[i] - forced[i], q_dot = z[i + 1] - forced[i + 1];
        end[i] = cosine * q + sine * q_dot / w;
        end[i + 1] = cosine * q_dot - w * sine * q;
    }
    angle_by_state(end, w * w, by_end);
    for (int j = 0; j < 4; j++) {
        by_force[0] += by_end[j] * c->loop.gamma[2 * j];
        by_force[1] += by_end[j] * c->loop.gamma[2 * j + 1];
    }
    memset(by, 0, NZ * sizeof *by);
    for (int j = 0; j < 4; j++) {
        by[j] = by_force[0] * c->loop.gain[j] + by_force[1] * c->loop.gain[4 + j];
        by[OMEGA] += by_force[0] * c->by_omega[j] * z[j] + by_force[1] * c->by_omega[4 + j] * z[j];
    }
}

void stray_by_force(filter *f, const foucault *c, const double forced[4])
{
    moving *n = &f->now;
    double by[NZ], Pb[NZ], more = 0.0;
    if (!c->formed) {
        return;
    }
    turn_by_estimates(c, n->z, forced, by);
    for (int i = 0; i < NZ; i++) {
        Pb[i] = 0.0;
        for (int j = 0; j < NZ; j++) {
            Pb[i] += n->P[i][j] * by[j];
        }
        more += by[i] * (2.0 * n->stray[i] + Pb[i]);
    }
    /* What has lost its numbers begins anew; the sum goes on. */
    f->strayed += isfinite(more) ? more : 0.0;
    for (int i = 0; i < NZ; i++) {
        n->stray[i] += Pb[i];
    }
}

/* The motion over one sample period. An integrator of low order at the sample period would bias the stiffness by many times its bound, so the
   linear part is moved by its exponential and only what is left is integrated. */

#include "motion.h"

#include "known_model.h"

#define NEAR 0.21132486540518713 /* (1 - 1/sqrt 3)/2 */

static void multiply(const double *a, const double *b, int n, int columns, double *out)
{
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < columns; j++) {
            double total = 0.0;
            for (int r = 0; r < n; r++) {
                total += a[i * n + r] * b[r * columns + j];
            }
            out[i * columns + j] = total;
        }
    }
}

void transition_over(const double *a, const double *b, int n, double duration, double *phi, double *gamma)
{
    enum { ORDER_MAX = 60 };
    double term[NS * NS], next[NS * NS], integral[NS * NS];
    memset(term, 0, sizeof term);
    for (int i = 0; i < n; i++) {
        term[i * n + i] = 1.0;
    }
    for (int i = 0; i < n * n; i++) {
        phi[i] = term[i];
        integral[i] = duration * term[i];
    }
    /* Taylor terms; they end where none reaches the rounding of its sum. */
    int small = 0;
    for (int order = 1; order < ORDER_MAX && !small; order++) {
        multiply(a, term, n, n, next);
        small = 1;
        for (int i = 0; i < n * n; i++) {
            term[i] = next[i] * duration / order;
            phi[i] += term[i];
            integral[i] += term[i] * duration / (order + 1);
            small &= fabs(term[i]) <= 1e-17 * fabs(phi[i]);
        }
    }
    multiply(integral, b, n, 2, gamma);
}

static void form(transition *out, const double *a, const double *turning, const double *b, double duration, double probe)
{
    transition_over(a, b, NS, duration, out->phi, out->gamma);
    transition_over(turning, b, NS, duration, out->phi_by_omega, out->gamma_by_omega);
    for (int i = 0; i < NS * NS; i++) {
        out->phi_by_omega[i] = (out->phi_by_omega[i] - out->phi[i]) / probe;
    }
    for (int i = 0; i < NS * 2; i++) {
        out->gamma_by_omega[i] = (out->gamma_by_omega[i] - out->gamma[i]) / probe;
    }
}

/* The polynomial of fifth degree on 0 <= x <= 1 that is one of v, v', v'' at x = 0 (first three) or x = 1 (last three), by powers of x. */
static const double HERMITE[6][6] = {
    {1.0, 0.0, 0.0, -10.0, 15.0, -6.0},  {0.0, 1.0, 0.0, -6.0, 8.0, -3.0}, {0.0, 0.0, 0.5, -1.5, 1.5, -0.5},
    {0.0, 0.0, 0.0, 10.0, -15.0, 6.0},   {0.0, 0.0, 0.0, -4.0, 7.0, -3.0}, {0.0, 0.0, 0.0, 0.5, -1.0, 0.5},
};

/* Integral of exp(-(1 - x)/a) x^n / a over 0 <= x <= 1 for n = 0..5: what the lag makes of a power, a being tau over the duration. */
static void lag_powers(double a, double out[6])
{
    if (a > 0.3) {
        /* Gauss and Legendre's rule of 8 points: 1/a <= 3.4, the remainder is below 1e-16. */
        static const double node[4] = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267, 0.9602898564975363};
        static const double weight[4] = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745, 0.1012285362903763};
        memset(out, 0, 6 * sizeof *out);
        for (int i = 0; i < 8; i++) {
            const double x = 0.5 * (1.0 + (i < 4 ? node[i] : -node[i - 4])), w = 0.5 * weight[i % 4] * exp((x - 1.0) / a) / a;
            double power = w;
            for (int n = 0; n < 6; n++) {
                out[n] += power;
                power *= x;
            }
        }
    } else {
        /* By parts: I_n = 1 - n a I_(n-1); for a lag of none, or below zero while an estimate is, what has decayed is left out. */
        out[0] = a > 0.0 ? -expm1(-1.0 / a) : 1.0;
        for (int n = 1; n < 6; n++) {
            out[n] = 1.0 - n * a * out[n - 1];
        }
    }
}

static void form_weights(double tau, double duration, double *stay, double start[3], double end[3])
{
    double power[6];
    lag_powers(tau / duration, power);
    /* What has decayed that far would only make subnormal numbers. */
    *stay = tau > duration / 60.0 ? exp(-duration / tau) : 0.0;
    for (int i = 0; i < 3; i++) {
        start[i] = end[i] = 0.0;
        for (int n = 0; n < 6; n++) {
            start[i] += HERMITE[i][n] * power[n];
            end[i] += HERMITE[3 + i][n] * power[n];
        }
    }
}

static void form_lag(lagging *l, double tau, double duration)
{
    const double hair = 1e-4 * duration;
    double up[7], down[7];
    form_weights(tau, duration, &l->stay, l->start, l->end);
    form_weights(tau + hair, duration, up, up + 1, up + 4);
    form_weights(tau - hair, duration, down, down + 1, down + 4);
    l->stay_by_tau = (up[0] - down[0]) / (2.0 * hair);
    for (int i = 0; i < 3; i++) {
        l->start_by_tau[i] = (up[1 + i] - down[1 + i]) / (2.0 * hair);
        l->end_by_tau[i] = (up[4 + i] - down[4 + i]) / (2.0 * hair);
    }
}

void motion_form_piece(piece *part, const known *k, double omega_z, double duration)
{
    /* Of a rate of turn; the transition is linear in it to (probe period)^2 = 1e-11. */
    const double probe = 1.0;
    const double rest[NS] = {0}, none[2] = {0.0, 0.0};
    double a[NS * NS], turning[NS * NS], b[NS * 2];
    known_rate_by_state(k, rest, none, omega_z, a);
    known_rate_by_state(k, rest, none, omega_z + probe, turning);
    known_rate_by_force(k, rest, none, omega_z, b);
    part->duration = duration;
    form(&part->whole, a, turning, b, duration, probe);
    form(&part->near, a, turning, b, NEAR * duration, probe);
    form(&part->far, a, turning, b, (1.0 - NEAR) * duration, probe);
}

/* Forms the motion with the delay and lag given [s]. */
static void form_motion(motion *m, const known *k, double omega_z, double period, double delay, double lag)
{
    const double rest[NS] = {0}, none[2] = {0.0, 0.0};
    m->period = period;
    m->omega_z = omega_z;
    known_rate_by_state(k, rest, none, omega_z, m->a);
    known_rate_by_force(k, rest, none, omega_z, m->b);
    m->lag = lag;
    multiply(m->a, m->a, NS, NS, m->by_lag);
    for (int i = 0; i < NS * NS; i++) {
        m->by_lag[i] = m->a[i] - lag * m->by_lag[i];
    }
    m->delay_samples = delay > 0.0 && delay < 1e-2 ? (int64_t)(delay / period) : 0;
    m->delay_rest = delay - (double)m->delay_samples * period;
    m->pieces[0].duration = larger(m->delay_rest, 0.0);
    m->pieces[1].duration = period - m->pieces[0].duration;
    for (int i = 0; i < 2; i++) {
        piece *part = &m->pieces[i];
        if (part->duration > 0.0) {
            motion_form_piece(part, k, omega_z, part->duration);
            if (HAS_LAG) {
                form_lag(&part->lag, m->lag, part->duration);
            }
        }
    }
}

void motion_form(motion *m, const known *k, double omega_z, double period)
{
    const double rest[NS] = {0}, none[2] = {0.0, 0.0};
    double late[2], late_by_p[2 * NP];
    known_late(k, rest, none, omega_z, late);
    known_late_by_parameter(k, rest, none, omega_z, late_by_p);
    memcpy(m->lag_by_p, late_by_p + NP, sizeof m->lag_by_p);
    form_motion(m, k, omega_z, period, HAS_DELAY ? late[0] : 0.0, HAS_LAG ? late[1] : 0.0);
}

void motion_form_held(motion *m, const known *k, double omega_z, double period) { form_motion(m, k, omega_z, period, 0.0, 0.0); }

/* Adds `weight` phi r to `out`. */
static void add_moved(const double *phi, const double *r, double weight, double *out)
{
    for (int i = 0; i < NS; i++) {
        double total = 0.0;
        for (int j = 0; j < NS; j++) {
            total += phi[i * NS + j] * r[j];
        }
        out[i] += weight * total;
    }
}

static void turn_transition(const transition *t, double turn, double phi[NS * NS], double gamma[NS * 2])
{
    for (int i = 0; i < NS * NS; i++) {
        phi[i] = t->phi[i] + turn * t->phi_by_omega[i];
    }
    for (int i = 0; i < NS * 2; i++) {
        gamma[i] = t->gamma[i] + turn * t->gamma_by_omega[i];
    }
}

/* s = phi start + gamma force. */
static void reach(const double *phi, const double *gamma, const double *start, const double force[2], double *s)
{
    for (int i = 0; i < NS; i++) {
        s[i] = gamma[2 * i] * force[0] + gamma[2 * i + 1] * force[1];
    }
    add_moved(phi, start, 1.0, s);
}

/* Adds to the state at a node what `rest` at it has moved it by until then, over the time t. */
static void lead_to(const double *phi, const double *rest, double t, double *s)
{
    for (int i = 0; i < NS; i++) {
        s[i] += 0.5 * t * rest[i];
    }
    add_moved(phi, rest, 0.5 * t, s);
}

void motion_move(const piece *part, const known *k, double turn, double omega_z, const double force[2], const double *start, passage *way)
{
    const double h = part->duration;
    double near_force[NS * 2], far_force[NS * 2];
    turn_transition(&part->whole, turn, way->whole, way->force);
    turn_transition(&part->near, turn, way->near, near_force);
    turn_transition(&part->far, turn, way->far, far_force);
    memcpy(way->start, start, sizeof way->start);
    reach(way->near, near_force, start, force, way->s[0]);
    reach(way->far, far_force, start, force, way->s[1]);
    reach(way->whole, way->force, start, force, way->end);
    if (BENT) {
        /* It is small, so that its own effect on the states at the nodes counts to first order. */
        const double none[2] = {0.0, 0.0};
        double rest[NS];
        known_bend(k, way->s[0], none, omega_z, rest);
        lead_to(way->near, rest, NEAR * h, way->s[0]);
        lead_to(way->far, rest, (1.0 - NEAR) * h, way->s[1]);
        for (int n = 0; n < NODES; n++) {
            known_bend(k, way->s[n], none, omega_z, rest);
            add_moved(passage_from(way, n), rest, 0.5 * h, way->end);
        }
    }
}

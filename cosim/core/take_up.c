#include "take_up.h"

#include <complex.h>

#include "known_model.h"
#include "linear.h"
#include "prediction.h"

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

/* How far the states of effects swing with both axes, whose positions and velocities have the deviations of the design: what is linear of them
   at rest. */
static void follow_swing(const filter *f, double complex swing[NS])
{
    const double rest[NS] = {0}, none[2] = {0.0, 0.0}, size = sqrt(f->first.P[0][0]), pace = sqrt(f->first.P[1][1]) / size;
    double slopes[NS * NS];
    double complex a[NS][NS];
    known_rate_by_state(&f->k, rest, none, 0.0, slopes);
    for (int i = 0; i < MOTION; i++) {
        swing[i] = i % 2 == 0 ? size : I * pace * size;
    }
    /* (i pace - A) s = B swing, by elimination; its diagonal is at least the pace. */
    for (int i = MOTION; i < NS; i++) {
        swing[i] = 0.0;
        for (int j = 0; j < NS; j++) {
            a[i][j] = (i == j ? I * pace : 0.0) - slopes[i * NS + j];
            swing[i] -= j < MOTION ? a[i][j] * swing[j] : 0.0;
        }
        for (int r = MOTION; r < i; r++) {
            const double complex factor = a[i][r] / a[r][r];
            for (int j = r; j < NS; j++) {
                a[i][j] -= factor * a[r][j];
            }
            swing[i] -= factor * swing[r];
        }
    }
    for (int i = NS - 1; i >= MOTION; i--) {
        for (int j = i + 1; j < NS; j++) {
            swing[i] -= a[i][j] * swing[j];
        }
        swing[i] /= a[i][i];
    }
}

void filter_open_states(filter *f)
{
    double complex swing[NS];
    follow_swing(f, swing);
    for (int i = MOTION; i < NS; i++) {
        for (int j = 0; j < NZ; j++) {
            f->now.P[i][j] = f->now.P[j][i] = 0.0;
        }
        f->now.P[i][i] = creal(swing[i] * conj(swing[i]));
    }
}

/* A voltage l that lags by tau is that of the position l + tau x' - tau^2 x''. Of x' nothing is known but the design's deviation, of x'' that of the
   oscillation, and of tau its own: what x'' does is left open. */
static void open_lag(filter *f)
{
    moving *n = &f->now;
    const double none[2] = {0.0, 0.0}, size = sqrt(f->first.P[0][0]), pace = sqrt(f->first.P[1][1]) / size, tau = f->m.lag;
    double late_by_p[2 * NP], open = 0.0;
    known_late_by_parameter(&f->k, n->z, none, n->z[OMEGA], late_by_p);
    for (int i = 0; i < NP; i++) {
        open = hypot(open, late_by_p[NP + i] * f->prior[i]);
    }
    const double most = fabs(tau) + open, bent = most * most * pace * pace * size;
    for (int q = 0; q < MOTION; q += 2) {
        const int v = q + 1;
        n->P[q][q] += tau * tau * n->P[v][v] + bent * bent;
        n->P[q][v] = n->P[v][q] = tau * n->P[v][v];
        for (int i = 0; i < NP; i++) {
            n->Y[q][i] += n->z[v] * late_by_p[NP + i];
        }
        n->z[q] += tau * n->z[v];
    }
}

void filter_take_up(filter *f, const double v[2])
{
    enum { STEPS = 6 };
    moving *n = &f->now;
    const double none[2] = {0.0, 0.0};
    double l[2] = {v[0], v[1]}, through[4], l_by_p[2 * NW], q[2] = {0.0, 0.0}, by_q[4], by_s[2 * NS], by_p[2 * NW], noise[2], u[2];
    double *z = n->z;
    filter_open_states(f);
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
    solve_pair(through, l_by_p, NW);
    /* The noise of the sample moves the voltages by `root`, and the position by by_q^-1 of it. */
    double root[4] = {sqrt(noise[0]), 0.0, 0.0, sqrt(noise[1])}, spread[NZ][2];
    memset(spread, 0, sizeof spread);
    solve_pair(through, root, 2);
    if (HAS_LAG) {
        for (int a = 0; a < 2; a++) {
            z[LAG + a] = l[a];
            memcpy(spread[LAG + a], root + 2 * a, 2 * sizeof *root);
            for (int q_ = 0; q_ < NP; q_++) {
                n->Y[LAG + a][q_] = -l_by_p[a * NW + q_];
            }
        }
    }
    for (int i = 0; i < 2 * NW; i++) {
        by_p[i] = -l_by_p[i] - by_p[i];
    }
    solve_pair(by_q, by_p, NW);
    solve_pair(by_q, root, 2);
    for (int a = 0; a < 2; a++) {
        memcpy(n->Y[2 * a], by_p + a * NW, NW * sizeof *by_p);
        memcpy(spread[2 * a], root + 2 * a, 2 * sizeof *root);
    }
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < NZ; j++) {
            if (spread[i][0] != 0.0 || spread[i][1] != 0.0) {
                n->P[i][j] = n->P[j][i] = spread[i][0] * spread[j][0] + spread[i][1] * spread[j][1];
            }
        }
    }
    if (HAS_LAG) {
        open_lag(f);
    }
}

void filter_take_up_told(filter *f)
{
    const double *z = f->now.z, x = z[0], y = z[2];
    const double none[3 * POINTS] = {0.0};
    double u[2], l[2], s_at[NS * POINTS], u_at[2 * POINTS], jet[(6 + 6 * NS) * POINTS], by_p[2 * NP * POINTS] = {0.0}, v[2];
    const double tau = HAS_LAG ? f->m.lag : 0.0;
    known_actuate(&f->k, z, filter_command(f, 0), z[OMEGA], u);
    for (int i = 0; i < POINTS; i++) {
        put_point(s_at, NS, i, z);
        put_point(u_at, 2, i, u);
    }
    known_jet(&f->k, s_at, u_at, z[OMEGA], none, jet, by_p);
    for (int a = 0; a < 2; a++) {
        l[a] = jet[a * POINTS] - tau * jet[(2 + a) * POINTS] + tau * tau * jet[(4 + a) * POINTS];
    }
    known_amplify(&f->k, z, l, z[OMEGA], v);
    filter_take_up(f, v);
    f->now.z[0] = x;
    f->now.z[2] = y;
}

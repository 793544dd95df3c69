#include "linear.h"

#include <complex.h>

#include "known_model.h"

#define ENTRIES (sizeof(linear) / sizeof(double))

void linear_of(const known *k, linear *at, linear by[NP])
{
    const double rest[NS] = {0}, none[2] = {0.0, 0.0};
    double out[ENTRIES * (1 + NP)];
    known_seen(k, rest, none, 0.0, out);
    memcpy(at, out, sizeof *at);
    for (int q = 0; q < NP; q++) {
        double column[ENTRIES];
        for (size_t i = 0; i < ENTRIES; i++) {
            column[i] = out[ENTRIES + i * NP + (size_t)q];
        }
        memcpy(&by[q], column, sizeof *by);
    }
}

/* out = a b, all 2 x 2. */
static void times(const double complex a[4], const double complex b[4], double complex out[4])
{
    for (int i = 0; i < 4; i++) {
        out[i] = a[i / 2 * 2] * b[i % 2] + a[i / 2 * 2 + 1] * b[2 + i % 2];
    }
}

static void invert(const double complex a[4], double complex out[4])
{
    const double complex det = a[0] * a[3] - a[1] * a[2];
    out[0] = a[3] / det;
    out[1] = -a[1] / det;
    out[2] = -a[2] / det;
    out[3] = a[0] / det;
}

static void widen(const double a[4], double complex out[4])
{
    for (int i = 0; i < 4; i++) {
        out[i] = a[i];
    }
}

/* With s = i w the command is exp(s delay) (1 + s lag) F^-1, F = c (s^2 + s delta + kappa)^-1 b + d. */
void linear_command(const linear *l, const linear by_all[NP], double w, double seen[8], double by_p[8][NP])
{
    const double complex s = I * w, late = cexp(s * l->delay) * (1.0 + s * l->lag);
    double complex c[4], b[4], z[4], answers[4], from[4], to[4], f[4], f_inverse[4], g[4];
    widen(l->c, c);
    widen(l->b, b);
    for (int i = 0; i < 4; i++) {
        z[i] = s * l->delta[i] + l->kappa[i] + (i % 3 == 0 ? s * s : 0.0);
    }
    invert(z, answers);
    times(c, answers, to);
    times(answers, b, from);
    times(to, b, f);
    for (int i = 0; i < 4; i++) {
        f[i] += l->d[i];
    }
    invert(f, f_inverse);
    for (int i = 0; i < 4; i++) {
        g[i] = late * f_inverse[i];
        seen[i] = creal(g[i]);
        seen[4 + i] = cimag(g[i]);
    }
    for (int q = 0; q < NP; q++) {
        const linear *by = &by_all[q];
        double complex part[4], sum[4], df[4], half[4], dg[4];
        widen(by->c, part);
        times(part, from, df);
        for (int i = 0; i < 4; i++) {
            part[i] = s * by->delta[i] + by->kappa[i];
        }
        times(to, part, half);
        times(half, from, sum);
        widen(by->b, part);
        times(to, part, half);
        for (int i = 0; i < 4; i++) {
            df[i] += half[i] - sum[i] + by->d[i];
        }
        times(f_inverse, df, half);
        times(half, f_inverse, dg);
        for (int i = 0; i < 4; i++) {
            const double complex slope = (s * by->delay + s * by->lag / (1.0 + s * l->lag)) * g[i] - late * dg[i];
            by_p[i][q] = creal(slope);
            by_p[4 + i][q] = cimag(slope);
        }
    }
}

/* A w + B u. */
static void move(const linear *l, const double w[MOTION], const double u[2], double out[MOTION])
{
    for (int a = 0; a < 2; a++) {
        out[2 * a + 1] = 0.0;
        for (int b = 0; b < 2; b++) {
            const int i = 2 * a + b;
            out[2 * a + 1] += l->b[i] * u[b] - l->kappa[i] * w[2 * b] - l->delta[i] * w[2 * b + 1];
        }
        out[2 * a] = w[2 * a + 1];
    }
}

/* (c, c) w, positions and velocities alike. */
static void read_motion(const double c[4], const double w[MOTION], double out[MOTION])
{
    for (int i = 0; i < MOTION; i++) {
        out[i] = c[i / 2 * 2] * w[i % 2] + c[i / 2 * 2 + 1] * w[2 + i % 2];
    }
}

static void multiply(const double A[MOTION][MOTION], const double x[MOTION], double out[MOTION])
{
    for (int i = 0; i < MOTION; i++) {
        out[i] = 0.0;
        for (int j = 0; j < MOTION; j++) {
            out[i] += A[i][j] * x[j];
        }
    }
}

/* One step of Horner's rule for the sum of (-A)^i (0, m moments[i]): out = (0, m moment) - A out, m [2 * 2] making accelerations of commands. */
static void add_moment(const linear *l, const double m[4], const double moment[2], double out[MOTION])
{
    const double none[2] = {0.0, 0.0};
    double moved[MOTION];
    move(l, out, none, moved);
    for (int a = 0; a < 2; a++) {
        out[2 * a] = -moved[2 * a];
        out[2 * a + 1] = m[2 * a] * moment[0] + m[2 * a + 1] * moment[1] - moved[2 * a + 1];
    }
}

/* What commands under way add to the motion as it is now. */
static void sum_moments(const linear *l, const double moments[2 * MOMENTS], double out[MOTION])
{
    memset(out, 0, MOTION * sizeof *out);
    for (int i = MOMENTS - 1; i >= 0; i--) {
        add_moment(l, l->b, moments + 2 * i, out);
    }
}

/* What they add by a constant that changes the device by `by`, but not its delay. */
static void sum_slopes(const linear *l, const linear *by, const double moments[2 * MOMENTS], double slope[MOTION])
{
    const double none[2] = {0.0, 0.0};
    double out[MOTION] = {0.0};
    memset(slope, 0, MOTION * sizeof *slope);
    for (int i = MOMENTS - 1; i >= 0; i--) {
        double bent[MOTION];
        move(by, out, none, bent);
        add_moment(l, by->b, moments + 2 * i, slope);
        slope[1] -= bent[1];
        slope[3] -= bent[3];
        add_moment(l, l->b, moments + 2 * i, out);
    }
}

/* Adds sign u t^i/i! to out [2 * MOMENTS], i from `first` on. */
static void add_powers(double *out, const double u[2], double sign, double t, int first)
{
    double power = first == 0 ? sign : sign * t;
    for (int i = 0; i < MOMENTS; i++) {
        out[2 * i] += power * u[0];
        out[2 * i + 1] += power * u[1];
        power *= t / (i + 1 + first);
    }
}

void sight_form(sight *s, const linear *at, const double *commands, int count, double rest, double period)
{
    const double none[2] = {0.0, 0.0};
    double matrix[MOTION][MOTION];
    s->at = at;
    memset(s->moments, 0, sizeof s->moments);
    memset(s->by_delay, 0, sizeof s->by_delay);
    for (int i = 0; i < count; i++) {
        const double *u = commands + 2 * i, to = rest + (count - 1 - i) * period, from = i < count - 1 ? to - period : 0.0;
        add_powers(s->by_delay, u, 1.0, to, 0);
        add_powers(s->moments, u, 1.0, to, 1);
        if (i < count - 1) {
            add_powers(s->by_delay, u, -1.0, from, 0);
            add_powers(s->moments, u, -1.0, from, 1);
        }
    }
    for (int j = 0; j < MOTION; j++) {
        double unit[MOTION] = {0.0}, column[MOTION];
        unit[j] = 1.0;
        move(at, unit, none, column);
        for (int i = 0; i < MOTION; i++) {
            matrix[i][j] = s->before[i][j] = unit[i] + at->lag * column[i];
            s->lagged[i][j] = i == j ? 1.0 : 0.0;
        }
    }
    /* By elimination; the lag is short, 1 + lag A near 1. */
    for (int k = 0; k < MOTION; k++) {
        const double own = matrix[k][k];
        for (int j = 0; j < MOTION; j++) {
            matrix[k][j] /= own;
            s->lagged[k][j] /= own;
        }
        for (int i = 0; i < MOTION; i++) {
            const double factor = i == k ? 0.0 : matrix[i][k];
            for (int j = 0; j < MOTION; j++) {
                matrix[i][j] -= factor * matrix[k][j];
                s->lagged[i][j] -= factor * s->lagged[k][j];
            }
        }
    }
}

void sight_see(const sight *s, const linear by[NP], const double z[MOTION], double y[MOTION], double by_p[MOTION][NP])
{
    const linear *l = s->at;
    const double none[2] = {0.0, 0.0};
    double all[MOTION], w[MOTION], pace[MOTION], later[MOTION];
    sum_moments(l, s->moments, all);
    sum_moments(l, s->by_delay, later);
    for (int i = 0; i < MOTION; i++) {
        all[i] += z[i];
    }
    multiply(s->lagged, all, w);
    move(l, w, none, pace);
    read_motion(l->c, w, y);
    for (int q = 0; q < NP; q++) {
        double moved[MOTION], slope[MOTION], late[MOTION], bent[MOTION], out[MOTION];
        move(&by[q], w, none, moved);
        moved[0] = moved[2] = 0.0; /* that a position moves with its velocity depends on no constant */
        sum_slopes(l, &by[q], s->moments, slope);
        for (int i = 0; i < MOTION; i++) {
            slope[i] += by[q].delay * later[i] - by[q].lag * pace[i] - l->lag * moved[i];
        }
        multiply(s->lagged, slope, late);
        read_motion(l->c, late, bent);
        read_motion(by[q].c, w, out);
        for (int i = 0; i < MOTION; i++) {
            by_p[i][q] = out[i] + bent[i];
        }
    }
}

void sight_change(const sight *s, const double change[MOTION], double y[MOTION])
{
    double w[MOTION];
    multiply(s->lagged, change, w);
    read_motion(s->at->c, w, y);
}

void sight_change_back(const sight *s, const double y[MOTION], double change[MOTION])
{
    const double *c = s->at->c, det = c[0] * c[3] - c[1] * c[2], back[4] = {c[3] / det, -c[1] / det, -c[2] / det, c[0] / det};
    double w[MOTION];
    read_motion(back, y, w);
    multiply(s->before, w, change);
}

void sight_back(const sight *s, const double y[MOTION], double z[MOTION])
{
    double under_way[MOTION];
    sum_moments(s->at, s->moments, under_way);
    sight_change_back(s, y, z);
    for (int i = 0; i < MOTION; i++) {
        z[i] -= under_way[i];
    }
}

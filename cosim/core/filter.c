#include "filter.h"

#include "known_model.h"

#define OUTLIER 15.0 /* squared innovation over its fast variance from which the full one is worth working out */
#define ROUNDS 8     /* filterings of a block at most */
#define MOVED 0.3    /* change of p in its new standard deviations, all together, that is worth another one */
#define FITS 2.0     /* mean squared innovation of a start that has found the device; before that every sample may surprise */
#define FORGET_MIN 0.1 /* where forgetting begins [1/s] */
#define LOST 1e4     /* mean squared innovation of a whole start that has found nothing */
#define FIRST 16     /* samples of the first block at its first fit */

#define TURN 1.0     /* change of the rate from which the motion is formed anew [rad/s] */

#define INPUT 1e-3   /* relative change of temperature or bias voltage from which it is, too */

static void form(filter *f)
{
    motion_form(&f->m, &f->k, f->now.z[OMEGA], f->m.period);
    memcpy(f->formed_in, f->k.in, sizeof f->formed_in);
}

/* Whether an input that laws act on has left the one at which the motion was formed; an acceleration only adds a force. */
static int input_has_changed(const filter *f)
{
    static const int laws[] = {0, 3, 4, 5};
    int changed = 0;
    for (size_t i = 0; i < sizeof laws / sizeof *laws; i++) {
        const double formed = f->formed_in[laws[i]];
        changed |= fabs(f->k.in[laws[i]] - formed) > INPUT * fabs(formed);
    }
    return changed;
}

static const double *command(const filter *f, int64_t sample) { return f->u[(sample > 0 ? sample : 0) & (QUEUE - 1)]; }

/* The forces at the mass in the period that ends at `sample`: until the delayed change and after it, with derivatives by p. */
static void forces(const filter *f, int64_t sample, double before[2], double after[2], double *before_by_p, double *after_by_p)
{
    const int64_t newest = sample - 1 - f->m.delay_samples;
    const double *z = f->now.z;
    known_actuate(&f->k, z, command(f, newest), z[OMEGA], after);
    known_actuate_by_parameter(&f->k, z, command(f, newest), z[OMEGA], after_by_p);
    if (HAS_DELAY) {
        known_actuate(&f->k, z, command(f, newest - 1), z[OMEGA], before);
        known_actuate_by_parameter(&f->k, z, command(f, newest - 1), z[OMEGA], before_by_p);
    } else {
        memcpy(before, after, 2 * sizeof *before);
        memcpy(before_by_p, after_by_p, 2 * NP * sizeof *before_by_p);
    }
}

/* Adds phi g to `out`, both NS rows of NP. */
static void add_through(const double *phi, double g[NS][NP], double weight, double out[NS][NP])
{
    for (int i = 0; i < NS; i++) {
        for (int j = 0; j < NS; j++) {
            const double through = weight * phi[i * NS + j];
            for (int q = 0; q < NP; q++) {
                out[i][q] += through * g[j][q];
            }
        }
    }
}

/* What a piece did: the derivatives of the states at its end by those at its start (phi), the rate (psi) and p (D). */
typedef struct {
    double phi[NS][NS], psi[NS], D[NS][NP];
} slopes;

static void find_slopes(const filter *f, double T, const passage *way, double omega_z, slopes *d)
{
    const double none[2] = {0.0, 0.0};
    const double *at[3] = {way->start, way->middle, way->end};
    double g[3][NS][NP], w[3][NS];
    memset(d, 0, sizeof *d);
    for (int i = 0; i < 3; i++) {
        known_rate_by_parameter(&f->k, at[i], none, omega_z, &g[i][0][0]);
        known_rate_by_omega(&f->k, at[i], none, omega_z, w[i]);
    }
    add_through(way->whole, g[0], T / 6.0, d->D);
    add_through(way->half, g[1], T * 4.0 / 6.0, d->D);
    for (int i = 0; i < NS; i++) {
        d->psi[i] = T / 6.0 * w[2][i];
        for (int q = 0; q < NP; q++) {
            d->D[i][q] += T / 6.0 * g[2][i][q];
        }
        for (int j = 0; j < NS; j++) {
            d->psi[i] += T / 6.0 * (way->whole[i * NS + j] * w[0][j] + 4.0 * way->half[i * NS + j] * w[1][j]);
            d->phi[i][j] = way->whole[i * NS + j];
        }
    }
    if (BENT) {
        /* To first order in the bend: T/6 (phi B0 + 4 phi_half B1 phi_half + B2 phi). */
        double bent[3][NS * NS], through[NS * NS];
        for (int i = 0; i < 3; i++) {
            known_bend_by_state(&f->k, at[i], none, omega_z, bent[i]);
        }
        for (int i = 0; i < NS; i++) {
            for (int j = 0; j < NS; j++) {
                double total = 0.0;
                for (int r = 0; r < NS; r++) {
                    total += bent[1][i * NS + r] * way->half[r * NS + j];
                }
                through[i * NS + j] = total;
            }
        }
        for (int i = 0; i < NS; i++) {
            for (int j = 0; j < NS; j++) {
                double total = 0.0;
                for (int r = 0; r < NS; r++) {
                    total += way->whole[i * NS + r] * bent[0][r * NS + j] + 4.0 * way->half[i * NS + r] * through[r * NS + j] +
                             bent[2][i * NS + r] * way->whole[r * NS + j];
                }
                d->phi[i][j] += T / 6.0 * total;
            }
        }
    }
}

/* Derivatives of the voltage at `s` by p, those by way of the force included. */
static void pick_off_by_p(const filter *f, const double *s, const double force[2], const double *force_by_p, double out[2 * NP])
{
    double by_force[4];
    known_pick_off_by_parameter(&f->k, s, force, f->now.z[OMEGA], out);
    known_pick_off_by_force(&f->k, s, force, f->now.z[OMEGA], by_force);
    for (int a = 0; a < 2; a++) {
        for (int q = 0; q < NP; q++) {
            out[a * NP + q] += by_force[2 * a] * force_by_p[q] + by_force[2 * a + 1] * force_by_p[NP + q];
        }
    }
}

/* The voltage that enters the lag, its slope and its curvature at `s`, scaled by the duration h: [3][2], and their derivatives. */
typedef struct {
    double v[3][2], by_state[3][2 * NS], by_p[3][2 * NP];
} entering;

static void find_entering(const filter *f, const double *s, const double force[2], const double *force_by_p, double h, entering *e)
{
    const known *k = &f->k;
    const double omega_z = f->now.z[OMEGA], scale[3] = {1.0, h, h * h};
    known_pick_off(k, s, force, omega_z, e->v[0]);
    known_pick_off_rate(k, s, force, omega_z, e->v[1]);
    known_pick_off_curve(k, s, force, omega_z, e->v[2]);
    known_pick_off_by_state(k, s, force, omega_z, e->by_state[0]);
    known_pick_off_rate_by_state(k, s, force, omega_z, e->by_state[1]);
    known_pick_off_curve_by_state(k, s, force, omega_z, e->by_state[2]);
    pick_off_by_p(f, s, force, force_by_p, e->by_p[0]);
    known_pick_off_rate_by_parameter(k, s, force, omega_z, e->by_p[1]);
    known_pick_off_curve_by_parameter(k, s, force, omega_z, e->by_p[2]);
    for (int i = 1; i < 3; i++) {
        for (int a = 0; a < 2; a++) {
            e->v[i][a] *= scale[i];
        }
        for (int j = 0; j < 2 * NS; j++) {
            e->by_state[i][j] *= scale[i];
        }
        for (int q = 0; q < 2 * NP; q++) {
            e->by_p[i][q] *= scale[i];
        }
    }
}

/* Moves the lagging voltages through a piece, with their rows of Y and of F; `from` are the rows of Y of the states at its start. */
static void move_lag(filter *f, const piece *part, const passage *way, const double force[2], const double *force_by_p, const double *tau_by_p,
                     double from[NS][NP], double F[NZ][NZ])
{
    moving *n = &f->now;
    const lagging *w = &part->lag;
    entering start, end;
    find_entering(f, way->start, force, force_by_p, part->duration, &start);
    find_entering(f, way->end, force, force_by_p, part->duration, &end);
    for (int a = 0; a < 2; a++) {
        const int row = LAG + a;
        double value = w->stay * n->z[row], by_tau = w->stay_by_tau * n->z[row];
        double *Y = n->Y[row];
        F[row][row] = w->stay;
        for (int q = 0; q < NP; q++) {
            Y[q] *= w->stay;
        }
        for (int i = 0; i < 3; i++) {
            value += w->start[i] * start.v[i][a] + w->end[i] * end.v[i][a];
            by_tau += w->start_by_tau[i] * start.v[i][a] + w->end_by_tau[i] * end.v[i][a];
            for (int q = 0; q < NP; q++) {
                Y[q] += w->start[i] * start.by_p[i][a * NP + q] + w->end[i] * end.by_p[i][a * NP + q];
            }
        }
        n->z[row] = value;
        for (int q = 0; q < NP; q++) {
            Y[q] += by_tau * tau_by_p[q];
        }
        for (int j = 0; j < NS; j++) {
            double M0 = 0.0, M1 = 0.0;
            for (int i = 0; i < 3; i++) {
                M0 += w->start[i] * start.by_state[i][a * NS + j];
                M1 += w->end[i] * end.by_state[i][a * NS + j];
            }
            F[row][j] += M0;
            for (int r = 0; r < NS + 1; r++) {
                F[row][r] += M1 * F[j][r];
            }
            for (int q = 0; q < NP; q++) {
                Y[q] += M0 * from[j][q] + M1 * n->Y[j][q];
            }
        }
    }
}

/* P becomes F P F' and the noise of the motion. */
static void predict_covariance(filter *f, double F[NZ][NZ], const passage *way)
{
    moving *n = &f->now;
    const double none[2] = {0.0, 0.0}, *g = way->force;
    double FP[NZ][NZ], thermal[4];
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < NZ; j++) {
            double total = 0.0;
            for (int r = 0; r < NZ; r++) {
                total += F[i][r] * n->P[r][j];
            }
            FP[i][j] = total;
        }
    }
    for (int i = 0; i < NZ; i++) {
        for (int j = i; j < NZ; j++) {
            double total = 0.0;
            for (int r = 0; r < NZ; r++) {
                total += FP[i][r] * F[j][r];
            }
            n->P[i][j] = n->P[j][i] = total;
        }
    }
    n->P[OMEGA][OMEGA] += f->walk * f->walk * f->m.period;
    if (HAS_THERMAL) {
        known_thermal(&f->k, way->end, none, n->z[OMEGA], thermal);
        for (int i = 0; i < NS; i++) {
            for (int j = 0; j < NS; j++) {
                n->P[i][j] += g[i * 2] * (thermal[0] * g[j * 2] + thermal[1] * g[j * 2 + 1]) +
                              g[i * 2 + 1] * (thermal[2] * g[j * 2] + thermal[3] * g[j * 2 + 1]);
            }
        }
    }
}

/* Moves z and Y through a piece; F becomes the piece's derivative by z. */
static void move_through(filter *f, const piece *part, const double force[2], const double *force_by_p, const double *tau_by_p, double F[NZ][NZ],
                         passage *way)
{
    moving *n = &f->now;
    const double omega_z = n->z[OMEGA], mass = 1.0 / f->k.p[INVERSE_MASS];
    double from[NS][NP];
    slopes d;
    motion_move(&f->m, part, &f->k, omega_z, force, n->z, way);
    find_slopes(f, part->duration, way, omega_z, &d);
    memcpy(from, n->Y, sizeof from);
    memset(F, 0, NZ * sizeof *F);
    F[OMEGA][OMEGA] = 1.0;
    for (int i = 0; i < NS; i++) {
        memcpy(F[i], d.phi[i], sizeof d.phi[i]);
        F[i][OMEGA] = d.psi[i];
        d.D[i][INVERSE_MASS] += mass * (way->force[2 * i] * force[0] + way->force[2 * i + 1] * force[1]);
        for (int q = 0; q < NP; q++) {
            d.D[i][q] += d.psi[i] * n->Y[OMEGA][q] + way->force[2 * i] * force_by_p[q] + way->force[2 * i + 1] * force_by_p[NP + q];
        }
    }
    add_through(&d.phi[0][0], from, 1.0, d.D);
    memcpy(n->z, way->end, sizeof way->end);
    memcpy(n->Y, d.D, sizeof d.D);
    if (HAS_LAG) {
        move_lag(f, part, way, force, force_by_p, tau_by_p, from, F);
    }
}

/* The delayed force changes here: a longer delay puts that off. */
static void change_force(filter *f, const double before[2], const double after[2], const double *delay_by_p)
{
    moving *n = &f->now;
    const motion *m = &f->m;
    const double change[2] = {after[0] - before[0], after[1] - before[1]};
    for (int i = 0; i < NS; i++) {
        const double kick = m->b[2 * i] * change[0] + m->b[2 * i + 1] * change[1];
        for (int q = 0; q < NP; q++) {
            n->Y[i][q] -= kick * delay_by_p[q];
        }
    }
    if (HAS_LAG && m->lag > 0.0) {
        double v_before[2], v_after[2];
        known_pick_off(&f->k, n->z, before, n->z[OMEGA], v_before);
        known_pick_off(&f->k, n->z, after, n->z[OMEGA], v_after);
        for (int a = 0; a < 2; a++) {
            for (int q = 0; q < NP; q++) {
                n->Y[LAG + a][q] += (v_before[a] - v_after[a]) / m->lag * delay_by_p[q];
            }
        }
    }
}

/* Moves z, Y and P over the period that ends at the present sample. */
static void predict(filter *f)
{
    moving *n = &f->now;
    const double none[2] = {0.0, 0.0};
    double before[2], after[2], before_by_p[2 * NP], after_by_p[2 * NP], late_by_p[2 * NP], F[NZ][NZ];
    passage way;
    if (fabs(n->z[OMEGA] - f->m.omega_z) > TURN || input_has_changed(f)) {
        form(f);
    }
    forces(f, f->sample, before, after, before_by_p, after_by_p);
    known_late_by_parameter(&f->k, n->z, none, n->z[OMEGA], late_by_p);
    if (HAS_DELAY) {
        const int split = f->m.pieces[0].duration > 0.0;
        double first[NZ][NZ], second[NZ][NZ];
        if (split) {
            move_through(f, &f->m.pieces[0], before, before_by_p, late_by_p + NP, first, &way);
        }
        change_force(f, before, after, late_by_p);
        move_through(f, &f->m.pieces[1], after, after_by_p, late_by_p + NP, split ? second : F, &way);
        for (int i = 0; split && i < NZ; i++) {
            for (int j = 0; j < NZ; j++) {
                F[i][j] = 0.0;
                for (int r = 0; r < NZ; r++) {
                    F[i][j] += second[i][r] * first[r][j];
                }
            }
        }
    } else {
        move_through(f, &f->m.pieces[1], after, after_by_p, late_by_p + NP, F, &way);
    }
    predict_covariance(f, F, &way);
}

/* What the sample should be, its derivatives by z and by p, and its noise [V2]. */
static void expect(const filter *f, double v[2], double C[2][NZ], double by_p[2 * NP], double noise[2])
{
    const moving *n = &f->now;
    const double *z = n->z;
    double before[2], after[2], unused[2 * NP], after_by_p[2 * NP], entering[2], through[4], rate[2];
    double pick_by_s[2 * NS], pick_by_p[2 * NP];
    forces(f, f->sample, before, after, unused, after_by_p);
    memset(C, 0, 2 * sizeof *C);
    known_pick_off_by_state(&f->k, z, after, z[OMEGA], pick_by_s);
    if (HAS_LAG) {
        entering[0] = z[NZ - 2];
        entering[1] = z[NZ - 1];
    } else {
        known_pick_off(&f->k, z, after, z[OMEGA], entering);
        pick_off_by_p(f, z, after, after_by_p, pick_by_p);
    }
    known_amplify(&f->k, z, entering, z[OMEGA], v);
    known_amplify_by_voltage(&f->k, z, entering, z[OMEGA], through);
    known_amplify_by_parameter(&f->k, z, entering, z[OMEGA], by_p);
    for (int a = 0; a < 2; a++) {
        for (int b = 0; b < 2; b++) {
            if (HAS_LAG) {
                C[a][NZ - 2 + b] = through[2 * a + b];
            } else {
                for (int j = 0; j < NS; j++) {
                    C[a][j] += through[2 * a + b] * pick_by_s[b * NS + j];
                }
                for (int q = 0; q < NP; q++) {
                    by_p[a * NP + q] += through[2 * a + b] * pick_by_p[b * NP + q];
                }
            }
        }
    }
    known_pick_off_rate(&f->k, z, after, z[OMEGA], rate);
    known_noise(&f->k, z, rate, z[OMEGA], noise);
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
    expect(f, expected, C, by_p, noise);
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
    known_actuate(&f->k, z, command(f, 0), z[OMEGA], u);
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
    known_amplify_by_parameter(&f->k, z, l, z[OMEGA], l_by_p);
    known_pick_off_by_parameter(&f->k, z, u, z[OMEGA], by_p);
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

/* J = I + sum of the block's rows in units of W, as its Cholesky factor L; b = sum of row * innovation. Returns the trace of J - I. */
static double information(const filter *f, double L[NP][NP], double b[NP])
{
    double trace = 0.0;
    for (int i = 0; i < NP; i++) {
        b[i] = 0.0;
        for (int j = 0; j < NP; j++) {
            L[i][j] = i == j ? 1.0 : 0.0;
        }
    }
    for (int64_t r = 0; r < f->rows; r++) {
        double g[NP];
        for (int j = 0; j < NP; j++) {
            g[j] = 0.0;
        }
        for (int i = 0; i < NP; i++) {
            const double h = f->H[r][i];
            for (int j = i; j < NP; j++) {
                g[j] += f->W[i][j] * h;
            }
        }
        for (int i = 0; i < NP; i++) {
            b[i] += g[i] * f->r[r];
            for (int j = 0; j <= i; j++) {
                L[i][j] += g[i] * g[j];
            }
        }
    }
    for (int i = 0; i < NP; i++) {
        trace += L[i][i] - 1.0;
    }
    for (int j = 0; j < NP; j++) {
        for (int k = 0; k < j; k++) {
            L[j][j] -= L[j][k] * L[j][k];
        }
        L[j][j] = sqrt(larger(L[j][j], 1.0)); /* J is at least the identity */
        for (int i = j + 1; i < NP; i++) {
            for (int k = 0; k < j; k++) {
                L[i][j] -= L[i][k] * L[j][k];
            }
            L[i][j] /= L[j][j];
        }
    }
    return trace;
}

/* Solves L L' x = b; also gives L^-1 b. */
static void solve(double L[NP][NP], const double b[NP], double x[NP], double half[NP])
{
    for (int i = 0; i < NP; i++) {
        half[i] = b[i];
        for (int k = 0; k < i; k++) {
            half[i] -= L[i][k] * half[k];
        }
        half[i] /= L[i][i];
    }
    for (int i = NP - 1; i >= 0; i--) {
        x[i] = half[i];
        for (int k = i + 1; k < NP; k++) {
            x[i] -= L[k][i] * x[k];
        }
        x[i] /= L[i][i];
    }
}

/* W becomes W L^-T, which is upper triangular again. */
static void shrink(filter *f, double L[NP][NP])
{
    for (int i = 0; i < NP; i++) {
        for (int j = i; j < NP; j++) {
            double value = f->W[i][j];
            for (int k = i; k < j; k++) {
                value -= f->W[i][k] * L[j][k];
            }
            f->W[i][j] = value / L[j][j];
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
    memcpy(f->k.in, in, sizeof f->k.in);
    f->k.t = (double)f->sample * f->m.period;
}

/* Filters the block again from its beginning at the constants as they are now; returns the sum of squared innovations. */
static double filter_again(filter *f)
{
    const int64_t last = f->sample;
    double total = 0.0;
    f->now = f->begun;
    for (int i = 0; i < NZ; i++) {
        for (int q = 0; q < NP; q++) {
            f->now.z[i] += f->begun.Y[i][q] * (f->k.p[q] - f->p_begun[q]);
        }
    }
    f->rows = 0;
    f->sample = f->block_begun;
    enter(f, f->in[0]);
    form(f);
    for (int64_t k = f->block_begun; k <= last; k++) {
        const int64_t place = k - f->block_begun;
        f->sample = k;
        enter(f, f->in[place]);
        if (k > f->origin) {
            predict(f);
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

static void watch(filter *f)
{
    const double pace = smaller(1.0, (double)f->in_block * f->m.period / 0.005);
    double total = 0.0, product[2] = {0.0, 0.0};
    for (int64_t r = 0; r < f->rows; r++) {
        total += f->r[r] * f->r[r];
        product[r & 1] += f->r[r] * f->last_r[r & 1];
        f->last_r[r & 1] = f->r[r];
    }
    f->chi2 += pace * (total / ((double)f->rows * (1.0 + f->share)) - f->chi2);
    for (int a = 0; a < 2; a++) {
        f->white[a] += pace * (product[a] / (0.5 * (double)f->rows * (1.0 + f->share)) - f->white[a]);
    }
}

static double squared(const double x[NP])
{
    double total = 0.0;
    for (int i = 0; i < NP; i++) {
        total += x[i] * x[i];
    }
    return total;
}

/* p = p_begun + W eta; `change` is what that changes. */
static void set_constants(filter *f, const double eta[NP], double change[NP])
{
    for (int i = 0; i < NP; i++) {
        double p = f->p_begun[i];
        for (int j = i; j < NP; j++) {
            p += f->W[i][j] * eta[j];
        }
        change[i] = p - f->k.p[i];
        f->k.p[i] = p;
    }
}

/* Keeps p = p_begun + W eta at its lowest values: where eta lies below one, it goes to the most likely point on that bound, given the Hessian
   L L'. A few passes, since two bounds may pull at each other. */
static void keep_in_bounds(const filter *f, double L[NP][NP], double eta[NP])
{
    for (int pass = 0; pass < 4; pass++) {
        for (int i = 0; i < NP; i++) {
            double p = f->p_begun[i];
            for (int j = i; j < NP; j++) {
                p += f->W[i][j] * eta[j];
            }
            if (p < f->lowest[i]) {
                double w[NP], along[NP], half[NP], size = 0.0;
                for (int j = 0; j < NP; j++) {
                    w[j] = j >= i ? f->W[i][j] : 0.0;
                }
                solve(L, w, along, half);
                for (int j = 0; j < NP; j++) {
                    size += w[j] * along[j];
                }
                for (int j = 0; j < NP; j++) {
                    eta[j] += along[j] * (f->lowest[i] - p) / size;
                }
            }
        }
    }
}

/* |L' (a - b)|: how far a is from b in standard deviations. */
static double distance(double L[NP][NP], const double a[NP], const double b[NP])
{
    double total = 0.0;
    for (int j = 0; j < NP; j++) {
        double sum = 0.0;
        for (int i = j; i < NP; i++) {
            sum += L[i][j] * (a[i] - b[i]);
        }
        total += sum * sum;
    }
    return sqrt(total);
}

/* Finds the constants that the block and what was known before it make most likely, filtering it again up to `rounds` times: Gauss-Newton on
   |eta|^2 + |r(eta)|^2, with p = p_begun + W eta. Leaves the Cholesky factor of its Hessian in L. */
static void find_constants(filter *f, int rounds, double L[NP][NP])
{
    double b[NP], step[NP], half[NP], change[NP], eta[NP], trial[NP];
    memcpy(eta, f->eta, sizeof eta);
    double trace = information(f, L, b), cost = squared(eta);
    f->expected = trace;
    for (int64_t r = 0; r < f->rows; r++) {
        cost += f->r[r] * f->r[r];
    }
    for (int round = 0;; round++) {
        for (int i = 0; i < NP; i++) {
            b[i] -= eta[i];
        }
        solve(L, b, step, half);
        if (round == 0) {
            f->found = squared(half);
        }
        double part = 1.0;
        for (int i = 0; i < NP; i++) {
            trial[i] = eta[i] + step[i];
        }
        keep_in_bounds(f, L, trial);
        const double moved = distance(L, trial, eta);
        for (int i = 0; i < NP; i++) {
            step[i] = trial[i] - eta[i];
        }
        set_constants(f, trial, change);
        if (round >= rounds || moved < MOVED) {
            break;
        }
        double next = squared(trial) + filter_again(f);
        while (!(next < cost * 1.001 + 1.0) && part > 0.01) {
            part *= 0.3;
            for (int i = 0; i < NP; i++) {
                trial[i] = eta[i] + part * step[i];
            }
            set_constants(f, trial, change);
            next = squared(trial) + filter_again(f);
        }
        memcpy(eta, trial, sizeof eta);
        cost = next;
        trace = information(f, L, b);
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

/* Constants that move show in steps that are larger than the block's information explains: for b = L L' step, b' J^-1 b has the mean trace(J - I).
   Where the data say so, forgetting grows; else it dies away, and what is constant is remembered. */
static void adapt_forgetting(filter *f)
{
    const filter_settings *s = &f->settings;
    const double ratio = f->expected > 0.0 ? smaller(f->found / f->expected, 10.0) : 1.0;
    const double excess = ratio - 1.0, noise = sqrt(2.0 / NP);
    f->moving += 0.1 * (excess - f->moving);
    if (f->moving > noise) {
        f->forget = smaller(larger(f->forget, FORGET_MIN) * exp(s->forget_rate * f->moving), s->forget_max);
    } else {
        f->forget *= exp(-s->forget_rate * 0.1);
    }
}

static void fold(filter *f, double L[NP][NP])
{
    shrink(f, L);
    if (!f->growing) {
        adapt_forgetting(f);
    }
    const double grow = 1.0 + f->forget * (double)f->in_block * f->m.period;
    for (int i = 0; i < NP; i++) {
        for (int j = i; j < NP; j++) {
            f->W[i][j] *= grow;
        }
    }
    memcpy(f->W_now, f->W, sizeof f->W_now);
    memmove(f->H, f->H + f->rows, (size_t)f->kept * sizeof *f->H);
    memmove(f->r, f->r + f->rows, (size_t)f->kept * sizeof *f->r);
    f->rows = f->kept;
    f->kept = 0;
    f->growing = 0;
    form(f);
    begin_block(f);
}

/* The block is full: one that grows goes on, any other is folded into the constants, but for the rows of its last samples, in which a jump of
   the rate may be under way that has not surprised yet. */
static void end_block(filter *f)
{
    double L[NP][NP];
    if (f->growing) {
        find_constants(f, ROUNDS, L);
        form(f);
        if (f->in_block < (int64_t)f->settings.start) {
            double known_W[NP][NP];
            memcpy(known_W, f->W, sizeof known_W);
            shrink(f, L);
            memcpy(f->W_now, f->W, sizeof f->W_now);
            memcpy(f->W, known_W, sizeof known_W);
            filter_again(f);
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
    f->surprises = f->restarts = f->share = f->forget = 0.0;
    /* Afresh: what made the filter lose its numbers may be in these means, and would never leave them. */
    f->chi2 = 1.0;
    memset(f->white, 0, sizeof f->white);
    memset(f->last_r, 0, sizeof f->last_r);
    f->moving = f->found = f->expected = 0.0;
    f->rows = f->kept = 0;
    f->lost = 0;
    f->fit = 2.0 * FITS;
    f->growing = 1;
    f->origin = f->since = f->sample + 1;
    f->fresh = 1;
    form(f);
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
            double variance = 0.0;
            for (int j = i; j < NP; j++) {
                variance += f->W[i][j] * f->W[i][j];
            }
            const double share = damping ? f->settings.restart_damping : f->settings.restart_stiffness;
            const double own = larger(share * fabs(f->k.p[i]), 0.01 * share * f->prior[i]);
            for (int j = i; j < NP; j++) {
                f->W[i][j] = 0.0;
            }
            f->W[i][i] = larger(own, sqrt(variance));
        } else {
            double variance = 0.0;
            for (int j = i; j < NP; j++) {
                variance += f->W[i][j] * f->W[i][j];
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
        predict(f);
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
    expect(f, expected, C, by_p, noise);
    for (int a = 0; a < 2; a++) {
        correct_axis(f, C[a], by_p + a * NP, noise[a], 0.0);
    }
    f->in_block++;
    if (f->in_block >= f->length) {
        double L[NP][NP], b[NP];
        (void)information(f, L, b);
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
        double variance = 0.0;
        for (int j = i; j < NP; j++) {
            variance += f->W[i][j] * f->W[i][j];
        }
        f->prior[i] = sqrt(variance);
    }
    memcpy(f->first_p, p, sizeof f->first_p);
    f->first = f->now;
    f->walk = settings->omega_walk_max;
    f->sample = -1;
    f->restarted_at = -1.0;
    f->chi2 = 1.0;
    f->growing = 1;
    f->fit = 2.0 * FITS;
    form(f);
    begin_block(f);
}

#include "filter.h"

#include "known_model.h"

#define OUTLIER 15.0 /* squared innovation over its fast variance from which the full one is worth working out */
#define ROUNDS 8     /* filterings of a block at most */
#define MOVED 0.3    /* change of p in its new standard deviations, all together, that is worth another one */
#define FITS 2.0     /* mean squared innovation of a start that has found the device; before that every sample may surprise */
#define FORGET_MIN 0.1 /* where forgetting begins [1/s] */
#define UNFOUND 1e6  /* running mean of squared innovations of a device that has not been found yet */
#define LOST 1e4     /* mean squared innovation of a whole start that has found nothing */
#define PARALLEL 1e-7 /* share of a variance that two bounds must not have in common */
#define BOUNDS 4     /* lowest values that may be reached at once */
#define EFFORT 2.0   /* samples filtered again for each new one, in the long run */
#define EFFORT_MAX 200000.0 /* saved up at most */
#define WATCHED 0.005 /* over which innovations are averaged [s] */
#define FIRST 16     /* samples of the first block at its first fit */

#define TURN 1.0     /* change of the rate from which the motion is formed anew [rad/s] */

/* What a motion is followed with: a device, its motion, the moving values z [NZ] and, where they are wanted, their slopes by p. */
typedef struct {
    const known *k;
    const motion *m;
    double *z;
    double (*Y)[NP];
} frame;

static void form(filter *f)
{
    motion_form(&f->m, &f->k, f->now.z[OMEGA], f->m.period);
    if (f->shifted) {
        motion_form(&f->still_m, &f->still, f->now.z[OMEGA], f->m.period);
    }
}

static const double *command(const filter *f, int64_t sample) { return f->u[(sample > 0 ? sample : 0) & (QUEUE - 1)]; }

/* A force at the mass [N] and the command that it came of. */
typedef struct {
    double f[2];
    const double *u;
} acting;

/* The force that the command of `sample` makes. */
static acting force_of(const filter *f, const frame *w, int64_t sample)
{
    acting a;
    a.u = command(f, sample);
    known_actuate(w->k, w->z, a.u, w->z[OMEGA], a.f);
    return a;
}

/* The force after the change of the delayed force within the period that ends at the present sample. */
static acting force_after(const filter *f, const frame *w) { return force_of(f, w, f->sample - 1 - w->m->delay_samples); }

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

static void find_slopes(const known *k, double h, const passage *way, double omega_z, slopes *d)
{
    const double none[2] = {0.0, 0.0};
    double w[NS], bent[NS * NS];
    memset(d, 0, sizeof *d);
    for (int i = 0; i < NS; i++) {
        memcpy(d->phi[i], way->whole + NS * i, sizeof d->phi[i]);
    }
    for (int n = 0; n < NODES; n++) {
        const double weight = h * NODE_WEIGHT[n], *from = passage_from(way, n);
        const int ends = n == NODES - 1;
        double m[NS * NS];
        for (int i = 0; i < NS; i++) {
            for (int j = 0; j < NS; j++) {
                m[i * NS + j] = weight * (ends ? (i == j ? 1.0 : 0.0) : from[i * NS + j]);
            }
        }
        spread_rate_by_parameter(k, way->s[n], none, omega_z, m, NS, &d->D[0][0]);
        known_rate_by_omega(k, way->s[n], none, omega_z, w);
        for (int i = 0; i < NS; i++) {
            for (int j = 0; j < NS; j++) {
                d->psi[i] += m[i * NS + j] * w[j];
            }
        }
        if (BENT) {
            /* To first order in the bend B: the integral of phi(h - s) B phi(s). */
            double moved[NS][NS];
            known_bend_by_state(k, way->s[n], none, omega_z, bent);
            for (int i = 0; i < NS; i++) {
                for (int j = 0; j < NS; j++) {
                    moved[i][j] = n == 0 ? bent[i * NS + j] : 0.0;
                    for (int r = 0; r < NS && n > 0; r++) {
                        moved[i][j] += bent[i * NS + r] * passage_to(way, n)[r * NS + j];
                    }
                }
            }
            for (int i = 0; i < NS; i++) {
                for (int j = 0; j < NS; j++) {
                    double total = ends ? moved[i][j] : 0.0;
                    for (int r = 0; r < NS && !ends; r++) {
                        total += from[i * NS + r] * moved[r][j];
                    }
                    d->phi[i][j] += weight * total;
                }
            }
        }
    }
}

/* Adds the derivatives by p of the voltage at `s` by way of the force to out [2 * NP], times `weight`. */
static void add_force_in_voltage(const known *k, const double *s, const acting *force, double omega_z, double weight, double *out)
{
    if (FEEDS) {
        double by_force[4];
        known_pick_off_by_force(k, s, force->f, omega_z, by_force);
        for (int i = 0; i < 4; i++) {
            by_force[i] *= weight;
        }
        spread_actuate_by_parameter(k, s, force->u, omega_z, by_force, 2, out);
    }
}

/* Adds what one end of a piece of duration h contributes to the lagging voltages: the weights [3] of value, slope and curvature, as they stand and
   by tau; and their derivatives, where Y is not NULL: M [2 * NS] by the states, Y [2 * NP] by p. */
static void add_end(const known *k, const double *s, const acting *force, double omega_z, const double *weight, const double *by_tau, double h,
                    double value[2], double value_by_tau[2], double M[2 * NS], double *Y)
{
    const double scale[3] = {1.0, h, h * h};
    double jet[6 + 6 * NS], m[2 * 6];
    if (Y == NULL) {
        known_jet_values(k, s, force->f, omega_z, jet);
    } else {
        known_jet(k, s, force->f, omega_z, jet);
        memset(M, 0, 2 * NS * sizeof *M);
        memset(m, 0, sizeof m);
    }
    for (int i = 0; i < 3; i++) {
        const double w = weight[i] * scale[i];
        for (int a = 0; a < 2; a++) {
            const int row = 2 * i + a;
            value[a] += w * jet[row];
            if (Y != NULL) {
                value_by_tau[a] += by_tau[i] * scale[i] * jet[row];
                m[6 * a + row] = w;
                for (int j = 0; j < NS; j++) {
                    M[a * NS + j] += w * jet[6 + row * NS + j];
                }
            }
        }
    }
    if (Y != NULL) {
        spread_jet_by_parameter(k, s, force->f, omega_z, m, 2, Y);
        add_force_in_voltage(k, s, force, omega_z, weight[0], Y);
    }
}

/* Moves the lagging voltages through a piece, with their rows of Y and of F; `from` are the rows of Y of the states at its start. */
static void move_lag(const frame *w, const piece *part, const passage *way, const acting *force, const double *tau_by_p, double from[NS][NP],
                     double F[NZ][NZ])
{
    const lagging *l = &part->lag;
    const double omega_z = w->z[OMEGA];
    double *z = w->z + LAG, *Y = w->Y != NULL ? w->Y[LAG] : NULL, by_tau[2], M0[2 * NS], M1[2 * NS];
    for (int a = 0; a < 2; a++) {
        by_tau[a] = l->stay_by_tau * z[a];
        z[a] *= l->stay;
    }
    for (int q = 0; Y != NULL && q < 2 * NP; q++) {
        Y[q] *= l->stay;
    }
    add_end(w->k, way->s[0], force, omega_z, l->start, l->start_by_tau, part->duration, z, by_tau, M0, Y);
    add_end(w->k, way->s[NODES - 1], force, omega_z, l->end, l->end_by_tau, part->duration, z, by_tau, M1, Y);
    for (int a = 0; a < 2 && Y != NULL; a++) {
        F[LAG + a][LAG + a] = l->stay;
        for (int q = 0; q < NP; q++) {
            double total = by_tau[a] * tau_by_p[q];
            for (int j = 0; j < NS; j++) {
                total += M0[a * NS + j] * from[j][q] + M1[a * NS + j] * w->Y[j][q];
            }
            Y[a * NP + q] += total;
        }
        for (int j = 0; j < NS; j++) {
            F[LAG + a][j] += M0[a * NS + j];
            for (int r = 0; r < NS + 1; r++) {
                F[LAG + a][r] += M1[a * NS + j] * F[j][r];
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
        known_thermal(&f->k, way->s[NODES - 1], none, n->z[OMEGA], thermal);
        for (int i = 0; i < NS; i++) {
            for (int j = 0; j < NS; j++) {
                n->P[i][j] += g[i * 2] * (thermal[0] * g[j * 2] + thermal[1] * g[j * 2 + 1]) +
                              g[i * 2 + 1] * (thermal[2] * g[j * 2] + thermal[3] * g[j * 2 + 1]);
            }
        }
    }
}

/* Moves z through a piece and, where they are wanted, its slopes; F becomes the piece's derivative by z. */
static void move_through(const frame *w, const piece *part, const acting *force, const double *tau_by_p, double F[NZ][NZ], passage *way)
{
    const double omega_z = w->z[OMEGA], mass = 1.0 / w->k->p[INVERSE_MASS];
    double from[NS][NP];
    slopes d;
    motion_move(w->m, part, w->k, omega_z, force->f, w->z, way);
    if (w->Y != NULL) {
        find_slopes(w->k, part->duration, way, omega_z, &d);
        memcpy(from, w->Y, sizeof from);
        memset(F, 0, NZ * sizeof *F);
        F[OMEGA][OMEGA] = 1.0;
        for (int i = 0; i < NS; i++) {
            memcpy(F[i], d.phi[i], sizeof d.phi[i]);
            F[i][OMEGA] = d.psi[i];
            d.D[i][INVERSE_MASS] += mass * (way->force[2 * i] * force->f[0] + way->force[2 * i + 1] * force->f[1]);
            for (int q = 0; q < NP; q++) {
                d.D[i][q] += d.psi[i] * w->Y[OMEGA][q];
            }
        }
        spread_actuate_by_parameter(w->k, w->z, force->u, omega_z, way->force, NS, &d.D[0][0]);
        add_through(&d.phi[0][0], from, 1.0, d.D);
        memcpy(w->Y, d.D, sizeof d.D);
    }
    memcpy(w->z, way->s[NODES - 1], sizeof way->s[NODES - 1]);
    if (HAS_LAG) {
        move_lag(w, part, way, force, tau_by_p, from, F);
    }
}

/* The delayed force changes here: a longer delay puts that off. */
static void change_force(const frame *w, const double before[2], const double after[2], const double *delay_by_p)
{
    const motion *m = w->m;
    const double change[2] = {after[0] - before[0], after[1] - before[1]};
    for (int i = 0; i < NS; i++) {
        const double kick = m->b[2 * i] * change[0] + m->b[2 * i + 1] * change[1];
        for (int q = 0; q < NP; q++) {
            w->Y[i][q] -= kick * delay_by_p[q];
        }
    }
    if (HAS_LAG && m->lag > 0.0) {
        double v_before[2], v_after[2];
        known_pick_off(w->k, w->z, before, w->z[OMEGA], v_before);
        known_pick_off(w->k, w->z, after, w->z[OMEGA], v_after);
        for (int a = 0; a < 2; a++) {
            for (int q = 0; q < NP; q++) {
                w->Y[LAG + a][q] += (v_before[a] - v_after[a]) / m->lag * delay_by_p[q];
            }
        }
    }
}

/* Moves what a frame follows over the period that ends at the present sample. */
static void carry(const filter *f, const frame *w, double F[NZ][NZ], passage *way)
{
    const double none[2] = {0.0, 0.0};
    double late_by_p[2 * NP];
    const acting after = force_after(f, w);
    if ((HAS_DELAY || HAS_LAG) && w->Y != NULL) {
        known_late_by_parameter(w->k, w->z, none, w->z[OMEGA], late_by_p);
    }
    if (HAS_DELAY) {
        const acting before = force_of(f, w, f->sample - 2 - w->m->delay_samples);
        const int split = w->m->pieces[0].duration > 0.0;
        double first[NZ][NZ], second[NZ][NZ];
        if (split) {
            move_through(w, &w->m->pieces[0], &before, late_by_p + NP, first, way);
        }
        if (w->Y != NULL) {
            change_force(w, before.f, after.f, late_by_p);
        }
        move_through(w, &w->m->pieces[1], &after, late_by_p + NP, split ? second : F, way);
        for (int i = 0; split && w->Y != NULL && i < NZ; i++) {
            for (int j = 0; j < NZ; j++) {
                F[i][j] = 0.0;
                for (int r = 0; r < NZ; r++) {
                    F[i][j] += second[i][r] * first[r][j];
                }
            }
        }
    } else {
        move_through(w, &w->m->pieces[1], &after, late_by_p + NP, F, way);
    }
}

/* What z would be with the constants at which derivatives are taken. */
static void find_still(const filter *f, double z[NZ])
{
    for (int i = 0; i < NZ; i++) {
        z[i] = f->now.z[i];
        for (int q = 0; q < NP; q++) {
            z[i] -= f->now.Y[i][q] * f->shift[q];
        }
    }
}

/* Moves z, Y and P over the period that ends at the present sample. */
static void predict(filter *f)
{
    moving *n = &f->now;
    double F[NZ][NZ];
    passage way;
    if (fabs(n->z[OMEGA] - f->m.omega_z) > TURN) {
        form(f);
    }
    frame both = {&f->k, &f->m, n->z, n->Y};
    if (f->shifted) {
        const frame still = {&f->still, &f->still_m, f->z_still, n->Y};
        find_still(f, f->z_still);
        both.Y = NULL;
        carry(f, &both, NULL, &way);
        carry(f, &still, F, &way);
    } else {
        carry(f, &both, F, &way);
    }
    predict_covariance(f, F, &way);
}

/* What the sample should be, its derivatives by z and by p, and its noise [V2]. */
static void expect(const filter *f, double v[2], double C[2][NZ], double by_p[2 * NP], double noise[2])
{
    const known *k = f->shifted ? &f->still : &f->k;
    frame now = {&f->k, &f->m, (double *)f->now.z, NULL};
    const double *z = f->shifted ? f->z_still : now.z, one[4] = {1.0, 0.0, 0.0, 1.0};
    double entering[2], at[2], through[4], rate[2], pick_by_s[2 * NS], pick_by_p[2 * NP];
    const acting force = force_after(f, &now);
    memset(by_p, 0, 2 * NP * sizeof *by_p);
    memset(pick_by_p, 0, sizeof pick_by_p);
    memset(C, 0, 2 * sizeof *C);
    if (HAS_LAG) {
        memcpy(entering, now.z + NZ - 2, sizeof entering);
        memcpy(at, z + NZ - 2, sizeof at);
    } else {
        known_pick_off(&f->k, now.z, force.f, z[OMEGA], entering);
        known_pick_off(k, z, force.f, z[OMEGA], at);
        known_pick_off_by_state(k, z, force.f, z[OMEGA], pick_by_s);
        spread_pick_off_by_parameter(k, z, force.f, z[OMEGA], one, 2, pick_by_p);
        add_force_in_voltage(k, z, &force, z[OMEGA], 1.0, pick_by_p);
    }
    known_amplify(&f->k, now.z, entering, z[OMEGA], v);
    known_amplify_by_voltage(k, z, at, z[OMEGA], through);
    spread_amplify_by_parameter(k, z, at, z[OMEGA], one, 2, by_p);
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
    known_pick_off_rate(&f->k, now.z, force.f, z[OMEGA], rate);
    known_noise(&f->k, now.z, rate, z[OMEGA], noise);
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

/* From here on derivatives are taken at the constants as they are now, while predictions follow the estimates. Were both to follow, the directions in
   which the data tell nothing would turn with each estimate, and what is well known in one would seem to be known in another (G. Huang, A. Mourikis,
   S. Roumeliotis, first-estimates Jacobians, Int. J. Robotics Research 29, 2010). Only a start that is filtered again may move them. */
static void hold_derivatives(filter *f)
{
    if (NP > 7) {
        f->still = f->k;
        memset(f->shift, 0, sizeof f->shift);
        memcpy(f->p_still, f->k.p, sizeof f->p_still);
        f->shifted = 1;
    }
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
    memcpy(f->still.in, in, sizeof f->still.in);
    f->still.t = f->k.t = (double)f->sample * f->m.period;
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

/* Follows how large and how white the innovations are. Those of a start that has just been filtered at its own fit are taken as they are; others also
   carry what was not known of the constants beforehand. */
static void watch(filter *f)
{
    if (f->rows == 0) {
        return;
    }
    const double pace = f->growing ? 1.0 : smaller(1.0, (double)f->in_block * f->m.period / WATCHED);
    const double expected = f->growing ? 1.0 : 1.0 + f->share;
    double total = 0.0, product[2] = {0.0, 0.0};
    for (int64_t r = 0; r < f->rows; r++) {
        total += f->r[r] * f->r[r];
        product[r & 1] += f->r[r] * f->last_r[r & 1];
        f->last_r[r & 1] = f->r[r];
    }
    f->chi2 += pace * (total / ((double)f->rows * expected) - f->chi2);
    for (int a = 0; a < 2; a++) {
        f->white[a] += pace * (product[a] / (0.5 * (double)f->rows * expected) - f->white[a]);
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
        f->shift[i] = p - f->p_still[i];
    }
}

/* p_begun + W eta, its entry i. */
static double constant_at(const filter *f, const double eta[NP], int i)
{
    double p = f->p_begun[i];
    for (int j = i; j < NP; j++) {
        p += f->W[i][j] * eta[j];
    }
    return p;
}

/* Keeps p = p_begun + W eta at its lowest values: where eta lies below some, it goes to the most likely point on all of these bounds together, given
   the Hessian L L'. A delay and a lag that can't be told apart pull at each other, so one after the other would not do. */
static void keep_in_bounds(const filter *f, double L[NP][NP], double eta[NP])
{
    double along[BOUNDS][NP], free_eta[NP];
    int at[BOUNDS], count = 0;
    memcpy(free_eta, eta, sizeof free_eta);
    for (int grown = 1; grown;) {
        grown = 0;
        for (int i = 0; i < NP && count < BOUNDS; i++) {
            const double hair = 1e-12 * f->prior[i];
            if (constant_at(f, eta, i) < f->lowest[i] - hair) {
                double w[NP], half[NP];
                for (int j = 0; j < NP; j++) {
                    w[j] = j >= i ? f->W[i][j] : 0.0;
                }
                solve(L, w, along[count], half);
                at[count++] = i;
                grown = 1;
            }
        }
        if (grown) {
            /* (W_A J^-1 W_A') lambda = what is missing, by elimination; symmetric and positive. */
            double S[BOUNDS][BOUNDS + 1];
            for (int a = 0; a < count; a++) {
                for (int b = 0; b < count; b++) {
                    S[a][b] = 0.0;
                    for (int j = at[a]; j < NP; j++) {
                        S[a][b] += f->W[at[a]][j] * along[b][j];
                    }
                }
                S[a][count] = f->lowest[at[a]] - constant_at(f, free_eta, at[a]);
            }
            double own[BOUNDS];
            for (int a = 0; a < count; a++) {
                own[a] = S[a][a];
            }
            for (int a = 0; a < count; a++) {
                for (int b = a + 1; b < count && S[a][a] > PARALLEL * own[a]; b++) {
                    const double factor = S[b][a] / S[a][a];
                    for (int c = a; c <= count; c++) {
                        S[b][c] -= factor * S[a][c];
                    }
                }
            }
            memcpy(eta, free_eta, sizeof free_eta);
            for (int a = count - 1; a >= 0; a--) {
                double lambda = S[a][count];
                for (int b = a + 1; b < count; b++) {
                    lambda -= S[a][b] * S[b][count];
                }
                /* A bound that the others reach already, to within what is known of their sum, is left as it is. */
                lambda = S[a][a] > PARALLEL * own[a] ? lambda / S[a][a] : 0.0;
                S[a][count] = lambda;
                for (int j = 0; j < NP; j++) {
                    eta[j] += lambda * along[a][j];
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
        if (round >= rounds || moved < MOVED || f->effort <= 0.0) {
            break;
        }
        double next = squared(trial) + filter_again(f);
        while (!(next < cost * 1.001 + 1.0) && part > 0.01 && f->effort > 0.0) {
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
            watch(f);
            plan_block(f);
        } else {
            f->lost = !(f->fit < LOST);
            hold_derivatives(f);
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
    if (f->growing) {
        hold_derivatives(f);
    }
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
    f->chi2 = UNFOUND;
    f->rows = f->kept = 0;
    f->lost = 0;
    f->fit = 2.0 * FITS;
    f->growing = 1;
    f->shifted = 0;
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
    f->shifted = 0;
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
    f->chi2 = UNFOUND;
    f->effort = EFFORT_MAX;
    f->growing = 1;
    f->fit = 2.0 * FITS;
    form(f);
    begin_block(f);
}

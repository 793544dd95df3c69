/* What is predicted: z, its slopes Y by p and its covariance over a sample period, and the sample that they make. */

#include "prediction.h"

#include "covariance.h"
#include "known_model.h"

#define TURN 1.0     /* change of the rate from which the motion is formed anew [rad/s] */
#define MOVES(r) ((r) == 0 || (r) == 2) /* x, y: their rates are states, whatever p is */

/* What a motion is followed with: a device, its motion, the moving values z [NZ] and their slopes by p. */
typedef struct {
    const known *k;
    const motion *m;
    double *z;
    double (*Y)[NW];
} frame;

void filter_form(filter *f)
{
    motion_form(&f->m, &f->k, f->now.z[OMEGA], f->m.period);
}

const double *filter_command(const filter *f, int64_t sample) { return f->u[(sample > 0 ? sample : 0) & (QUEUE - 1)]; }

/* A force at the mass [N] and the command that it came of. */
typedef struct {
    double f[2];
    const double *u;
} acting;

/* The force that the command of `sample` makes. */
static acting force_of(const filter *f, const frame *w, int64_t sample)
{
    acting a;
    a.u = filter_command(f, sample);
    known_actuate(w->k, w->z, a.u, w->z[OMEGA], a.f);
    return a;
}

/* The force after the change of the delayed force within the period that ends at the present sample. */
static acting force_after(const filter *f, const frame *w) { return force_of(f, w, f->sample - 1 - w->m->delay_samples); }

/* What a piece did: the derivatives of the states at its end by those at its start (phi), by the rate of turn (psi) and by what adds to
   their own rates at the nodes (by_rate). */
typedef struct {
    double phi[NS][NS], psi[NS], by_rate[NODES][NS][NS];
} slopes;

static void find_slopes(const known *k, double h, const passage *way, double omega_z, slopes *d)
{
    const double none[2] = {0.0, 0.0};
    memcpy(d->phi, way->whole, sizeof d->phi);
    memset(d->psi, 0, sizeof d->psi);
    for (int n = 0; n < NODES; n++) {
        const double *from = passage_from(way, n), *to = passage_to(way, n);
        double w[NS], bent[NS][NS] = {{0.0}};
        known_rate_by_omega(k, way->s[n], none, omega_z, w);
        for (int i = 0; i < NS; i++) {
            for (int r = 0; r < NS; r++) {
                d->by_rate[n][i][r] = MOVES(r) ? 0.0 : 0.5 * h * from[i * NS + r];
                d->psi[i] += MOVES(r) ? 0.0 : d->by_rate[n][i][r] * w[r];
            }
        }
        if (BENT) {
            /* To first order: what leads to the node, the bend there, and what leads on. */
            spread_bend_by_state(k, way->s[n], none, omega_z, &d->by_rate[n][0][0], NS, &bent[0][0]);
            for (int i = 0; i < NS; i++) {
                for (int b = 0; b < NQ; b++) {
                    const int r = known_bending[b];
                    for (int j = 0; j < NS; j++) {
                        d->phi[i][j] += bent[i][r] * to[r * NS + j];
                    }
                }
            }
        }
    }
}

/* What p adds to the states at the end of a piece, by their rates on the way and by the force. */
static void find_direct(const frame *w, const passage *way, double omega_z, const acting *force, const slopes *d, double direct[NS][NW])
{
    const double mass = 1.0 / w->k->p[INVERSE_MASS];
    wide_clear(direct[0], NS * NB);
    for (int n = 0; n < NODES; n++) {
        spread_rate_by_parameter(w->k, way->s[n], force->f, omega_z, &d->by_rate[n][0][0], NS, direct[0]);
    }
    spread_actuate_by_parameter(w->k, w->z, force->u, omega_z, way->force, NS, direct[0]);
    for (int i = 0; i < NS; i++) {
        direct[i][INVERSE_MASS] += mass * (way->force[2 * i] * force->f[0] + way->force[2 * i + 1] * force->f[1]);
    }
}

/* Moves the slopes by p of the states through a piece, from those at its start. */
static void move_slopes(const frame *w, const slopes *d, double from[NS][NW], double direct[NS][NW])
{
    for (int i = 0; i < NS; i++) {
        wide *out = wide_row(w->Y[i]);
        for (int b = 0; b < NB; b++) {
            wide total = wide_of(direct[i])[b] + d->psi[i] * wide_of(w->Y[OMEGA])[b];
            for (int j = 0; j < NS; j++) {
                total += d->phi[i][j] * wide_of(from[j])[b];
            }
            out[b] = total;
        }
    }
}

/* Adds the derivatives by p of the voltages at two states by way of the force to out [2 * NW], each times its weight. */
static void add_force_in_voltage(const frame *w, const double *first, const double *second, const acting *force, const double weights[2], double *out)
{
    if (FEEDS) {
        const double omega_z = w->z[OMEGA];
        double by_first[4], by_second[4], by_force[4];
        known_pick_off_by_force(w->k, first, force->f, omega_z, by_first);
        known_pick_off_by_force(w->k, second, force->f, omega_z, by_second);
        for (int i = 0; i < 4; i++) {
            by_force[i] = weights[0] * by_first[i] + weights[1] * by_second[i];
        }
        spread_actuate_by_parameter(w->k, first, force->u, omega_z, by_force, 2, out);
    }
}

/* What the ends of the pieces contribute to the lagging voltages, side by side: start and end of the first piece, then of the second. Value and its
   derivatives by tau, by the states and by those p that show, a row an axis. */
typedef struct {
    double value[2 * POINTS], by_tau[2 * POINTS], by_state[2 * NS * POINTS], by_p[2 * NV * POINTS];
} contributions;

static void find_contributions(const frame *w, int first, const passage ways[2], const acting forces[2], contributions *e)
{
    double s[NS * POINTS], f[2 * POINTS], weight[3 * POINTS], by_tau[3 * POINTS], jet[(6 + 6 * NS) * POINTS];
    for (int i = 0; i < POINTS; i++) {
        /* Without a first piece the second stands in its place, unused. */
        const int n = i / 2 < first ? first : i / 2, ends = i % 2;
        const lagging *l = &w->m->pieces[n].lag;
        const double h = w->m->pieces[n].duration, scale[3] = {1.0, h, h * h};
        put_point(s, NS, i, ends ? ways[n].end : ways[n].start);
        put_point(f, 2, i, forces[n].f);
        for (int r = 0; r < 3; r++) {
            weight[r * POINTS + i] = scale[r] * (ends ? l->end : l->start)[r];
            by_tau[r * POINTS + i] = scale[r] * (ends ? l->end_by_tau : l->start_by_tau)[r];
        }
    }
    known_jet(w->k, s, f, w->z[OMEGA], weight, jet, e->by_p);
    /* The rows of value, slope and curvature of an axis lie two apart. */
    for (int a = 0; a < 2; a++) {
        for (int i = 0; i < POINTS; i++) {
            const double *own = jet + a * POINTS + i;
            e->value[a * POINTS + i] = weight[i] * own[0] + weight[POINTS + i] * own[2 * POINTS] + weight[2 * POINTS + i] * own[4 * POINTS];
            e->by_tau[a * POINTS + i] = by_tau[i] * own[0] + by_tau[POINTS + i] * own[2 * POINTS] + by_tau[2 * POINTS + i] * own[4 * POINTS];
        }
        for (int j = 0; j < NS; j++) {
            for (int i = 0; i < POINTS; i++) {
                const double *own = jet + (6 + a * NS + j) * POINTS + i;
                e->by_state[(a * NS + j) * POINTS + i] =
                    weight[i] * own[0] + weight[POINTS + i] * own[2 * NS * POINTS] + weight[2 * POINTS + i] * own[4 * NS * POINTS];
            }
        }
    }
}

/* Moves the lagging voltages through the piece n, with their rows of Y and of F; `from` are the rows of Y of the states at its start. */
static void move_lag(const frame *w, int n, const passage *way, const acting *force, const contributions *e, const double tau_by_p[NW],
                     double from[NS][NW], double F[NZ][ZW])
{
    const lagging *l = &w->m->pieces[n].lag;
    double *z = w->z + LAG, direct[2][NW];
    const double weights[2] = {l->start[0], l->end[0]};
    wide_clear(direct[0], 2 * NB);
    add_force_in_voltage(w, way->start, way->end, force, weights, direct[0]);
    for (int a = 0; a < 2; a++) {
        const double *by_state = e->by_state + a * NS * POINTS + 2 * n, *by_p = e->by_p + a * NV * POINTS + 2 * n;
        const double by_tau = l->stay_by_tau * z[a] + e->by_tau[a * POINTS + 2 * n] + e->by_tau[a * POINTS + 2 * n + 1];
        z[a] = l->stay * z[a] + e->value[a * POINTS + 2 * n] + e->value[a * POINTS + 2 * n + 1];
        F[LAG + a][LAG + a] = l->stay;
        for (int v = 0; v < NV; v++) {
            direct[a][known_shown[v]] += by_p[v * POINTS] + by_p[v * POINTS + 1];
        }
        wide *out = wide_row(w->Y[LAG + a]);
        for (int b = 0; b < NB; b++) {
            wide total = l->stay * out[b] + by_tau * wide_of(tau_by_p)[b] + wide_of(direct[a])[b];
            for (int j = 0; j < NS; j++) {
                total += by_state[j * POINTS] * wide_of(from[j])[b] + by_state[j * POINTS + 1] * wide_of(w->Y[j])[b];
            }
            out[b] = total;
        }
        for (int j = 0; j < NS; j++) {
            F[LAG + a][j] += by_state[j * POINTS];
            for (int r = 0; r < NS + 1; r++) {
                F[LAG + a][r] += by_state[j * POINTS + 1] * F[j][r];
            }
        }
    }
}

/* Moves z and its slopes through the piece n, `way` being that of the states; F becomes the piece's derivative by z. */
static void move_through(const frame *w, int n, const acting *force, const contributions *e, const double tau_by_p[NW], double F[NZ][ZW],
                         const passage *way)
{
    double from[NS][NW], direct[NS][NW];
    slopes d;
    find_slopes(w->k, w->m->pieces[n].duration, way, w->z[OMEGA], &d);
    find_direct(w, way, w->z[OMEGA], force, &d, direct);
    wide_copy(w->Y[0], NS * NB, from[0]);
    move_slopes(w, &d, from, direct);
    wide_clear(F[0], NZ * ZB);
    F[OMEGA][OMEGA] = F[SLOPE][SLOPE] = 1.0;
    for (int i = 0; i < NS; i++) {
        for (int j = 0; j < NS; j++) {
            F[i][j] = d.phi[i][j];
        }
        F[i][OMEGA] = d.psi[i];
    }
    memcpy(w->z, way->end, sizeof way->end);
    if (HAS_LAG) {
        move_lag(w, n, way, force, e, tau_by_p, from, F);
    }
}

/* row -= by delay_by_p. */
static void delay_row(double row[NW], double by, const double delay_by_p[NW])
{
    for (int b = 0; b < NB; b++) {
        wide_row(row)[b] -= by * wide_of(delay_by_p)[b];
    }
}

/* The delayed force changes here: a longer delay puts that off. */
static void change_force(const frame *w, const double before[2], const double after[2], const double delay_by_p[NW])
{
    const motion *m = w->m;
    const double change[2] = {after[0] - before[0], after[1] - before[1]};
    for (int i = 0; i < NS; i++) {
        delay_row(w->Y[i], m->b[2 * i] * change[0] + m->b[2 * i + 1] * change[1], delay_by_p);
    }
    if (HAS_LAG && m->lag > 0.0) {
        double v_before[2], v_after[2];
        known_pick_off(w->k, w->z, before, w->z[OMEGA], v_before);
        known_pick_off(w->k, w->z, after, w->z[OMEGA], v_after);
        for (int a = 0; a < 2; a++) {
            delay_row(w->Y[LAG + a], (v_after[a] - v_before[a]) / m->lag, delay_by_p);
        }
    }
}

/* F = late early, of two pieces: the rate and its slope stay; states follow states and the rate, the lagging voltages these, and themselves. */
static void join(double late[NZ][ZW], double early[NZ][ZW], double F[NZ][ZW])
{
    for (int i = 0; i < NZ; i++) {
        for (int b = 0; b < ZB; b++) {
            wide sum = (i < OMEGA ? 0.0 : late[i][i]) * wide_of(early[i])[b];
            for (int r = 0; r < LAG && i != OMEGA && i != SLOPE; r++) {
                sum += late[i][r] * wide_of(early[r])[b];
            }
            wide_row(F[i])[b] = sum;
        }
    }
}

/* Moves what a frame follows over the period that ends at the present sample. */
static void carry(const filter *f, const frame *w, double F[NZ][ZW], passage *last)
{
    const motion *m = w->m;
    const int first = HAS_DELAY && m->pieces[0].duration > 0.0 ? 0 : 1;
    const double none[2] = {0.0, 0.0}, omega_z = w->z[OMEGA];
    double late_by_p[2 * NP], delay_by_p[NW] = {0.0}, tau_by_p[NW] = {0.0}, early[NZ][ZW], late[NZ][ZW];
    const acting after = force_after(f, w), before = HAS_DELAY ? force_of(f, w, f->sample - 2 - m->delay_samples) : after;
    const acting forces[2] = {before, after};
    passage ways[2];
    contributions e;
    if (HAS_DELAY || HAS_LAG) {
        known_late_by_parameter(w->k, w->z, none, omega_z, late_by_p);
        memcpy(delay_by_p, late_by_p, NP * sizeof *late_by_p);
        memcpy(tau_by_p, late_by_p + NP, NP * sizeof *late_by_p);
    }
    for (int n = first; n < 2; n++) {
        motion_move(&m->pieces[n], w->k, omega_z - m->omega_z, omega_z, forces[n].f, n > first ? ways[0].end : w->z, &ways[n]);
    }
    if (HAS_LAG) {
        find_contributions(w, first, ways, forces, &e);
    }
    if (first == 0) {
        move_through(w, 0, &before, &e, tau_by_p, early, &ways[0]);
    }
    if (HAS_DELAY) {
        change_force(w, before.f, after.f, delay_by_p);
    }
    move_through(w, 1, &after, &e, tau_by_p, first == 0 ? late : F, &ways[1]);
    *last = ways[1];
    if (first == 0) {
        join(late, early, F);
        /* A noise force acts over both pieces. */
        for (int i = 0; i < NS; i++) {
            for (int j = 0; j < NS; j++) {
                last->force[2 * i] += last->whole[i * NS + j] * ways[0].force[2 * j];
                last->force[2 * i + 1] += last->whole[i * NS + j] * ways[0].force[2 * j + 1];
            }
        }
    }
}

/* Moves z, Y and P over the period that ends at the present sample. */
void filter_predict(filter *f)
{
    moving *n = &f->now;
    double F[NZ][ZW];
    passage way;
    if (fabs(n->z[OMEGA] - f->m.omega_z) > TURN) {
        filter_form(f);
    }
    const frame w = {&f->k, &f->m, n->z, n->Y};
    carry(f, &w, F, &way);
    /* The rate is held over a sample, and moves at its end. */
    n->z[OMEGA] += f->m.period * n->z[SLOPE];
    for (int q = 0; q < NP; q++) {
        n->Y[OMEGA][q] += f->m.period * n->Y[SLOPE][q];
    }
    covariance_predict(f, F, &way);
}

/* What the sample should be, its derivatives by z and by p, and its noise [V2]. */
void filter_expect(const filter *f, double v[2], double C[2][NZ], double by_p[2 * NW], double noise[2])
{
    const known *k = &f->k;
    const frame now = {k, &f->m, (double *)f->now.z, NULL};
    const double *z = f->now.z, one[4] = {1.0, 0.0, 0.0, 1.0}, once[2] = {1.0, 0.0};
    double entering[2], through[4], rate[2], pick_by_s[2 * NS], pick_by_p[2 * NW];
    const acting force = force_after(f, &now);
    memset(by_p, 0, 2 * NW * sizeof *by_p);
    memset(pick_by_p, 0, sizeof pick_by_p);
    memset(C, 0, 2 * sizeof *C);
    if (HAS_LAG) {
        memcpy(entering, z + LAG, sizeof entering);
    } else {
        known_pick_off(k, z, force.f, z[OMEGA], entering);
        known_pick_off_by_state(k, z, force.f, z[OMEGA], pick_by_s);
        spread_pick_off_by_parameter(k, z, force.f, z[OMEGA], one, 2, pick_by_p);
        add_force_in_voltage(&now, z, z, &force, once, pick_by_p);
    }
    known_amplify(k, z, entering, z[OMEGA], v);
    known_amplify_by_voltage(k, z, entering, z[OMEGA], through);
    spread_amplify_by_parameter(k, z, entering, z[OMEGA], one, 2, by_p);
    for (int a = 0; a < 2; a++) {
        for (int b = 0; b < 2; b++) {
            if (HAS_LAG) {
                C[a][LAG + b] = through[2 * a + b];
            } else {
                for (int j = 0; j < NS; j++) {
                    C[a][j] += through[2 * a + b] * pick_by_s[b * NS + j];
                }
                for (int q = 0; q < NP; q++) {
                    by_p[a * NW + q] += through[2 * a + b] * pick_by_p[b * NW + q];
                }
            }
        }
    }
    known_pick_off_rate(k, z, force.f, z[OMEGA], rate);
    known_noise(k, z, rate, z[OMEGA], noise);
}

void filter_enter(filter *f, const double in[IN])
{
    const int changed = memcmp(f->k.in, in, sizeof f->k.in) != 0;
    memcpy(f->k.in, in, sizeof f->k.in);
    if (changed) {
        /* Parameter laws follow the inputs. */
        filter_form(f);
    }
    f->k.t = (double)f->sample * f->m.period;
}

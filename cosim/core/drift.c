/* The loop seen at its own frequency: motion q = Re a exp(i omega t), m q'' + D q' + K q = F. With the force F a the feedback makes of the motion,
   2 i m omega a' = (F - (K - m omega^2) - i omega D) a. Feedback computed on the device as taken, acting through actuators and delay as they are,
   on a motion read through the pickoff as it is: what differs turns the pattern. */

#include "drift.h"

#include <complex.h>

#include "known_model.h"

typedef struct {
    double complex e[2][2];
} pair;

static pair product(pair a, pair b)
{
    pair c;
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            c.e[i][j] = a.e[i][0] * b.e[0][j] + a.e[i][1] * b.e[1][j];
        }
    }
    return c;
}

static pair inverse(pair a)
{
    const double complex det = a.e[0][0] * a.e[1][1] - a.e[0][1] * a.e[1][0];
    const pair b = {{{a.e[1][1] / det, -a.e[0][1] / det}, {-a.e[1][0] / det, a.e[0][0] / det}}};
    return b;
}

/* Delay and lag [s] of p as they are near k: beyond the end of a lag nothing has been seen. */
static void late_near(const known *k, const double p[NP], double late[2])
{
    const double rest[NS] = {0}, none[2] = {0.0, 0.0};
    double by_p[2 * NP];
    known_late(k, rest, none, 0.0, late);
    known_late_by_parameter(k, rest, none, 0.0, by_p);
    for (int q = 0; q < NP; q++) {
        late[0] += by_p[q] * (p[q] - k->p[q]);
        late[1] += by_p[NP + q] * (p[q] - k->p[q]);
    }
}

/* Dynamic stiffness K - m omega^2 + i omega D as it acts, force per command, voltage per displacement, which come late by `late` [s]. */
static void responses(const known *k, const double late[2], double omega, pair *impedance, pair *actuator, pair *pickoff)
{
    const double rest[NS] = {0}, none[2] = {0.0, 0.0};
    const double mass = 1.0 / k->p[INVERSE_MASS];
    double a[NS * NS], J[4], C[2 * NS], Cf[4];
    known_rate_by_state(k, rest, none, 0.0, a);
    known_actuate_by_command(k, rest, none, 0.0, J);
    known_pick_off_by_state(k, rest, none, 0.0, C);
    known_pick_off_by_force(k, rest, none, 0.0, Cf);
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            const double *row = a + NS * (2 * i + 1);
            impedance->e[i][j] = -mass * (row[2 * j] + I * omega * row[2 * j + 1]) - (i == j ? mass * omega * omega : 0.0);
            actuator->e[i][j] = J[2 * i + j] * cexp(-I * omega * late[0]);
        }
    }
    const pair force = *impedance;
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            const double complex seen = C[NS * i + 2 * j] + Cf[2 * i] * force.e[0][j] + Cf[2 * i + 1] * force.e[1][j];
            pickoff->e[i][j] = seen / (1.0 + I * omega * late[1]);
        }
    }
}

/* Re of n' G e for e = (cos phi, sin phi), n across it, as constant, cos 2 phi and sin 2 phi. */
static void across(pair g, double out[3])
{
    out[0] = 0.5 * creal(g.e[1][0] - g.e[0][1]);
    out[1] = 0.5 * creal(g.e[1][0] + g.e[0][1]);
    out[2] = 0.5 * creal(g.e[1][1] - g.e[0][0]);
}

/* G of the force per motion. */
static pair turning_by(const known *k, double omega, pair force, pair impedance)
{
    pair g;
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            g.e[i][j] = (force.e[i][j] - impedance.e[i][j]) * k->p[INVERSE_MASS] / (2.0 * I * omega);
        }
    }
    return g;
}

void drift_of(const known *k, const known *taken, double stiffness, double rate[3], double bend[3])
{
    const double mass = 1.0 / taken->p[INVERSE_MASS], omega = sqrt(stiffness / mass);
    double late[2], late_taken[2];
    pair Z, A, H, Z_taken, A_taken, H_taken;
    late_near(taken, k->p, late);
    late_near(taken, taken->p, late_taken);
    responses(k, late, omega, &Z, &A, &H);
    responses(taken, late_taken, omega, &Z_taken, &A_taken, &H_taken);
    /* The feedback makes the dynamic stiffness vanish on the device as taken. */
    const pair read = product(inverse(H_taken), H);
    const pair force = product(product(A, inverse(A_taken)), product(Z_taken, read));
    across(turning_by(k, omega, force, Z), rate);
    across(read, bend);
}

void drift_of_force(const known *k, const known *taken, double stiffness, double rate[3])
{
    const double omega = sqrt(stiffness * taken->p[INVERSE_MASS]), rest[NS] = {0}, none[2] = {0.0, 0.0};
    double late[2], late_taken[2];
    pair Z, A, H, Z_taken, A_taken, H_taken;
    known_late(k, rest, none, 0.0, late);
    known_late(taken, rest, none, 0.0, late_taken);
    responses(k, late, omega, &Z, &A, &H);
    responses(taken, late_taken, omega, &Z_taken, &A_taken, &H_taken);
    across(turning_by(k, omega, product(product(A, inverse(A_taken)), Z_taken), Z), rate);
}

/* Root of v' C v for v = (1, cos a, sin a), C the sum of squares of `columns`. */
static double size_at(double columns[NP][3], double a)
{
    double total = 0.0;
    for (int j = 0; j < NP; j++) {
        const double value = columns[j][0] + cos(a) * columns[j][1] + sin(a) * columns[j][2];
        total += value * value;
    }
    return sqrt(total);
}

static double largest(double columns[NP][3])
{
    enum { STEPS = 48 };
    double most = 0.0;
    for (int n = 0; n < STEPS; n++) {
        most = larger(most, size_at(columns, 6.283185307179586 * n / STEPS));
    }
    return most;
}

drift_sizes drift_deviation(const known *k, double W[NP][NP], double stiffness, double phi)
{
    double rates[NP][3], bends[NP][3];
    for (int j = 0; j < NP; j++) {
        /* Along each column of W, by central differences. */
        known up = *k, down = *k;
        double rate[2][3], bend[2][3];
        for (int i = 0; i < NP; i++) {
            up.p[i] += W[i][j];
            down.p[i] -= W[i][j];
        }
        drift_of(&up, k, stiffness, rate[0], bend[0]);
        drift_of(&down, k, stiffness, rate[1], bend[1]);
        for (int c = 0; c < 3; c++) {
            rates[j][c] = 0.5 * (rate[0][c] - rate[1][c]);
            bends[j][c] = 0.5 * (bend[0][c] - bend[1][c]);
        }
    }
    const drift_sizes found = {largest(rates), size_at(rates, 2.0 * phi), largest(bends)};
    return found;
}

#include "hold.h"

#include <complex.h>

#define ROUNDS 4

static void solve_for_force(const double *rate, const double *phi, const double *gamma, held_loop *h)
{
    /* u = rate (phi state + gamma u) + w, solved for u. */
    double m[4];
    for (int i = 0; i < 2; i++) {
        for (int axis = 0; axis < 2; axis++) {
            m[2 * i + axis] = i == axis ? 1.0 : 0.0;
            for (int j = 0; j < 4; j++) {
                m[2 * i + axis] -= rate[4 * i + j] * gamma[2 * j + axis];
            }
        }
    }
    const double det = m[0] * m[3] - m[1] * m[2];
    h->mix[0] = m[3] / det;
    h->mix[1] = -m[1] / det;
    h->mix[2] = -m[2] / det;
    h->mix[3] = m[0] / det;
    for (int j = 0; j < 4; j++) {
        double f[2] = {0.0, 0.0};
        for (int i = 0; i < 4; i++) {
            f[0] += rate[i] * phi[4 * i + j];
            f[1] += rate[4 + i] * phi[4 * i + j];
        }
        h->gain[j] = h->mix[0] * f[0] + h->mix[1] * f[1];
        h->gain[4 + j] = h->mix[2] * f[0] + h->mix[3] * f[1];
    }
}

/* An entry of the free loop over a time: phi + gamma gain. */
static double loop_entry(const held_loop *h, const double *phi, const double *gamma, int i, int j)
{
    return phi[4 * i + j] + gamma[2 * i] * h->gain[j] + gamma[2 * i + 1] * h->gain[4 + j];
}

/* l_a (phi + gamma gain) r_b, or with the conjugate of r_b (`twin`); r = (1, i omega), l = (1, -i/omega)/2: the oscillator turning
   exp(i omega t). */
static double complex mode(const held_loop *h, double omega, int a, int b, int twin)
{
    const double complex left[2] = {0.5, -0.5 * I / omega};
    const double complex right[2] = {1.0, (twin ? -omega : omega) * I};
    double complex total = 0.0;
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            const int row = 2 * a + i, column = 2 * b + j;
            total += left[i] * loop_entry(h, h->phi, h->gamma, row, column) * right[j];
        }
    }
    return total;
}

/* Corrects the gain so that the sampled loop turns exp(i omega T), and by -omega_z T in the plane. The slow motion sees l A r between either
   axis, and by way of the counter-rotating motion (a Schur complement, second order). A change of the gain by dk + dd d/dt moves it by
   (l gamma)(dk + i omega dd): one division an entry, repeated for what is of higher order. */
static void make_isotropic(held_loop *h, double omega_squared, double omega_z, double period)
{
    const double omega = sqrt(omega_squared), angle = omega * period;
    const double complex wanted = cexp(I * angle);
    for (int round = 0; round < ROUNDS; round++) {
        double complex twin[2][2];
        for (int a = 0; a < 2; a++) {
            for (int b = 0; b < 2; b++) {
                twin[a][b] = mode(h, omega, a, b, 1);
            }
        }
        for (int a = 0; a < 2; a++) {
            const double complex push = 0.5 * (h->gamma[2 * (2 * a) + a] - I * h->gamma[2 * (2 * a + 1) + a] / omega);
            for (int b = 0; b < 2; b++) {
                double complex total = mode(h, omega, a, b, 0);
                total += (twin[a][0] * conj(twin[0][b]) + twin[a][1] * conj(twin[1][b])) / (2.0 * I * sin(angle));
                if (a == b) {
                    total -= wanted * cos(omega_z * period);
                } else {
                    total -= wanted * sin(omega_z * period) * (b - a);
                }
                const double complex change = -total / push;
                h->gain[4 * a + 2 * b] += creal(change);
                h->gain[4 * a + 2 * b + 1] += cimag(change) / omega;
            }
        }
    }
}

void hold_form(held_loop *h, const double *a, const double *b, const double *rate, double omega_squared, double omega_z, double period,
               int compensate)
{
    const double half = compensate ? 0.5 * period : 0.0;
    const double angle = sqrt(omega_squared) * half;
    const double boost = compensate ? angle / sin(angle) : 1.0;
    double boosted[8];
    for (int i = 0; i < 8; i++) {
        boosted[i] = boost * rate[i];
    }
    transition_over(a, b, 4, half, h->phi, h->gamma);
    solve_for_force(boosted, h->phi, h->gamma, h);
    transition_over(a, b, 4, period, h->phi, h->gamma);
    if (compensate) {
        make_isotropic(h, omega_squared, omega_z, period);
    }
}

/* Solves a[:, :n] z = a[:, n:] in place, a [n * columns] row by row (Gauss-Jordan, row pivots). */
static void eliminate(double *a, int n, int columns)
{
    for (int i = 0; i < n; i++) {
        int pivot = i;
        for (int r = i + 1; r < n; r++) {
            pivot = fabs(a[r * columns + i]) > fabs(a[pivot * columns + i]) ? r : pivot;
        }
        for (int j = 0; j < columns; j++) {
            const double swapped = a[i * columns + j];
            a[i * columns + j] = a[pivot * columns + j];
            a[pivot * columns + j] = swapped;
        }
        const double scale = 1.0 / a[i * columns + i];
        for (int j = 0; j < columns; j++) {
            a[i * columns + j] *= scale;
        }
        for (int r = 0; r < n; r++) {
            const double factor = r == i ? 0.0 : a[r * columns + i];
            for (int j = 0; j < columns; j++) {
                a[r * columns + j] -= factor * a[i * columns + j];
            }
        }
    }
}

void hold_respond(const held_loop *h, double frequency, int axis, double amplitude, double period, double lead, double *phasor)
{
    const double angle = 2.0 * PI * frequency * period;
    const double cos_lead = amplitude * cos(2.0 * PI * frequency * lead), sin_lead = amplitude * sin(2.0 * PI * frequency * lead);
    double a[8][9];
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            const double loop = loop_entry(h, h->phi, h->gamma, i, j);
            /* (exp(i angle) - loop) phasor = force, real and imaginary part */
            const double real = (i == j ? cos(angle) : 0.0) - loop, imaginary = i == j ? sin(angle) : 0.0;
            a[i][j] = real;
            a[i][4 + j] = -imaginary;
            a[4 + i][j] = imaginary;
            a[4 + i][4 + j] = real;
        }
        const double push = h->gamma[2 * i] * h->mix[axis] + h->gamma[2 * i + 1] * h->mix[2 + axis];
        a[i][8] = push * cos_lead;
        a[4 + i][8] = push * sin_lead;
    }
    eliminate(&a[0][0], 8, 9);
    for (int i = 0; i < 4; i++) {
        phasor[2 * i] = a[i][8];
        phasor[2 * i + 1] = a[4 + i][8];
    }
}

void hold_respond_within(const held_loop *h, const double *phi, const double *gamma, double frequency, int axis, double amplitude, double lead,
                         const double *phasor, double *within)
{
    const double added[2] = {amplitude * cos(2.0 * PI * frequency * lead), amplitude * sin(2.0 * PI * frequency * lead)};
    for (int part = 0; part < 2; part++) {
        double force[2];
        for (int a = 0; a < 2; a++) {
            force[a] = h->mix[2 * a + axis] * added[part];
            for (int j = 0; j < 4; j++) {
                force[a] += h->gain[4 * a + j] * phasor[2 * j + part];
            }
        }
        for (int i = 0; i < 4; i++) {
            double state = gamma[2 * i] * force[0] + gamma[2 * i + 1] * force[1];
            for (int j = 0; j < 4; j++) {
                state += phi[4 * i + j] * phasor[2 * j + part];
            }
            within[2 * i + part] = state;
        }
    }
}

void hold_straighten(const held_loop *h, const double *phi, const double *gamma, double w, double rest, double straight[16])
{
    const double cosine = cos(w * rest), sine = sin(w * rest);
    double a[4][8];
    /* straight way = back whole, transposed: way to where the motion is straightened, whole over a period, back by the oscillator. */
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < 4; i++) {
            a[j][i] = loop_entry(h, phi, gamma, i, j);
        }
        for (int i = 0; i < 4; i += 2) {
            const double q = loop_entry(h, h->phi, h->gamma, i, j), q_dot = loop_entry(h, h->phi, h->gamma, i + 1, j);
            a[j][4 + i] = cosine * q - sine / w * q_dot;
            a[j][5 + i] = w * sine * q + cosine * q_dot;
        }
    }
    eliminate(&a[0][0], 4, 8);
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j < 4; j++) {
            straight[4 * i + j] = a[j][4 + i];
        }
    }
}

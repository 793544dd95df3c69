#include "slow.h"

#include <string.h>

/* Solves S² + C S + K = 0 from the guess in `rate`, by Newton's method with S on its diagonal only: each iteration leaves about the ratio
   of the coupling to 2ω of the error. */
static void find_rate(gyro_slow *slow)
{
    enum { MOST = 200 };
    /* Of S: what rounding leaves of a correction, and what it must come to. */
    static const double ROUNDING = 4e-16, ENOUGH = 1e-13;
    matrix *s = &slow->rate;
    double change = 1.0, before = INFINITY;
    for (int i = 0; i < 2; i++) {
        if (!(s->e[i][i].im > 0.0)) {
            s->e[i][i] = number_of(0.0, sqrt(slow->stiffness.e[i][i].re));
            s->e[i][1 - i] = number_of(0.0, 0.0);
        }
    }
    for (int k = 0; k < MOST && change > ROUNDING && (change > ENOUGH || change < 0.5 * before); k++) {
        const matrix residue = matrix_plus(matrix_times(matrix_plus(*s, slow->damping), *s), slow->stiffness);
        matrix correction;
        for (int i = 0; i < 2; i++) {
            for (int j = 0; j < 2; j++) {
                correction.e[i][j] = over(residue.e[i][j], plus(s->e[i][i], s->e[j][j]));
            }
        }
        *s = matrix_plus(*s, matrix_scaled(correction, -1.0));
        before = change;
        change = largest(correction) / largest(*s);
    }
    if (!(change <= ENOUGH)) {
        *s = diagonal(number_of(NAN, NAN));
    }
}

/* How often `size` must be halved to be below 1; 0 for what is not finite. */
static int halvings(double size)
{
    int n = 0;
    for (; gyro_finite(size) && size >= 1.0; n++) {
        size *= 0.5;
    }
    return n;
}

static double halved(double x, int times)
{
    for (; times > 0; times--) {
        x *= 0.5;
    }
    return x;
}

/* e^a and φ(a) = (e^a - 1)/a by the series of φ on a/2^k, then k doublings. */
static void exponential(matrix a, matrix *decay, matrix *phi)
{
    /* The rest of the series on ½ is 0.5^14/15! < 1e-16. */
    enum { TERMS = 14 };
    const matrix one = diagonal(number_of(1.0, 0.0));
    /* The norm of a 2 x 2 matrix is at most twice its largest entry. */
    int doublings = halvings(4.0 * largest(a));
    a = matrix_scaled(a, halved(1.0, doublings));
    *phi = one;
    for (int j = TERMS; j > 1; j--) {
        *phi = matrix_plus(one, matrix_scaled(matrix_times(a, *phi), 1.0 / j));
    }
    *decay = matrix_plus(one, matrix_times(a, *phi));
    for (; doublings > 0; doublings--) {
        *phi = matrix_scaled(matrix_times(matrix_plus(*decay, one), *phi), 0.5);
        *decay = matrix_times(*decay, *decay);
    }
}

static matrix drift(const gyro_slow *slow) { return matrix_plus(slow->rate, diagonal(number_of(0.0, -slow->carrier))); }

void gyro_find_slow(gyro_slow *slow, matrix stiffness, matrix damping, double carrier, double inverse_mass, double step)
{
    const int moved = memcmp(&stiffness, &slow->stiffness, sizeof stiffness) != 0 || memcmp(&damping, &slow->damping, sizeof damping) != 0;
    if (moved) {
        slow->stiffness = stiffness;
        slow->damping = damping;
        find_rate(slow);
    }
    if (moved || carrier != slow->carrier || step != slow->step) {
        matrix phi;
        slow->carrier = carrier;
        slow->step = step;
        const matrix fast = matrix_plus(matrix_plus(damping, slow->rate), diagonal(number_of(0.0, carrier)));
        slow->input = matrix_scaled(inverse(fast), inverse_mass);
        exponential(matrix_scaled(drift(slow), step), &slow->decay, &phi);
        slow->gain = matrix_scaled(matrix_times(phi, slow->input), step);
    }
}

/* Cholesky's root of a Hermitian matrix, never below 0 by rounding. */
static matrix root_of(matrix a)
{
    matrix root = diagonal(number_of(0.0, 0.0));
    const double first = sqrt(a.e[0][0].re > 0.0 ? a.e[0][0].re : 0.0);
    root.e[0][0] = number_of(first, 0.0);
    if (first > 0.0) {
        root.e[1][0] = scaled(a.e[1][0], 1.0 / first);
    }
    const double rest = a.e[1][1].re - square(root.e[1][0]);
    root.e[1][1] = number_of(sqrt(rest > 0.0 ? rest : 0.0), 0.0);
    return root;
}

matrix gyro_gathered(const gyro_slow *slow, matrix noise)
{
    /* The series of ∫ e^(A s) N e^(A s)* ds = h (N + h/2 (A N + N A*) + ...): each term is below 1/(j + 1)! of the first; 1e-16 at 18. */
    enum { TERMS = 18 };
    matrix a = drift(slow), term, sum, decay, phi;
    int doublings = halvings(4.0 * largest(a) * slow->step);
    const double h = halved(slow->step, doublings);
    term = matrix_scaled(noise, h);
    sum = term;
    for (int j = 1; j < TERMS; j++) {
        const matrix turned = matrix_times(a, term);
        term = matrix_scaled(matrix_plus(turned, adjoint(turned)), h / (j + 1));
        sum = matrix_plus(sum, term);
    }
    exponential(matrix_scaled(a, h), &decay, &phi);
    for (; doublings > 0; doublings--) {
        sum = matrix_plus(sum, matrix_times(matrix_times(decay, sum), adjoint(decay)));
        decay = matrix_times(decay, decay);
    }
    return root_of(sum);
}

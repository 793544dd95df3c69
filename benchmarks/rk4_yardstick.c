/* What a plain C program pays for the same motion: classical Runge-Kutta of order 4 in steps of 1 us, every coefficient divided by the mass
   beforehand, rate and forces new every fifth step. The yardstick of benchmarks/plant_cost.py, compiled with the FMU's own flags. */

#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { STEPS = 5 };
static const double STEP = 1e-6; /* s */

/* Over the mass: stiffness xx, yy, xy [1/s2], damping xx, yy, xy [1/s]. */
typedef struct {
    double kxx, kyy, kxy, dxx, dyy, dxy;
} coefficients;

/* The rate of s = (x, x', y, y') under the rate `turn`, twice the angular rate [1/s], and the force over the mass (fx, fy) [m/s2]. */
static void rate_of(const coefficients *c, double turn, double fx, double fy, const double s[4], double rate[4])
{
    rate[0] = s[1];
    rate[1] = fx - c->kxx * s[0] - c->kxy * s[2] - c->dxx * s[1] - c->dxy * s[3] + turn * s[3];
    rate[2] = s[3];
    rate[3] = fy - c->kxy * s[0] - c->kyy * s[2] - c->dxy * s[1] - c->dyy * s[3] - turn * s[1];
}

static void step_once(const coefficients *c, double turn, double fx, double fy, double s[4])
{
    double a[4], b[4], d[4], e[4], at[4];
    rate_of(c, turn, fx, fy, s, a);
    for (int i = 0; i < 4; i++) {
        at[i] = s[i] + 0.5 * STEP * a[i];
    }
    rate_of(c, turn, fx, fy, at, b);
    for (int i = 0; i < 4; i++) {
        at[i] = s[i] + 0.5 * STEP * b[i];
    }
    rate_of(c, turn, fx, fy, at, d);
    for (int i = 0; i < 4; i++) {
        at[i] = s[i] + STEP * d[i];
    }
    rate_of(c, turn, fx, fy, at, e);
    for (int i = 0; i < 4; i++) {
        s[i] += STEP / 6.0 * (a[i] + 2.0 * (b[i] + d[i]) + e[i]);
    }
}

/* `count` times 5 us on the state s, shape (4). Inputs, shape (rows, 3): angular rate [rad/s] and forces over the mass [m/s2]; a row a time,
   in turns, from row `first` on. */
EXPORT void rk4_run(const coefficients *c, double s[4], const double inputs[][3], int64_t rows, int64_t first, int64_t count)
{
    for (int64_t k = 0; k < count; k++) {
        const double *row = inputs[(first + k) % rows];
        for (int i = 0; i < STEPS; i++) {
            step_once(c, 2.0 * row[0], row[1], row[2], s);
        }
    }
}

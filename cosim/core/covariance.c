#include "covariance.h"

#include "known_model.h"

/* Whether the damping takes energy of every motion. Estimates of few samples need not, and the noise force goes with its root. */
static int is_damped(const known *k)
{
    const double *d = k->p + 3;
    return d[0] > 0.0 && d[1] > 0.0 && d[0] * d[1] > d[2] * d[2];
}

/* out = F M. The rate follows itself and its slope, which stays; the states follow states and rate; the lagging voltages these, and themselves.
   Sums run along rows, side by side: one after the other they would wait for each other. */
static void follow(double F[NZ][NZ], double M[NZ][NZ], double out[restrict NZ][NZ])
{
    for (int i = 0; i < SLOPE; i++) {
        const int also = i == OMEGA ? SLOPE : i;
        for (int j = 0; j < NZ; j++) {
            double sum = 0.0;
            for (int r = 0; r < LAG; r++) {
                sum += F[i][r] * M[r][j];
            }
            out[i][j] = i < OMEGA ? sum : sum + F[i][also] * M[also][j];
        }
    }
    memcpy(out[SLOPE], M[SLOPE], sizeof out[SLOPE]);
}

void covariance_predict(filter *f, double F[NZ][NZ], const passage *way)
{
    moving *n = &f->now;
    const double none[2] = {0.0, 0.0}, *g = way->force, T = f->m.period;
    double FP[NZ][NZ], transposed[NZ][NZ], thermal[4];
    F[OMEGA][SLOPE] = T;
    follow(F, n->P, FP);
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < NZ; j++) {
            transposed[i][j] = FP[j][i];
        }
    }
    follow(F, transposed, n->P);
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < i; j++) {
            n->P[i][j] = n->P[j][i];
        }
    }
    double stray[NZ] = {0.0};
    for (int i = 0; i < NZ; i++) {
        for (int r = 0; r < NZ; r++) {
            stray[i] += F[i][r] * n->stray[r];
        }
    }
    memcpy(n->stray, stray, sizeof stray);
    n->P[OMEGA][OMEGA] += f->walk * f->walk * f->m.period;
    n->P[SLOPE][SLOPE] += f->slope_walk * f->slope_walk * f->m.period;
    if (HAS_THERMAL && is_damped(&f->k)) {
        known_thermal(&f->k, way->s[NODES - 1], none, n->z[OMEGA], thermal);
        for (int i = 0; i < NS; i++) {
            for (int j = 0; j < NS; j++) {
                n->P[i][j] += g[i * 2] * (thermal[0] * g[j * 2] + thermal[1] * g[j * 2 + 1]) +
                              g[i * 2 + 1] * (thermal[2] * g[j * 2] + thermal[3] * g[j * 2 + 1]);
            }
        }
    }
}

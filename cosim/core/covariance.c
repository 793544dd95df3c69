#include "covariance.h"

#include "known_model.h"

/* Whether the damping takes energy of every motion. Estimates of few samples need not, and the noise force goes with its root. */
static int is_damped(const known *k)
{
    const double *d = k->p + 3;
    return d[0] > 0.0 && d[1] > 0.0 && d[0] * d[1] > d[2] * d[2];
}

/* out = F M. The rate follows itself and its slope, which stays; the states follow states and rate; the lagging voltages these, and themselves. */
static void follow(double F[NZ][ZW], double M[NZ][ZW], double out[NZ][ZW])
{
    for (int i = 0; i < NZ; i++) {
        const int also = i == OMEGA ? SLOPE : i;
        for (int b = 0; b < ZB; b++) {
            wide sum = (i < OMEGA ? 0.0 : F[i][also]) * wide_of(M[also])[b];
            for (int r = 0; r < LAG && i < SLOPE; r++) {
                sum += F[i][r] * wide_of(M[r])[b];
            }
            wide_row(out[i])[b] = sum;
        }
    }
}

void covariance_add_constants(const moving *n, double W[NP][NP], double P[NZ][ZW])
{
    double row[NP][NW], YW[NZ][NW];
    wide_clear(row[0], NP * NB);
    for (int q = 0; q < NP; q++) {
        memcpy(row[q], W[q], NP * sizeof *row[q]);
    }
    for (int i = 0; i < NZ; i++) {
        wide sum[NB] = {{0.0}};
        for (int q = 0; q < NP; q++) {
            for (int b = 0; b < NB; b++) {
                sum[b] += n->Y[i][q] * wide_of(row[q])[b];
            }
        }
        memcpy(YW[i], sum, sizeof sum);
    }
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < NZ; j++) {
            for (int q = 0; q < NW; q++) {
                P[i][j] += YW[i][q] * YW[j][q];
            }
        }
    }
}

void covariance_predict(filter *f, double F[NZ][ZW], const passage *way)
{
    moving *n = &f->now;
    const double none[2] = {0.0, 0.0}, *g = way->force, T = f->m.period;
    double FP[NZ][ZW], transposed[NZ][ZW], thermal[4];
    F[OMEGA][SLOPE] = T;
    follow(F, n->P, FP);
    wide_clear(transposed[0], NZ * ZB);
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
        known_thermal(&f->k, way->end, none, n->z[OMEGA], thermal);
        for (int i = 0; i < NS; i++) {
            for (int j = 0; j < NS; j++) {
                n->P[i][j] += g[i * 2] * (thermal[0] * g[j * 2] + thermal[1] * g[j * 2 + 1]) +
                              g[i * 2 + 1] * (thermal[2] * g[j * 2] + thermal[3] * g[j * 2 + 1]);
            }
        }
    }
}

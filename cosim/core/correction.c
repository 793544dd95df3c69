#include "correction.h"

#include "prediction.h"

#define OUTLIER 15.0 /* squared innovation over its fast variance from which the full one is worth working out */
#define UNTOLD 1e30  /* noise of a sample at the end of the converter, which tells nothing [V2] */
#define NOISE_SHARE 0.01 /* of a sample in the running mean of 1/S */

void filter_leave_out(const filter *f, const double v[2], double noise[2])
{
    for (int a = 0; a < 2; a++) {
        noise[a] = f->clipped && fabs(v[a]) >= f->top ? UNTOLD : noise[a];
    }
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

/* Corrects the slopes of z by `gain`, h [NW] being those of the voltage. What is seen late of z is w = (1 + lag A)^-1 z: by another lag the same
   correction of w is another one of z, A (1 + lag A)^-1 gain e by the lag. The gain depends on p that way, which counts where the motion is hardly known. */
static void correct_slopes(filter *f, const double gain[NZ], const double h[NW], double e)
{
    for (int i = 0; i < NZ; i++) {
        for (int b = 0; b < NB; b++) {
            wide_row(f->now.Y[i])[b] -= gain[i] * wide_of(h)[b];
        }
    }
    for (int i = 0; HAS_LAG && i < NS; i++) {
        double answer = 0.0;
        for (int j = 0; j < NS; j++) {
            answer += f->m.by_lag[i * NS + j] * gain[j] * e;
        }
        for (int q = 0; q < NP; q++) {
            f->now.Y[i][q] += answer * f->m.lag_by_p[q];
        }
    }
}

double filter_correct_axis(filter *f, const double *c, const double *by_p, double noise, double e)
{
    moving *n = &f->now;
    double Pc[ZW], gain[NZ], h[NW], S = noise, surprise = 0.0, strays = 0.0;
    double *row = f->H[f->rows], *told = f->r + f->rows;
    f->rows++;
    if (noise >= UNTOLD) {
        memset(row, 0, sizeof f->H[0]);
        *told = 0.0;
        return 0.0;
    }
    wide_copy(by_p, NB, h);
    wide_clear(Pc, ZB);
    for (int i = 0; i < NZ; i++) {
        if (c[i] == 0.0) {
            continue;
        }
        for (int b = 0; b < ZB; b++) {
            wide_row(Pc)[b] += c[i] * wide_of(n->P[i])[b];
        }
        for (int b = 0; b < NB; b++) {
            wide_row(h)[b] += c[i] * wide_of(n->Y[i])[b];
        }
        strays += c[i] * n->stray[i];
    }
    for (int i = 0; i < NZ; i++) {
        S += c[i] * Pc[i];
    }
    const double inverse = 1.0 / S, root = sqrt(inverse);
    if (e * e > OUTLIER * S) {
        surprise = e * e / (S + uncertainty(f, h));
    }
    for (int b = 0; b < NB; b++) {
        wide_row(row)[b] = root * wide_of(h)[b];
    }
    *told = e * root;
    if (isfinite(inverse)) {
        /* Trials of a start may have lost their numbers. */
        double *mean = f->inverse + ((f->rows - 1) & 1);
        *mean += NOISE_SHARE * (inverse - *mean);
    }
    for (int i = 0; i < NZ; i++) {
        gain[i] = Pc[i] * inverse;
        n->z[i] += gain[i] * e;
        n->stray[i] -= gain[i] * strays;
    }
    correct_slopes(f, gain, h, e);
    for (int i = 0; i < NZ; i++) {
        for (int b = 0; b < ZB; b++) {
            wide_row(n->P[i])[b] -= gain[i] * wide_of(Pc)[b];
        }
    }
    for (int i = 0; i < 2; i++) {
        const double g = gain[i == 0 ? OMEGA : SLOPE];
        n->sum[i] += g * e;
        n->sum_variance[i] += g * g * S * (1.0 + f->share);
    }
    return surprise;
}

double filter_correct(filter *f, const double v[2])
{
    double expected[2], C[2][NZ], by_p[2 * NW], noise[2], was[NZ];
    filter_expect(f, expected, C, by_p, noise);
    filter_leave_out(f, v, noise);
    memcpy(was, f->now.z, sizeof was);
    double surprise = filter_correct_axis(f, C[0], by_p, noise[0], v[0] - expected[0]);
    double e = v[1] - expected[1];
    for (int i = 0; i < NZ; i++) {
        e -= C[1][i] * (f->now.z[i] - was[i]);
    }
    return surprise + filter_correct_axis(f, C[1], by_p + NW, noise[1], e);
}

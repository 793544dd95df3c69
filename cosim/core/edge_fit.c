#include "edge_fit.h"

#define FITTED_MOST 1000 /* samples of a fit at most */
#define PRIOR 4e-4       /* squared noise of a position over what is expected of all terms but the pattern's own: 2e-5 and 1e-3 of the pattern's size */

double edge_course(const edge *e, const turning *by, int64_t from, int64_t to)
{
    return by->coupling * (sample_at(e, to)->swept - sample_at(e, from)->swept) + by->own * (double)(to - from) * e->period;
}

static void terms_at(const edge *e, int64_t k, int64_t at, const turning *by, double w, double size, double complex out[TERMS])
{
    const edge_sample *s = sample_at(e, k);
    const double t = (double)(k - at) * e->period;
    const advance even = pattern_advance(by->turn, w, t);
    const double complex uneven = cexp(-I * (edge_course(e, by, at, k) - by->turn * t));
    const double complex far = s->forced.z - s->near.z, far_v = (s->forced.v - s->near.v) / w, near_v = s->near.v / w;
    const double response[8] = {creal(far), cimag(far), creal(far_v), cimag(far_v), creal(s->near.z), cimag(s->near.z), creal(near_v), cimag(near_v)};
    out[0] = even.up * uneven;
    out[1] = even.down * uneven;
    out[2] = out[0] * (t / FITTED);
    out[3] = out[1] * (t / FITTED);
    out[4] = 1.0;
    for (int i = 0; i < 8; i++) {
        out[5 + i] = response[i] / size;
    }
}

/* The position of the pattern without what is wrong of the response to the tones. */
static double complex clean(const edge *e, const double complex wrong[TERMS], int64_t k, double w, double size)
{
    const turning none = {0.0, 0.0, 0.0};
    double complex terms[TERMS], z = sample_at(e, k)->free.z;
    terms_at(e, k, k, &none, w, size, terms);
    for (int i = MOVING_TERMS; i < TERMS; i++) {
        z -= wrong[i] * terms[i];
    }
    return z;
}

void edge_fit(const edge *e, int count, int64_t first, int64_t last, int64_t at, const turning *by, double w, double size,
              const double complex wrong[TERMS], double complex found[TERMS])
{
    double complex A[TERMS][TERMS], terms[TERMS];
    const int64_t stride = (last - first) / FITTED_MOST + 1;
    memset(A, 0, sizeof A);
    memset(found, 0, TERMS * sizeof *found);
    for (int64_t k = first; k < last; k += stride) {
        const double complex z = clean(e, wrong, k, w, size);
        terms_at(e, k, at, by, w, size, terms);
        for (int i = 0; i < count; i++) {
            for (int j = 0; j <= i; j++) {
                A[i][j] += conj(terms[i]) * terms[j];
            }
            found[i] += conj(terms[i]) * z;
        }
    }
    /* Terms that few samples can't tell apart stay small, and that of a tone that is not driven zero. */
    for (int i = PATTERN_TERMS; i < count; i++) {
        A[i][i] += PRIOR;
    }
    /* Cholesky, in place: A = L D L*. */
    for (int j = 0; j < count; j++) {
        for (int i = j + 1; i < count; i++) {
            const double complex factor = A[i][j] / A[j][j];
            for (int q = j + 1; q <= i; q++) {
                A[i][q] -= factor * conj(A[q][j]);
            }
            found[i] -= factor * found[j];
        }
    }
    for (int j = count - 1; j >= 0; j--) {
        for (int i = j + 1; i < count; i++) {
            found[j] -= conj(A[i][j]) * found[i];
        }
        found[j] /= A[j][j];
    }
}

/* Recurrences of Taylor coefficients: of each the k-th from lower ones of its own and those up to k of what it is made of. A. Griewank,
   A. Walther, Evaluating Derivatives, 2nd edition 2008, section 13.2. */

#ifndef GYRO_SERIES_H
#define GYRO_SERIES_H

#include "generated/model.h"

/* Powers 0 .. GYRO_MOST_POWER. About half the decimal digits asked for, in natural logarithms, is cheapest near a singularity (A. Jorba,
   M. Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods, Experimental Mathematics 14, 2005). */
enum { GYRO_MOST_POWER = 16, GYRO_TERMS = GYRO_MOST_POWER + 1 };

/* What an effect's series asks for. */
typedef struct {
    int rows; /* of coefficients; -1: it has no series */
    int constants;
    int corners;
    int bounds;
} gyro_series_size;

/* Where that is. */
typedef struct {
    int row, constant, corner, bound;
} gyro_series_place;

/* The forces that bend the motion. */
typedef struct {
    int holds; /* 1: all of them have series */
    int n;     /* how many act */
    int corners, bounds;
    int effect[GYRO_N_EFFECTS];
    gyro_series_place place[GYRO_N_EFFECTS];
} gyro_series_plan;

/* Of a constant. */
static inline double first_only(int k, double c) { return k == 0 ? c : 0.0; }

/* Sums run over what is known before and take in the newest coefficients last, so that a processor need not wait for those. */

/* Of a b. */
static inline double series_product(const double *a, const double *b, int k)
{
    double even = 0.0, odd = 0.0;
    int j = 1;
    for (; j + 1 < k; j += 2) {
        odd += a[j] * b[k - j];
        even += a[j + 1] * b[k - j - 1];
    }
    odd += j < k ? a[j] * b[k - j] : 0.0;
    return (even + odd) + (k > 0 ? a[0] * b[k] + a[k] * b[0] : a[0] * b[0]);
}

/* Of a^2. */
static inline double series_square(const double *a, int k)
{
    double sum = 0.0;
    for (int j = 1; 2 * j < k; j++) {
        sum += a[j] * a[k - j];
    }
    sum = k % 2 == 0 && k > 0 ? 2.0 * sum + a[k / 2] * a[k / 2] : 2.0 * sum;
    return sum + (k > 0 ? 2.0 * a[0] * a[k] : a[0] * a[0]);
}

/* Of p = a^e, k > 0: a p' = e a' p. */
static inline double series_power(const double *a, const double *p, double e, int k)
{
    const double per = 1.0 / (k * a[0]);
    double even = 0.0, odd = 0.0;
    int j = 1;
    for (; j + 1 < k; j += 2) {
        odd += ((e + 1.0) * j - k) * (a[j] * p[k - j]);
        even += ((e + 1.0) * (j + 1) - k) * (a[j + 1] * p[k - j - 1]);
    }
    odd += j < k ? ((e + 1.0) * j - k) * (a[j] * p[k - j]) : 0.0;
    /* What has no power series, as a root of zero, gives no number; a constant is one. */
    return e == 0.0 ? 0.0 : ((even + odd) + e * k * (a[k] * p[0])) * per;
}

/* Of y, k > 0, where y' = a' f. */
static inline double series_integral(const double *a, const double *f, int k)
{
    const double per = 1.0 / k;
    double even = 0.0, odd = 0.0;
    int j = 1;
    for (; j + 1 < k; j += 2) {
        odd += j * (a[j] * f[k - j]);
        even += (j + 1) * (a[j + 1] * f[k - j - 1]);
    }
    odd += j < k ? j * (a[j] * f[k - j]) : 0.0;
    return ((even + odd) + k * (a[k] * f[0])) * per;
}

#endif

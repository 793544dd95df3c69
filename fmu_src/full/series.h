/* Recurrences of Taylor coefficients: of each the k-th from lower ones of its own and those up to k of what it is made of. A. Griewank,
   A. Walther, Evaluating Derivatives, 2nd edition 2008, section 13.2. */

#ifndef GYRO_SERIES_H
#define GYRO_SERIES_H

#include "generated/model.h"
#include "pair.h"

/* Powers 0 .. GYRO_MOST_POWER. About half the decimal digits asked for, in natural logarithms, is cheapest near a singularity (A. Jorba,
   M. Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods, Experimental Mathematics 14, 2005). */
enum { GYRO_MOST_POWER = 16, GYRO_TERMS = GYRO_MOST_POWER + 1 };

/* 1/k: a division takes as long as four products. */
static const double GYRO_PART[GYRO_TERMS + 1] = {0.0,      1.0,      1.0 / 2,  1.0 / 3,  1.0 / 4,  1.0 / 5,  1.0 / 6,  1.0 / 7,  1.0 / 8,
                                                 1.0 / 9,  1.0 / 10, 1.0 / 11, 1.0 / 12, 1.0 / 13, 1.0 / 14, 1.0 / 15, 1.0 / 16, 1.0 / 17};

/* What an effect's series asks for. */
typedef struct {
    int rows; /* of coefficients; -1: it has no series */
    int constants;
    int corners;
    int bounds;
    unsigned shared; /* which of the shared rows, a bit each */
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
    unsigned shared;
    int effect[GYRO_N_EFFECTS];
    gyro_series_place place[GYRO_N_EFFECTS];
} gyro_series_plan;

/* Of a constant. */
static inline gyro_pair first_only(int k, gyro_pair c) { return k == 0 ? c : both(0.0); }

/* Coefficient k of what is not negative. */
static inline gyro_pair first_size(int k, gyro_pair c) { return k == 0 ? pair_size(c) : c; }

/* Sums run over what is known before and take in the newest coefficients last, so that a processor need not wait for those. */

/* Of a b. */
static inline gyro_pair series_product(const gyro_pair *a, const gyro_pair *b, int k)
{
    const gyro_pair *back = b + k;
    gyro_pair even = both(0.0), odd = both(0.0);
    int j = 1;
    for (; j + 1 < k; j += 2) {
        odd = pair_sum(odd, pair_product(a[j], back[-j]));
        even = pair_sum(even, pair_product(a[j + 1], back[-j - 1]));
    }
    if (j < k) {
        odd = pair_sum(odd, pair_product(a[j], back[-j]));
    }
    const gyro_pair last = pair_product(a[0], back[0]);
    return pair_sum(pair_sum(even, odd), k > 0 ? pair_sum(last, pair_product(a[k], b[0])) : last);
}

/* Of a^2. */
static GYRO_INLINE gyro_pair series_square(const gyro_pair *a, int k)
{
    const gyro_pair *back = a + k;
    gyro_pair sum = both(0.0);
    for (int j = 1; 2 * j < k; j++) {
        sum = pair_sum(sum, pair_product(a[j], back[-j]));
    }
    sum = pair_sum(sum, sum);
    if (k % 2 == 0 && k > 0) {
        sum = pair_sum(sum, pair_product(a[k / 2], a[k / 2]));
    }
    return pair_sum(sum, pair_product(k > 0 ? pair_sum(a[0], a[0]) : a[0], back[0]));
}

/* Of p = a^e, k > 0: a p' = e a' p. */
static inline gyro_pair series_power(const gyro_pair *a, const gyro_pair *p, gyro_pair e, int k)
{
    const gyro_pair *back = p + k, step = pair_sum(e, both(1.0));
    gyro_pair sum = both(0.0), weight = both(-k);
    for (int j = 1; j < k; j++) {
        weight = pair_sum(weight, step);
        sum = pair_sum(sum, pair_product(weight, pair_product(a[j], back[-j])));
    }
    const gyro_pair inverse = pair_ratio(both(1.0), a[0]);
    return pair_sum(pair_product(pair_scaled(GYRO_PART[k], inverse), sum), pair_product(pair_product(e, pair_product(inverse, p[0])), a[k]));
}

/* Below this share of its rate in a step, a base is too near zero for its powers: their recurrence divides by it, and where a whole exponent
   keeps the true terms small, rounding grows with each by the inverse. */
static const double GYRO_LEAST_BASE = 1e-5;

static inline int is_near_zero(const gyro_pair *a, int lane) { return fabs(lane_of(a[0], lane)) < GYRO_LEAST_BASE * fabs(lane_of(a[1], lane)); }

/* The same where any exponent may be set; no number too near zero. */
static inline gyro_pair series_any_power(const gyro_pair *a, const gyro_pair *p, gyro_pair e, int k)
{
    gyro_pair next = both(0.0);
    if (is_both(e, 1.0)) {
        next = a[k];
    } else if (k == 1 && (is_near_zero(a, 0) || is_near_zero(a, 1)) && !is_zero(e)) {
        next = both(NAN);
    } else if (!is_zero(e)) {
        next = series_power(a, p, e, k);
    }
    return next;
}

/* A function of what changes by so much shows in the powers that there are. */
static const double GYRO_SHOWN = 0.5 * GYRO_MOST_POWER;

/* By how much a base may change so that its power shows: the largest term of (1 + r)^e is number e r/(1 + r). What is below e^-25, 1e-11, need not
   show. */
static inline double room_of_power(double base, double e)
{
    return e > GYRO_SHOWN ? larger(base * (GYRO_SHOWN / (e - GYRO_SHOWN)), gyro_exp(-25.0 / e) - base) : INFINITY;
}

/* Of y, k > 0, where y' = a' f; `rate` holds j a_j. */
static inline gyro_pair series_integral(const gyro_pair *rate, const gyro_pair *a, const gyro_pair *f, int k)
{
    const gyro_pair *back = f + k;
    gyro_pair even = both(0.0), odd = both(0.0);
    int j = 1;
    for (; j + 1 < k; j += 2) {
        odd = pair_sum(odd, pair_product(rate[j], back[-j]));
        even = pair_sum(even, pair_product(rate[j + 1], back[-j - 1]));
    }
    if (j < k) {
        odd = pair_sum(odd, pair_product(rate[j], back[-j]));
    }
    return pair_sum(pair_scaled(GYRO_PART[k], pair_sum(even, odd)), pair_product(a[k], f[0]));
}

#endif

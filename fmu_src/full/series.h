/* Recurrences of Taylor coefficients: of each the k-th from lower ones of its own and those up to k of what it is made of. A. Griewank,
   A. Walther, Evaluating Derivatives, 2nd edition 2008, section 13.2. */

#ifndef GYRO_SERIES_H
#define GYRO_SERIES_H

#include "generated/effects.h"
#include "pair.h"
#include "pair_math.h"

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

/* Where a state stands that follows a displacement (bouc_wen.h). */
typedef struct {
    int effect;
    int pair, lane;             /* its series */
    int axis;                   /* of the displacement: 0 x, 1 y */
    int state, place, speed;    /* it, the displacement, its rate, among the states of a view */
    int length, beta, gamma, n; /* parameters by value reference */
} gyro_bouc_wen;

/* Such a state z by u, the displacement from where z is zero in lengths, and back, by powers of c |u|^n and c |z|^n. */
enum { GYRO_Z_TERMS = 10 };
typedef struct {
    double n;
    double z[GYRO_Z_TERMS]; /* of z/u */
    double u[GYRO_Z_TERMS]; /* of u/z */
    double room;            /* how large u may be; 0 where n is whole: then z has a series of its own */
} gyro_bouc_wen_curve;

/* Such a state beside its zero: what its series is given instead of what its rate makes of it. */
enum { GYRO_GIVEN_TERMS = 5 };
typedef struct {
    const gyro_bouc_wen *of;
    const gyro_bouc_wen_curve *curve;
    double c[2];                   /* in this direction of the motion, where z is below zero, and above */
    double per_length;             /* 1/m */
    double z;                      /* where the step begins, as if it followed the displacement in proportion */
    double from, way;              /* the displacement there, and how far it goes, in lengths */
    double most_bend;              /* |c| |u|^n at most */
    double less[GYRO_GIVEN_TERMS]; /* coefficients of what it lies off that */
} gyro_given;

/* The forces that bend the motion. */
typedef struct {
    int holds; /* 1: all of them have series */
    int n;     /* how many act */
    int corners, bounds;
    unsigned shared;
    int effect[GYRO_N_EFFECTS];
    gyro_series_place place[GYRO_N_EFFECTS];
    gyro_bouc_wen_curve curve[GYRO_N_STATES]; /* of states that follow a displacement */
} gyro_series_plan;

/* One axis: what follows its displacement, and its force over that [N]. */
typedef struct {
    const gyro_bouc_wen *of; /* NULL: none */
    double slope, per_length;
    double scale[2];  /* |c|^(1/n) toward zero and away from it */
    double back[2];   /* one over that */
    int curve[2];     /* of the table */
} gyro_follower;

typedef struct {
    gyro_follower axis[2];
    double n;
    int holds; /* 1: they are all that bends the motion */
} gyro_followers;

/* The value of a polynomial of degree n at t, and its rate. */
static inline double value_at(const double *c, int n, double t)
{
    double sum = c[n];
    for (int j = n - 1; j >= 0; j--) {
        sum = sum * t + c[j];
    }
    return sum;
}

static inline gyro_pair pair_value_at(const double *c, int n, gyro_pair t)
{
    gyro_pair sum = both(c[n]);
    for (int j = n - 1; j >= 0; j--) {
        sum = pair_sum(pair_product(sum, t), both(c[j]));
    }
    return sum;
}

static inline double rate_at(const double *c, int n, double t)
{
    double sum = n * c[n];
    for (int j = n - 1; j > 0; j--) {
        sum = sum * t + j * c[j];
    }
    return sum;
}

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

/* Below this share of its rate in a step, or of the next coefficient, a base is too near zero for its powers: their recurrence divides by it, and
   where a whole exponent keeps the true terms small, rounding grows with each by the inverse. */
static const double GYRO_LEAST_BASE = 1e-5;

static inline double unless_near_zero(const gyro_pair *a, int k, int lane, double power)
{
    return fabs(lane_of(a[0], lane)) < GYRO_LEAST_BASE * fabs(lane_of(a[k], lane)) ? NAN : power;
}

/* The same where any exponent may be set; no number too near zero. */
static inline gyro_pair series_any_power(const gyro_pair *a, const gyro_pair *p, gyro_pair e, int k)
{
    gyro_pair next = both(0.0);
    if (is_both(e, 1.0)) {
        next = a[k];
    } else if (!is_zero(e)) {
        next = series_power(a, p, e, k);
        if (k <= 2) {
            next = pair_of(unless_near_zero(a, k, 0, lane_of(next, 0)), unless_near_zero(a, k, 1, lane_of(next, 1)));
        }
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

/* The functions of math.h that a model may call, from + - * / and sqrt alone, which IEEE 754 fixes to the last bit: libm differs between
   platforms. Off by less than one unit in the last place (ulp), or than what stands beside them; special values as in C99, annex F.
   tests/fmu/test_math.py holds them against mpmath. */

#ifndef GYRO_MATH_H
#define GYRO_MATH_H

#include <math.h>

#include "generated/names.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

double gyro_exp(double x);
double gyro_expm1(double x);
double gyro_log(double x);
double gyro_log1p(double x); /* 3 ulp */
double gyro_pow(double x, double y);
double gyro_power(double x, double y); /* the same for x > 0 in a fifth of the time: 3 |y log x| + 2 ulp */
double gyro_sin(double x);
double gyro_cos(double x);
double gyro_tan(double x);           /* 3 ulp */
double gyro_atan(double x);          /* 2 ulp */
double gyro_atan2(double y, double x); /* 3 ulp */
double gyro_asin(double x);          /* 3 ulp */
double gyro_acos(double x);          /* 3 ulp */
double gyro_sinh(double x);          /* 3 ulp */
double gyro_cosh(double x);          /* 3 ulp */
double gyro_tanh(double x);          /* 3 ulp */

/* Whether x is neither infinite nor NaN. */
static inline int gyro_finite(double x) { return x - x == 0.0; }

static inline double gyro_fabs(double x) { return x < 0.0 ? -x : x == 0.0 ? 0.0 : x; }

/* The nearest whole number, ties to even: beyond 2^52 every double is one. */
static inline double gyro_rint(double x)
{
    const double big = 4503599627370496.0;
    double whole = x;
    if (x > 0.0 && x < big) {
        whole = (x + big) - big;
    } else if (x < 0.0 && x > -big) {
        whole = -((big - x) - big);
    }
    return whole;
}

static inline double gyro_floor(double x)
{
    const double whole = gyro_rint(x);
    return whole > x ? whole - 1.0 : whole;
}

static inline double gyro_ceil(double x) { return -gyro_floor(-x); }

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

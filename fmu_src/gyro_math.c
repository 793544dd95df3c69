/* Exponentials, logarithms, powers and what follows from them. Each reduces its argument so far that a short Taylor series is exact to
   2^-57; the last addition is of a large exact and a small rounded number. */

#include "gyro_math.h"

#include <stdint.h>
#include <string.h>

#include "double2.h"
#include "math_series.h"

static uint64_t bits_of(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* 2^n, -1022 <= n <= 1023. */
static double power_of_2(int n)
{
    const uint64_t bits = (uint64_t)(n + 1023) << 52;
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* x 2^n, -2100 <= n <= 2100, in steps of which all but the last are exact for x in [1/2, 2]. */
static double scaled_by_2(double x, int n)
{
    for (; n > 1023; n -= 1023) {
        x *= power_of_2(1023);
    }
    for (; n < -969; n += 969) {
        x *= power_of_2(-969);
    }
    return x * power_of_2(n);
}

/* x + tail = n ln 2 + main - rest, |main| < 0.347. */
typedef struct {
    int n;
    double main, rest;
} reduced;

static reduced reduce(double x, double tail)
{
    const double n = (x * PER_LN2 + MATH_WHOLE) - MATH_WHOLE;
    const double main = x - n * LN2_HIGH, rest = n * LN2_LOW - tail;
    return (reduced){(int)n, main, rest};
}

/* The sum of c[i] x^i, by pairs of pairs: a processor does those side by side, where Horner's rule waits for each product and sum. */
static inline double polynomial(const double c[MATH_TERMS], double x)
{
    const double x_2 = x * x, x_4 = x_2 * x_2, x_8 = x_4 * x_4;
    const double first = (c[0] + c[1] * x) + (c[2] + c[3] * x) * x_2, second = (c[4] + c[5] * x) + (c[6] + c[7] * x) * x_2;
    const double third = (c[8] + c[9] * x) + (c[10] + c[11] * x) * x_2;
    return (first + second * x_4) + (third + c[12] * x_4) * x_8;
}

/* e^(main - rest) - 1 - main: the series to r^14/14!, of which 1e-19 is left at 0.347. */
static double bend(double main, double rest)
{
    const double r = main - rest;
    return r * r * polynomial(PER_FACTORIAL, r) - rest;
}

/* e^(x + tail). */
static double exp_of_sum(double x, double tail)
{
    double result;
    if (x > 709.8) {
        result = INFINITY;
    } else if (x < -746.0) {
        result = 0.0;
    } else if (x == x) {
        const reduced r = reduce(x, tail);
        result = scaled_by_2(1.0 + (r.main + bend(r.main, r.rest)), r.n);
    } else {
        result = x;
    }
    return result;
}

double gyro_exp(double x) { return exp_of_sum(x, 0.0); }

double gyro_expm1(double x)
{
    double result;
    if (x > 40.0) {
        result = gyro_exp(x);
    } else if (x < -40.0) {
        result = -1.0;
    } else if (x > -1e-17 && x < 1e-17) {
        result = x; /* with its sign, where it is 0 */
    } else if (x == x) {
        const reduced r = reduce(x, 0.0);
        const double less = 1.0 - power_of_2(-r.n);
        const double2 sum = sum_of(less, r.main);
        result = scaled_by_2(sum.high + (sum.low + bend(r.main, r.rest)), r.n);
    } else {
        result = x;
    }
    return result;
}

/* x = 2^n (1 + f), 1 + f in [1/sqrt 2, sqrt 2), for finite x > 0. */
static int split(double x, double *f)
{
    int n = 0;
    if (x < 2.2250738585072014e-308) {
        x *= power_of_2(54);
        n = -54;
    }
    const uint64_t bits = bits_of(x);
    const uint64_t fraction = (bits & UINT64_C(0xfffffffffffff)) | (UINT64_C(1023) << 52);
    double y;
    memcpy(&y, &fraction, sizeof y);
    n += (int)(bits >> 52) - 1023;
    if (y > 1.4142135623730951) {
        y *= 0.5;
        n++;
    }
    *f = y - 1.0;
    return n;
}

/* Sum of 2/(k + 2 i) z^i, i >= 0, k = 3 or 5, z < 0.0295: what is left is z^12. */
static double artanh_series(double z, int k)
{
    return polynomial(PER_ODD + (k - 3) / 2, z);
}

/* log(1 + f) = f - f^2/2 + s (f^2/2 + R), s = f/(2 + f), R = 2 artanh(s)/s - 2. */
double gyro_log(double x)
{
    double result;
    if (!(x > 0.0)) {
        result = x == 0.0 ? -INFINITY : NAN;
    } else if (!gyro_finite(x)) {
        result = x;
    } else {
        double f;
        const int n = split(x, &f);
        const double s = f / (2.0 + f), z = s * s, half = 0.5 * f * f;
        const double rest = s * (half + z * artanh_series(z, 3)) + n * LN2_LOW;
        result = n * LN2_HIGH - ((half - rest) - f);
    }
    return result;
}

double gyro_log1p(double x)
{
    const double y = 1.0 + x;
    double result;
    if (y == 1.0) {
        result = x;
    } else if (!(y > 0.0) || !gyro_finite(y)) {
        result = gyro_log(y);
    } else {
        result = gyro_log(y) + (x - (y - 1.0)) / y;
    }
    return result;
}

/* log x to 2^-65 of it, for finite x > 0: 2 artanh(f/(2 + f)), the first two terms of the series in pairs. */
static double2 log_of(double x)
{
    static const double2 two_thirds = {0.6666666666666666, 3.700743415417188e-17};
    double f;
    const int n = split(x, &f);
    const double2 s = quotient_of(f, sum_in_order(2.0, f));
    const double2 z = product_of_pairs(s, s);
    const double2 cubic = product_of_pairs(product_of_pairs(z, s), two_thirds);
    const double tail = s.high * z.high * z.high * artanh_series(z.high, 5);
    const double2 first = sum_of(n * LN2_HIGH, 2.0 * s.high);
    const double2 second = sum_of(first.high, cubic.high);
    return sum_in_order(second.high, second.low + (first.low + ((tail + cubic.low) + (n * LN2_LOW + 2.0 * s.low))));
}

/* |x|^y, finite |x| > 0 other than 1, finite y other than 0. */
static double power_of(double x, double y)
{
    /* Beyond, |y log x| > 1100 whatever x is, and the pairs could overflow. */
    const double most = 1e19;
    double result;
    if (y > most || y < -most) {
        result = (x > 1.0) == (y > 0.0) ? INFINITY : 0.0;
    } else {
        const double2 log_x = log_of(x);
        const double2 exponent = product_of(y, log_x.high);
        result = exp_of_sum(exponent.high, exponent.low + y * log_x.low);
    }
    return result;
}

double gyro_pow(double x, double y)
{
    const double size = gyro_fabs(x);
    const int whole = gyro_floor(y) == y;
    const int odd = whole && gyro_fabs(y) < 9007199254740992.0 && gyro_floor(0.5 * y) * 2.0 != y;
    const int minus = odd && (bits_of(x) >> 63) != 0;
    double result;
    if (y == 0.0 || x == 1.0) {
        result = 1.0;
    } else if (x != x || y != y) {
        result = x + y;
    } else if (!gyro_finite(y)) {
        result = size == 1.0 ? 1.0 : (size > 1.0) == (y > 0.0) ? INFINITY : 0.0;
    } else if (x < 0.0 && gyro_finite(x) && !whole) {
        result = NAN;
    } else if (size == 0.0 || !gyro_finite(x)) {
        result = (size == 0.0) == (y < 0.0) ? INFINITY : 0.0;
    } else {
        result = size == 1.0 ? 1.0 : power_of(size, y);
    }
    return minus ? -result : result;
}

double gyro_power(double x, double y) { return y == 0.0 ? 1.0 : y == 1.0 ? x : gyro_exp(y * gyro_log(x)); }

double gyro_sinh(double x)
{
    const double size = gyro_fabs(x);
    double result;
    if (size < 40.0) {
        const double m = gyro_expm1(size);
        result = 0.5 * (m + m / (m + 1.0));
    } else {
        /* Half before the square: sinh is finite where e^x is not. */
        const double root = gyro_exp(0.5 * size);
        result = 0.5 * root * root;
    }
    return x < 0.0 ? -result : x == 0.0 ? x : result;
}

double gyro_cosh(double x)
{
    const double size = gyro_fabs(x);
    double result;
    if (size < 40.0) {
        /* Near 0 without cancellation: 1 + (e^x - 1)^2/(2 e^x). */
        const double m = gyro_expm1(size);
        result = 1.0 + 0.5 * (m * m) / (1.0 + m);
    } else {
        const double root = gyro_exp(0.5 * size);
        result = 0.5 * root * root;
    }
    return result;
}

double gyro_tanh(double x)
{
    const double size = gyro_fabs(x);
    double result;
    if (size < 0.55) {
        const double m = gyro_expm1(-2.0 * size);
        result = -m / (m + 2.0);
    } else if (size < 22.0) {
        result = 1.0 - 2.0 / (gyro_expm1(2.0 * size) + 2.0);
    } else {
        result = size == size ? 1.0 : size;
    }
    return x < 0.0 ? -result : x == 0.0 ? x : result;
}

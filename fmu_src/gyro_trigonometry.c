/* Sine, cosine and tangent with the argument reduced exactly (M. H. Payne, R. N. Hanek, Radian reduction for trigonometric functions, ACM
   SIGNUM Newsletter 18, 1983), and their inverses. */

#include "gyro_math.h"

#include <stdint.h>
#include <string.h>

#include "double2.h"

/* The bits of 2/pi behind the point, 64 zeros before them. */
static const uint64_t TWO_BY_PI[21] = {0,
                                       UINT64_C(0xa2f9836e4e441529), UINT64_C(0xfc2757d1f534ddc0), UINT64_C(0xdb6295993c439041),
                                       UINT64_C(0xfe5163abdebbc561), UINT64_C(0xb7246e3a424dd2e0), UINT64_C(0x06492eea09d1921c),
                                       UINT64_C(0xfe1deb1cb129a73e), UINT64_C(0xe88235f52ebb4484), UINT64_C(0xe99c7026b45f7e41),
                                       UINT64_C(0x3991d639835339f4), UINT64_C(0x9c845f8bbdf9283b), UINT64_C(0x1ff897ffde05980f),
                                       UINT64_C(0xef2f118b5a0a6d1f), UINT64_C(0x6d367ecf27cb09b7), UINT64_C(0x4f463f669e5fea2d),
                                       UINT64_C(0x7527bac7ebe5f17b), UINT64_C(0x3d0739f78a5292ea), UINT64_C(0x6bfb5fb11f8d5d08),
                                       UINT64_C(0x56033046fc7b6bab), UINT64_C(0xf0cfbc209af4361d)};

static const double2 HALF_PI = {1.5707963267948966, 6.123233995736766e-17};

/* 64 of these bits from number `at` on. */
static uint64_t bits_from(unsigned at)
{
    const unsigned word = at / 64, shift = at % 64;
    return shift == 0 ? TWO_BY_PI[word] : TWO_BY_PI[word] << shift | TWO_BY_PI[word + 1] >> (64 - shift);
}

/* The product of two 64-bit numbers: its upper half is the result, the lower goes to *low. */
static uint64_t multiply(uint64_t a, uint64_t b, uint64_t *low)
{
    const uint64_t mask = UINT64_C(0xffffffff);
    const uint64_t ll = (a & mask) * (b & mask), lh = (a & mask) * (b >> 32), hl = (a >> 32) * (b & mask);
    const uint64_t middle = (ll >> 32) + (lh & mask) + (hl & mask);
    *low = middle << 32 | (ll & mask);
    return (a >> 32) * (b >> 32) + (lh >> 32) + (hl >> 32) + (middle >> 32);
}

/* 2^-n, 0 <= n <= 1022. */
static double fraction_of_2(int n)
{
    const uint64_t bits = (uint64_t)(1023 - n) << 52;
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* x = quarter pi/2 + angle, |angle| <= pi/4 (for x below that: x itself), finite x >= 0; the quarter modulo 4. */
static double2 reduce_turns(double x, unsigned *quarter)
{
    double2 angle = {x, 0.0};
    *quarter = 0;
    if (x > 0.7853981633974483) {
        /* x = m 2^(e - 1075); bits of 2/pi that make multiples of 4 are left out, 192 follow: 2^-137 is left. */
        uint64_t bits, low[3], high[3];
        memcpy(&bits, &x, sizeof bits);
        const unsigned first = (unsigned)(bits >> 52) - 1075 + 62;
        const uint64_t m = (bits & UINT64_C(0xfffffffffffff)) | UINT64_C(0x10000000000000);
        for (unsigned i = 0; i < 3; i++) {
            high[i] = multiply(m, bits_from(first + 64 * i), &low[i]);
        }
        /* m times those, modulo 4: two bits of the quarter, then the fraction of it, 128 bits of which are kept. */
        const uint64_t below = low[1] + high[2];
        const uint64_t above = low[0] + high[1] + (below < low[1]);
        uint64_t upper = above << 2 | below >> 62, lower = below << 2 | low[2] >> 62;
        const int minus = (upper >> 63) != 0;
        *quarter = (unsigned)(above >> 62);
        if (minus) {
            *quarter = (*quarter + 1) & 3;
            lower = ~lower + 1;
            upper = ~upper + (lower == 0);
        }
        const double2 fraction = sum_in_order((double)(upper >> 11) * fraction_of_2(53),
                                              (double)((upper & 0x7ff) << 53 | lower >> 11) * fraction_of_2(117));
        angle = product_of_pairs(fraction, HALF_PI);
        angle = minus ? (double2){-angle.high, -angle.low} : angle;
    }
    return angle;
}

/* sin of |a| <= pi/4: the series to a^17, of which 8e-20 is left. */
static double sine_near_0(double2 a)
{
    static const double term[] = {-1.0 / 6.0,        1.0 / 120.0,        -1.0 / 5040.0,         1.0 / 362880.0,
                                  -1.0 / 39916800.0, 1.0 / 6227020800.0, -1.0 / 1307674368000.0, 1.0 / 355687428096000.0};
    const double x = a.high, z = x * x;
    double sum = 0.0;
    for (int i = 7; i >= 0; i--) {
        sum = sum * z + term[i];
    }
    /* The sine of the sum: that of the larger part, and the smaller one times its cosine. */
    return x + (sum * z * x + a.low * (1.0 - 0.5 * z));
}

/* cos of |a| <= pi/4: the series to a^18, of which 3e-21 is left. */
static double cosine_near_0(double2 a)
{
    static const double term[] = {1.0 / 24.0,        -1.0 / 720.0,         1.0 / 40320.0,           -1.0 / 3628800.0,
                                  1.0 / 479001600.0, -1.0 / 87178291200.0, 1.0 / 20922789888000.0, -1.0 / 6402373705728000.0};
    const double x = a.high, z = x * x, half = 0.5 * z, most = 1.0 - half;
    double sum = 0.0;
    for (int i = 7; i >= 0; i--) {
        sum = sum * z + term[i];
    }
    return most + (((1.0 - most) - half) + (sum * z * z - x * a.low));
}

double gyro_sin(double x)
{
    const double size = gyro_fabs(x);
    unsigned quarter;
    double result = NAN;
    if (size < 1e-8) {
        result = x;
    } else if (gyro_finite(x)) {
        const double2 angle = reduce_turns(size, &quarter);
        result = quarter % 2 == 0 ? sine_near_0(angle) : cosine_near_0(angle);
        result = (quarter >= 2) != (x < 0.0) ? -result : result;
    }
    return result;
}

double gyro_cos(double x)
{
    unsigned quarter;
    double result = NAN;
    if (gyro_finite(x)) {
        const double2 angle = reduce_turns(gyro_fabs(x), &quarter);
        result = quarter % 2 == 0 ? cosine_near_0(angle) : sine_near_0(angle);
        result = quarter == 1 || quarter == 2 ? -result : result;
    }
    return result;
}

double gyro_tan(double x) { return gyro_fabs(x) < 1e-8 ? x : gyro_sin(x) / gyro_cos(x); }

/* atan(k/8) to 2^-106. */
static const double2 ATAN_OF_EIGHTHS[9] = {
    {0.0, 0.0},
    {0.12435499454676144, -3.1253241424539383e-18},
    {0.24497866312686414, 1.0698755618734451e-17},
    {0.35877067027057225, -2.4623815582638635e-17},
    {0.4636476090008061, 2.2698777452961687e-17},
    {0.5585993153435624, -5.4556305485916264e-18},
    {0.6435011087932844, 1.5834785051444286e-17},
    {0.7188299996216245, -2.1478388444456983e-17},
    {0.7853981633974483, 3.061616997868383e-17},
};

/* The arc tangent of x >= 0: from 1/x beyond 1; atan x = atan(k/8) + atan((x - k/8)/(1 + x k/8)), of which the series to x^17 leaves 1e-24. */
double gyro_atan(double x)
{
    static const double term[] = {-1.0 / 3.0, 1.0 / 5.0, -1.0 / 7.0, 1.0 / 9.0, -1.0 / 11.0, 1.0 / 13.0, -1.0 / 15.0, 1.0 / 17.0};
    const double size = gyro_fabs(x);
    double result;
    if (x != x || size < 1e-8) {
        result = x;
    } else if (size > 1e17) {
        result = HALF_PI.high;
    } else {
        const int beyond = size > 1.0;
        const double2 to = beyond ? quotient_of(1.0, (double2){size, 0.0}) : (double2){size, 0.0};
        const int k = (int)gyro_rint(8.0 * to.high);
        const double c = 0.125 * k;
        const double y = ((to.high - c) + to.low) / (1.0 + to.high * c), z = y * y;
        double sum = 0.0;
        for (int i = 7; i >= 0; i--) {
            sum = sum * z + term[i];
        }
        const double rest = y + y * z * sum;
        const double2 near = ATAN_OF_EIGHTHS[k];
        result = beyond ? HALF_PI.high - (near.high + ((rest + near.low) - HALF_PI.low)) : near.high + (rest + near.low);
    }
    return x < 0.0 && result > 0.0 ? -result : result;
}

double gyro_atan2(double y, double x)
{
    const double size_y = gyro_fabs(y), size_x = gyro_fabs(x);
    uint64_t bits_x, bits_y;
    double result;
    memcpy(&bits_x, &x, sizeof bits_x);
    memcpy(&bits_y, &y, sizeof bits_y);
    if (x != x || y != y) {
        result = x + y;
    } else {
        if (size_y == 0.0 && size_x == 0.0) {
            result = 0.0;
        } else if (!gyro_finite(x) && !gyro_finite(y)) {
            result = 0.5 * HALF_PI.high;
        } else {
            result = gyro_atan(size_y / size_x);
        }
        result = (bits_x >> 63) != 0 ? 2.0 * HALF_PI.high - (result - 2.0 * HALF_PI.low) : result;
        result = (bits_y >> 63) != 0 ? -result : result;
    }
    return result;
}

double gyro_asin(double x) { return gyro_fabs(x) < 1e-8 ? x : gyro_fabs(x) <= 1.0 ? gyro_atan2(x, sqrt((1.0 - x) * (1.0 + x))) : NAN; }

double gyro_acos(double x) { return gyro_fabs(x) <= 1.0 ? gyro_atan2(sqrt((1.0 - x) * (1.0 + x)), x) : NAN; }

/* Exponentials, powers and hyperbolic tangents of both lanes of a pair at once: the operations of gyro_math.c in the same order, so that the bits
   are the same. A lane that those treat in a way of its own (tiny, huge, no number) is left to them. */

#ifndef GYRO_PAIR_MATH_H
#define GYRO_PAIR_MATH_H

#include "gyro_math.h"
#include "math_series.h"
#include "pair.h"

#if defined(GYRO_PAIR_VECTORS)

static inline gyro_pair_bits bits_of_pair(gyro_pair a) { return (gyro_pair_bits)a; }

/* Of a mask, whose lanes are 0 or -1. */
static inline int is_all(gyro_pair_bits mask) { return (mask[0] & mask[1]) != 0; }

static inline gyro_pair pair_choice(gyro_pair_bits mask, gyro_pair a, gyro_pair b)
{
    return (gyro_pair)((mask & bits_of_pair(a)) | (~mask & bits_of_pair(b)));
}

static inline gyro_pair polynomial_of_pair(const double c[MATH_TERMS], gyro_pair x)
{
    const gyro_pair x_2 = x * x, x_4 = x_2 * x_2, x_8 = x_4 * x_4;
    const gyro_pair first = (both(c[0]) + both(c[1]) * x) + (both(c[2]) + both(c[3]) * x) * x_2;
    const gyro_pair second = (both(c[4]) + both(c[5]) * x) + (both(c[6]) + both(c[7]) * x) * x_2;
    const gyro_pair third = (both(c[8]) + both(c[9]) * x) + (both(c[10]) + both(c[11]) * x) * x_2;
    return (first + second * x_4) + (third + both(c[12]) * x_4) * x_8;
}

/* x = n ln 2 + main - rest, |main| < 0.347. */
typedef struct {
    gyro_pair shifted; /* MATH_WHOLE + n: the last bits are those of n */
    gyro_pair main, rest;
} gyro_reduced_pair;

static inline gyro_reduced_pair reduced_pair(gyro_pair x)
{
    const gyro_pair shifted = x * both(PER_LN2) + both(MATH_WHOLE), n = shifted - both(MATH_WHOLE);
    return (gyro_reduced_pair){shifted, x - n * both(LN2_HIGH), n * both(LN2_LOW)};
}

/* e^(main - rest) - 1 - main */
static inline gyro_pair bend_of_pair(const gyro_reduced_pair *of)
{
    const gyro_pair r = of->main - of->rest;
    return r * r * polynomial_of_pair(PER_FACTORIAL, r) - of->rest;
}

/* 2^n, and 2^-n, |n| < 1000. */
static inline gyro_pair scale_of_pair(const gyro_reduced_pair *of)
{
    return (gyro_pair)((bits_of_pair(of->shifted) - bits_of_pair(both(MATH_WHOLE)) + (gyro_pair_bits){1023, 1023}) << 52);
}

static inline gyro_pair inverse_scale_of_pair(const gyro_reduced_pair *of)
{
    return (gyro_pair)((bits_of_pair(both(MATH_WHOLE)) - bits_of_pair(of->shifted) + (gyro_pair_bits){1023, 1023}) << 52);
}

static GYRO_INLINE gyro_pair exp_of_pair(gyro_pair x)
{
    gyro_pair result;
    if (is_all(pair_size(x) < both(670.0))) {
        const gyro_reduced_pair r = reduced_pair(x);
        result = (both(1.0) + (r.main + bend_of_pair(&r))) * scale_of_pair(&r);
    } else {
        result = pair_of(gyro_exp(lane_of(x, 0)), gyro_exp(lane_of(x, 1)));
    }
    return result;
}

/* Of what is positive, neither denormal nor infinite. */
static inline gyro_pair log_of_pair(gyro_pair x)
{
    /* A whole number below 2^52 in the last bits of 2^52. */
    const gyro_pair exponent = (gyro_pair)((bits_of_pair(x) >> 52) | bits_of_pair(both(4503599627370496.0)));
    const gyro_pair n = exponent - both(4503599627370496.0 + 1023.0);
    const gyro_pair y = (gyro_pair)((bits_of_pair(x) & (gyro_pair_bits){0xfffffffffffff, 0xfffffffffffff}) | bits_of_pair(both(1.0)));
    const gyro_pair_bits large = y > both(1.4142135623730951);
    const gyro_pair f = pair_choice(large, both(0.5) * y, y) - both(1.0), whole = pair_choice(large, n + both(1.0), n);
    const gyro_pair s = f / (both(2.0) + f), z = s * s, half = both(0.5) * f * f;
    const gyro_pair rest = s * (half + z * polynomial_of_pair(PER_ODD, z)) + whole * both(LN2_LOW);
    return whole * both(LN2_HIGH) - ((half - rest) - f);
}

/* x^e, as gyro_power, which gives x itself where e is 1. */
static GYRO_INLINE gyro_pair power_of_pair(gyro_pair x, gyro_pair e)
{
    gyro_pair result;
    if (lane_of(e, 0) != 1.0 && lane_of(e, 1) != 1.0 && is_all((x > both(1e-300)) & (x < both(1e300)))) {
        result = exp_of_pair(e * log_of_pair(x));
    } else {
        result = pair_of(gyro_power(lane_of(x, 0), lane_of(e, 0)), gyro_power(lane_of(x, 1), lane_of(e, 1)));
    }
    return result;
}

static GYRO_INLINE gyro_pair tanh_of_pair(gyro_pair x)
{
    const gyro_pair size = pair_size(x);
    gyro_pair result;
    if (is_all((size > both(1e-16)) & (size < both(19.0)))) {
        const gyro_pair_bits small = size < both(0.55);
        const gyro_reduced_pair r = reduced_pair(pair_choice(small, both(-2.0) * size, both(2.0) * size));
        /* e^.. - 1, as gyro_expm1. */
        const gyro_pair less = both(1.0) - inverse_scale_of_pair(&r), sum = less + r.main, part = sum - less;
        const gyro_pair low = (less - (sum - part)) + (r.main - part);
        const gyro_pair m = (sum + (low + bend_of_pair(&r))) * scale_of_pair(&r);
        const gyro_pair ratio = pair_choice(small, -m, both(2.0)) / (m + both(2.0));
        const gyro_pair positive = pair_choice(small, ratio, both(1.0) - ratio);
        result = pair_choice(x < both(0.0), -positive, positive);
    } else {
        result = pair_of(gyro_tanh(lane_of(x, 0)), gyro_tanh(lane_of(x, 1)));
    }
    return result;
}

#else

static inline gyro_pair exp_of_pair(gyro_pair x) { return pair_of(gyro_exp(lane_of(x, 0)), gyro_exp(lane_of(x, 1))); }

static inline gyro_pair power_of_pair(gyro_pair x, gyro_pair e)
{
    return pair_of(gyro_power(lane_of(x, 0), lane_of(e, 0)), gyro_power(lane_of(x, 1), lane_of(e, 1)));
}

static inline gyro_pair tanh_of_pair(gyro_pair x) { return pair_of(gyro_tanh(lane_of(x, 0)), gyro_tanh(lane_of(x, 1))); }

#endif

#endif

/* Sums and products of doubles with what rounding leaves of them: T. J. Dekker, A floating-point technique for extending the available
   precision, Numerische Mathematik 18, 1971. Contraction to fused multiply-add must be off. */

#ifndef GYRO_DOUBLE2_H
#define GYRO_DOUBLE2_H

typedef struct {
    double high, low; /* the value is their sum, |low| at most half a unit in the last place of high */
} double2;

/* a + b, |a| >= |b|. */
static inline double2 sum_in_order(double a, double b)
{
    const double sum = a + b;
    return (double2){sum, b - (sum - a)};
}

/* a + b. */
static inline double2 sum_of(double a, double b)
{
    const double sum = a + b, part = sum - a;
    return (double2){sum, (a - (sum - part)) + (b - part)};
}

/* a b, both below 1e290 and the product above 1e-290. */
static inline double2 product_of(double a, double b)
{
    const double split = 134217729.0; /* 2^27 + 1 */
    const double a_split = split * a, b_split = split * b;
    const double a_high = a_split - (a_split - a), b_high = b_split - (b_split - b);
    const double a_low = a - a_high, b_low = b - b_high, product = a * b;
    return (double2){product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low};
}

/* a b to about 2^-102 of it. */
static inline double2 product_of_pairs(double2 a, double2 b)
{
    const double2 product = product_of(a.high, b.high);
    return sum_in_order(product.high, product.low + (a.high * b.low + a.low * b.high));
}

/* a/b to about 2^-100 of it. */
static inline double2 quotient_of(double a, double2 b)
{
    const double first = a / b.high;
    const double2 back = product_of(first, b.high);
    return sum_in_order(first, ((a - back.high) - back.low - first * b.low) / b.high);
}

#endif

/* Numbers that gyro_math.c works with, and whatever does the same for two numbers at once. */

#ifndef GYRO_MATH_SERIES_H
#define GYRO_MATH_SERIES_H

/* ln 2 in two parts: the first has 32 bits, so that its product with an exponent is exact. */
static const double LN2_HIGH = 0.6931471803691238, LN2_LOW = 1.9082149292705877e-10;
static const double PER_LN2 = 1.4426950408889634;

/* 1.5 2^52: beyond, every double is a whole number. */
static const double MATH_WHOLE = 6755399441055744.0;

enum { MATH_TERMS = 13 };

/* 1/n! from n = 2 on. */
static const double PER_FACTORIAL[MATH_TERMS] = {1.0 / 2.0,         1.0 / 6.0,          1.0 / 24.0,          1.0 / 120.0,     1.0 / 720.0,
                                                 1.0 / 5040.0,      1.0 / 40320.0,      1.0 / 362880.0,      1.0 / 3628800.0, 1.0 / 39916800.0,
                                                 1.0 / 479001600.0, 1.0 / 6227020800.0, 1.0 / 87178291200.0};

/* 2/(3 + 2 i), i >= 0, and room for those from the second on. */
static const double PER_ODD[MATH_TERMS + 1] = {2.0 / 3.0,  2.0 / 5.0,  2.0 / 7.0,  2.0 / 9.0,  2.0 / 11.0, 2.0 / 13.0, 2.0 / 15.0,
                                               2.0 / 17.0, 2.0 / 19.0, 2.0 / 21.0, 2.0 / 23.0, 2.0 / 25.0, 2.0 / 27.0, 0.0};

#endif

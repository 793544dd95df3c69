/* Hermite interpolation over a step h [s], at the part `c` of it, from what is known at its ends a and b. */

#ifndef GYRO_HERMITE_H
#define GYRO_HERMITE_H

/* Of a value with its rate: off by h^4/384 of its fourth derivative. */
static inline double cubic(double a, double a_rate, double b, double b_rate, double h, double c)
{
    const double d = 1.0 - c;
    return d * d * ((1.0 + 2.0 * c) * a + c * h * a_rate) + c * c * ((1.0 + 2.0 * d) * b - d * h * b_rate);
}

/* A value and its first two derivatives. */
typedef struct {
    double value, rate, second;
} gyro_jet;

/* Likewise: off by h^6/46080 of the sixth derivative, 6e-11 of a sine at 3.8 kHz and 5 us. */
static inline double quintic(gyro_jet a, gyro_jet b, double h, double c)
{
    const double d = 1.0 - c;
    const double from_a = a.value * (1.0 + c * (3.0 + 6.0 * c)) + h * c * (a.rate * (1.0 + 3.0 * c) + 0.5 * h * c * a.second);
    const double from_b = b.value * (1.0 + d * (3.0 + 6.0 * d)) - h * d * (b.rate * (1.0 + 3.0 * d) - 0.5 * h * d * b.second);
    return d * d * d * from_a + c * c * c * from_b;
}

#endif

/* Complex numbers, pairs (x, y) and 2 x 2 matrices of them: C99's own multiply through libgcc for the sake of infinities. */

#ifndef GYRO_COMPLEX2_H
#define GYRO_COMPLEX2_H

#include "gyro_math.h"

typedef struct {
    double re, im;
} number;

typedef struct {
    number e[2];
} pair;

typedef struct {
    number e[2][2];
} matrix;

static inline number number_of(double re, double im) { return (number){re, im}; }

static inline number plus(number a, number b) { return number_of(a.re + b.re, a.im + b.im); }

static inline number minus(number a, number b) { return number_of(a.re - b.re, a.im - b.im); }

static inline number times(number a, number b) { return number_of(a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re); }

static inline number scaled(number a, double factor) { return number_of(a.re * factor, a.im * factor); }

static inline number conjugate(number a) { return number_of(a.re, -a.im); }

static inline double square(number a) { return a.re * a.re + a.im * a.im; }

/* a/b without care for overflow: the squares of all that is divided by here are far inside the range. */
static inline number over(number a, number b) { return scaled(times(a, conjugate(b)), 1.0 / square(b)); }

/* The part along cos φ (0) or -sin φ (1) of an amplitude. */
static inline double *part_of(number *a, int quadrature) { return quadrature == 0 ? &a->re : &a->im; }

/* e^(i angle). */
static inline number turn(double angle) { return number_of(gyro_cos(angle), gyro_sin(angle)); }

static inline matrix diagonal(number a)
{
    return (matrix){{{a, {0.0, 0.0}}, {{0.0, 0.0}, a}}};
}

static inline matrix matrix_plus(matrix a, matrix b)
{
    matrix sum;
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            sum.e[i][j] = plus(a.e[i][j], b.e[i][j]);
        }
    }
    return sum;
}

static inline matrix matrix_scaled(matrix a, double factor)
{
    matrix result;
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            result.e[i][j] = scaled(a.e[i][j], factor);
        }
    }
    return result;
}

static inline matrix matrix_times(matrix a, matrix b)
{
    matrix product;
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            product.e[i][j] = plus(times(a.e[i][0], b.e[0][j]), times(a.e[i][1], b.e[1][j]));
        }
    }
    return product;
}

static inline pair apply(matrix a, pair b)
{
    pair product;
    for (int i = 0; i < 2; i++) {
        product.e[i] = plus(times(a.e[i][0], b.e[0]), times(a.e[i][1], b.e[1]));
    }
    return product;
}

static inline pair pair_plus(pair a, pair b) { return (pair){{plus(a.e[0], b.e[0]), plus(a.e[1], b.e[1])}}; }

/* The conjugate transpose. */
static inline matrix adjoint(matrix a)
{
    return (matrix){{{conjugate(a.e[0][0]), conjugate(a.e[1][0])}, {conjugate(a.e[0][1]), conjugate(a.e[1][1])}}};
}

static inline matrix inverse(matrix a)
{
    const number determinant = minus(times(a.e[0][0], a.e[1][1]), times(a.e[0][1], a.e[1][0]));
    const number one = over(number_of(1.0, 0.0), determinant);
    const number none = number_of(0.0, 0.0);
    return (matrix){{{times(a.e[1][1], one), times(minus(none, a.e[0][1]), one)},
                     {times(minus(none, a.e[1][0]), one), times(a.e[0][0], one)}}};
}

/* The largest entry, |re| + |im|. */
static inline double largest(matrix a)
{
    double most = 0.0;
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            const double size = fabs(a.e[i][j].re) + fabs(a.e[i][j].im);
            most = size > most ? size : most;
        }
    }
    return most;
}

#endif

/* Matrices of the states. */

#ifndef GYRO_MATRICES_H
#define GYRO_MATRICES_H

#include "generated/effects.h"

/* Rounds in which a matrix is balanced: what is left unbalanced costs a series some terms, and takes nothing from what it gives. */
enum { BALANCING = 6 };

/* Of the first n rows and columns, the others being unset. */
typedef struct {
    double of[GYRO_N_STATES][GYRO_N_STATES];
} matrix;

static inline void set_diagonal(int n, double diagonal, matrix *made)
{
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            made->of[i][j] = i == j ? diagonal : 0.0;
        }
    }
}

/* c = factor a b; c is another than both. */
static inline void find_product(int n, double factor, const matrix *a, const matrix *b, matrix *c)
{
    set_diagonal(n, 0.0, c);
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < n; k++) {
            const double own = factor * a->of[i][k];
            /* Most states move few others. */
            if (own != 0.0) {
                for (int j = 0; j < n; j++) {
                    c->of[i][j] += own * b->of[k][j];
                }
            }
        }
    }
}

static inline void add_scaled(int n, double factor, const matrix *a, matrix *to)
{
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            to->of[i][j] += factor * a->of[i][j];
        }
    }
}

/* Units of the states in which rows and columns of a matrix are of one size (E. E. Osborne, On pre-conditioning of matrices, Journal of the ACM 7,
   1960). */
static inline void balance(int n, const matrix *a, double unit[])
{
    for (int i = 0; i < n; i++) {
        unit[i] = 1.0;
    }
    for (int round = 0; round < BALANCING; round++) {
        for (int i = 0; i < n; i++) {
            double row = 0.0, column = 0.0;
            for (int j = 0; j < n; j++) {
                row += i == j ? 0.0 : fabs(a->of[i][j]) * unit[j] / unit[i];
                column += i == j ? 0.0 : fabs(a->of[j][i]) * unit[i] / unit[j];
            }
            unit[i] *= row > 0.0 && column > 0.0 ? sqrt(row / column) : 1.0;
        }
    }
}

/* The maximum norm of a matrix in units of the states. */
static inline double norm_of(int n, const matrix *a, const double unit[])
{
    double norm = 0.0;
    for (int i = 0; i < n; i++) {
        double row = 0.0;
        for (int j = 0; j < n; j++) {
            row += fabs(a->of[i][j]) * unit[j];
        }
        norm = row / unit[i] > norm ? row / unit[i] : norm;
    }
    return norm;
}

#endif

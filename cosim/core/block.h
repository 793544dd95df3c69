/* A block of innovations folded into the constants: least squares in units of what was known before, W. */

#ifndef BLOCK_H
#define BLOCK_H

#include "filter.h"

#define APART 0.3 /* of the design's deviation of a constant, from which on another value of it is looked at */

/* A row of the block in eta, W' h, less what no sample shows. */
void block_row_in_eta(const filter *f, const double row[NP], double g[NP]);

/* J = I + sum of the block's rows in units of W, as its Cholesky factor L; b = sum of row * innovation. Returns the trace of J - I. */
double block_information(const filter *f, double L[NP][NP], double b[NP]);

/* L^-1 b. */
void block_halve(double L[NP][NP], const double b[NP], double half[NP]);

/* d = W^-1 p: a change of p in units of W. */
void block_scale(const filter *f, const double p[NP], double d[NP]);

/* Adds the covariance wide wide'. */
void block_widen(filter *f, const double wide[NP]);

/* Solves L L' x = b; also gives L^-1 b. */
void block_solve(double L[NP][NP], const double b[NP], double x[NP], double half[NP]);

/* W becomes W L^-T, which is upper triangular again. */
void block_shrink(filter *f, double L[NP][NP]);

/* W is upper triangular again, by rotations of its columns. */
void block_make_triangular(double W[NP][NP]);

/* Variance of p_i. */
double block_variance(const filter *f, int i);

/* |x|^2. */
double block_squared(const double x[NP]);

/* p = p_begun + W eta; `change` is what that changes. */
void block_set_constants(filter *f, const double eta[NP], double change[NP]);

/* p_begun + W eta, its entry i. */
double block_constant_at(const filter *f, const double eta[NP], int i);

/* Keeps p = p_begun + W eta at its lowest values: where eta lies below some, it goes to the most likely point on all of these bounds together, given
   the Hessian L L'. A delay and a lag that can't be told apart pull at each other, so one after the other would not do. */
void block_keep_in_bounds(const filter *f, double L[NP][NP], double eta[NP]);

/* |L' (a - b)|: how far a is from b in standard deviations. */
double block_distance(double L[NP][NP], const double a[NP], const double b[NP]);

#endif

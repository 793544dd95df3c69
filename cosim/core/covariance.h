/* What is uncertain of the motion over a sample period. */

#ifndef COVARIANCE_H
#define COVARIANCE_H

#include "filter.h"

/* Adds to P what is uncertain of z by way of p, whose covariance is W W'. */
void covariance_add_constants(const moving *n, double W[NP][NP], double P[NZ][ZW]);

/* P becomes F P F' and the noise of the motion, and its covariance with what the pattern has strayed by goes along (stray.h). F has the derivatives by z
   over the period, but that the rate follows its slope, which is added here; `way`: the last piece of the motion. */
void covariance_predict(filter *f, double F[NZ][ZW], const passage *way);

#endif

/* What is uncertain of the motion over a sample period. */

#ifndef COVARIANCE_H
#define COVARIANCE_H

#include "filter.h"

/* P becomes F P F' and the noise of the motion, and its covariance with what the pattern has strayed by goes along (stray.h). F has the derivatives by z
   over the period, but that the rate follows its slope, which is added here; `way`: the last piece of the motion. */
void covariance_predict(filter *f, double F[NZ][NZ], const passage *way);

#endif

/* What is predicted: z, its slopes Y by p and its covariance over a sample period, and the sample that they make. */

#ifndef PREDICTION_H
#define PREDICTION_H

#include "filter.h"

/* The command of `sample` [N]; before the start it is the first one. */
const double *filter_command(const filter *f, int64_t sample);

/* Forms the motion with the constants as they are now. */
void filter_form(filter *f);

/* Takes up what is measured at the present sample; the motion is formed anew where that changes it. */
void filter_enter(filter *f, const double in[IN]);

/* Moves z, Y and P over the period that ends at the present sample. */
void filter_predict(filter *f);

/* What the sample should be [V], its derivatives by z and by p, and its noise [V2]. */
void filter_expect(const filter *f, double v[2], double C[2][NZ], double by_p[2 * NW], double noise[2]);

#endif

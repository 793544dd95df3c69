/* The constants that a start makes most likely, by steps that are filtered again. */

#ifndef DESCENT_H
#define DESCENT_H

#include "filter.h"

#define FOR_WHOLE 10.0 /* filterings of a whole start that are saved up for it */
#define OFF 1.5 /* deviations beside its fit from which a start has not found it: some end one beside a lowest value, where slopes say too much */

/* What a descent has reached: the sum of squares, what the constants explain, and how many deviations beside it the slopes say that the most likely
   constants are. */
typedef struct {
    double cost, trace, off;
} descent;

/* Finds the constants that a start and what was known before it make most likely, and leaves the start filtered there and the Cholesky factor of its
   information in L. A whole one that ends with a delay beside whole periods is looked for on their other side, too. */
descent descent_find(filter *f, double L[NP][NP]);

/* The step from f->eta that the block and what was known before it make most likely, L being the factor of its Hessian: within the bounds. Returns
   how many deviations long it is. */
double descent_step(const filter *f, double L[NP][NP], const double b[NP], double step[NP]);

#endif

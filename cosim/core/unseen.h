/* Changes of the constants that no sample can show while the device goes on as it does: of an actuator against a pickoff, say, at a rate that stands
   still. A start shows nothing of them, and blocks must not pretend to: their Jacobians are taken at estimates, large terms cancel in them to a
   part in a million only, and what is left would pass for knowledge (docs/theory/loop.md). */

#ifndef UNSEEN_H
#define UNSEEN_H

#include "filter.h"

/* Finds them after a start, L being the Cholesky factor of its information (block.h). */
void unseen_find(filter *f, double L[NP][NP]);

/* The direction, in units of W and a deviation long, of which a start leaves most among those of which it shows something. */
void unseen_weakest(double L[NP][NP], double d[NP]);

/* Puts them into units of W, which has changed. */
void unseen_scale(filter *f);

/* Leaves what is along them out of x, a change of p in units of W. */
void unseen_leave_out(const filter *f, double x[NP]);

/* Whether the block's rows, like those of some before, show so much of one of them that another start would tell it. Forgets those of which they
   show less, but more than large terms that cancel. */
int unseen_shows(filter *f);

/* Standard deviation of the pattern's turning [rad/s] that comes of them; `rest`: that which comes of all else. */
double unseen_turning(const filter *f, double *rest);

/* Their columns of W, one after another, the others zero. */
void unseen_columns(const filter *f, double columns[NP][NP]);

#endif

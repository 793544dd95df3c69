/* Changes of the constants that no sample can show while the device goes on as it does: of an actuator against a pickoff, say, at a rate that stands
   still. A start shows nothing of them, and blocks must not pretend to: their Jacobians are taken at estimates, large terms cancel in them to a
   part in a million only, and what is left would pass for knowledge (docs/theory/loop.md). */

#ifndef UNSEEN_H
#define UNSEEN_H

#include "filter.h"

/* Finds them after a start, L being the Cholesky factor of its information (block.h). */
void unseen_find(filter *f, double L[NP][NP]);

/* Puts them into units of W, which has changed. */
void unseen_scale(filter *f);

/* Whether the block shows something of each of them, as those before it did; of the others it pretends to. */
void unseen_look(filter *f);

/* Turns those of which nothing is shown, and W with them, by what the block, which has gone into W, tells of the other constants: of an offset's drift
   a start can't say how little belongs to them, and what does grows with time. */
void unseen_follow(filter *f);

/* Leaves what is along those of which nothing is shown out of x, a change of p in units of W. */
void unseen_leave_out(const filter *f, double x[NP]);

/* Leaves out of x what can't hold a constant at its lowest value: in a start all that it does not show, which bends, so that a fit would creep along it;
   later what the last block showed, whose objections do not count yet. */
void unseen_leave_from_bounds(const filter *f, double x[NP]);

/* Their columns of W, one after another, the others zero. */
void unseen_columns(const filter *f, double columns[NP][NP]);

#endif

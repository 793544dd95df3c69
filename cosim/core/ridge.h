/* Constants that samples show by what they make together, the gain of an actuator times that of a pickoff, leave a likelihood that is a ridge, and it
   bends: within the deviation of one of them the others move by hundreds of theirs. A straight step leaves it, and blocks that are folded at
   one point after another, each with a tangent of its own, would cross where there is nothing (docs/theory/loop.md). */

#ifndef RIDGE_H
#define RIDGE_H

#include "filter.h"

/* Keeps rows and innovations of the start as they are where a step begins. */
void ridge_begin_step(filter *f);

/* How the best way bends that begins with `step`, in units of W; the block is filtered at its end, and L is the Cholesky factor where it began. Uses up the
   block's innovations. */
void ridge_bend_step(filter *f, double L[NP][NP], const double step[NP], double bend[NP]);

/* Takes `d`, in units of W and a deviation long, for the direction of the ridge; `bent` [rows] is what the innovations bend by along it. */
void ridge_set(filter *f, double L[NP][NP], const double d[NP], const double *bent);

/* p has moved by `change`: adds to both what the ridge bends by on the way. */
void ridge_follow(filter *f, double change[NP]);

/* Turns W by what p has moved along the ridge. */
void ridge_turn(filter *f, const double change[NP]);

/* The turning of the pattern that the ridge bends by within one deviation [rad/s]. */
double ridge_turning(const filter *f);

/* What is left of it by now: knowledge grows with time at least, and the bend goes with its variance. */
double ridge_turning_left(const filter *f);

#endif

/* Constants that samples show by what they make together, the gain of an actuator times that of a pickoff, are known along a curve: within the
   deviation of one of them the others move by hundreds of theirs. So it is with a delay, a lag and a feedthrough. Which command goes with a voltage,
   frequency by frequency, does not bend: a block that is folded moves that along a straight line, and the motion and its slopes as the voltages will see
   them (docs/theory/loop.md). */

#ifndef STRAIGHT_H
#define STRAIGHT_H

#include "filter.h"

/* The change of p in units of W to which `step` leads from `eta`, where what the voltages see moves straight: near eta + step. */
void straight_step(const filter *f, const double eta[NP], const double step[NP], double trial[NP]);

/* What the voltages see is taken as it is at the present p. */
void straight_begin(filter *f);

/* Blocks have moved p from `followed` along a straight line, and z by its slopes: puts p where what the voltages see has moved straight, and carries
   z, its slopes, W, the rows left for the next block and what no sample shows over to there. Does so once p has moved far enough to bend. */
void straight_follow(filter *f);

#endif

/* Constants that samples show by what they make together, the gain of an actuator times that of a pickoff, are known along a curve: within the
   deviation of one of them the others move by hundreds of theirs. What the voltages see of the linear device at rest does not bend: with the
   accelerations -kappa q + b u and the voltages c q those are the entries of c kappa c^-1 and c b. A block that is folded moves them along a straight
   line, and motion and slopes with them as the voltages see them (docs/theory/loop.md). */

#ifndef STRAIGHT_H
#define STRAIGHT_H

#include "filter.h"

/* The change of p in units of W to which `step` leads from `eta`, where what the voltages see moves straight: near eta + step. */
void straight_step(const filter *f, const double eta[NP], const double step[NP], double trial[NP]);

/* A block has moved p from p_begun along a straight line, and z by its slopes: puts p where what the voltages see has moved straight, and carries
   z, its slopes, W, the rows left for the next block and what no sample shows over to there. */
void straight_follow(filter *f);

#endif

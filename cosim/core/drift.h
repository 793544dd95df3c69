/* How far the constants that are not known turn the pattern, and bend its angle. */

#ifndef DRIFT_H
#define DRIFT_H

#include "known.h"

/* The device is `k` where the loop takes it for `taken`; `stiffness` [N/m] is that of the isotropic oscillator. A straight pattern along phi then
   turns by rate[0] + rate[1] cos 2 phi + rate[2] sin 2 phi [rad/s], and is read wrong by bend[...] likewise [rad]. */
void drift_of(const known *k, const known *taken, double stiffness, double rate[3], double bend[3]);

/* Largest standard deviation over the pattern's angle of what drift_of gives, for the covariance W W' of p: of the turning [rad/s] and of the
   bending [rad]. */
void drift_deviation(const known *k, double W[NP][NP], double stiffness, double *turning, double *bending);

#endif

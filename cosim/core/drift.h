/* How far the constants that are not known turn the pattern, and bend its angle. */

#ifndef DRIFT_H
#define DRIFT_H

#include "known.h"

/* The device is `k` where the loop takes it for `taken`; `stiffness` [N/m] is that of the isotropic oscillator. A straight pattern along phi then
   turns by rate[0] + rate[1] cos 2 phi + rate[2] sin 2 phi [rad/s], and is read wrong by bend[...] likewise [rad]. */
void drift_of(const known *k, const known *taken, double stiffness, double rate[3], double bend[3]);

/* How the pattern turns where the force is computed from `taken` while the motion is read as the device `k` it is [rad/s], likewise. */
void drift_of_force(const known *k, const known *taken, double stiffness, double rate[3]);

/* Standard deviations of what drift_of gives: of the turning at the pattern's worst angle and where it stands [rad/s], of the bending at its worst
   [rad]. */
typedef struct {
    double turning, turning_now, bending;
} drift_sizes;

/* These for the covariance W W' of p and a pattern that stands at phi [rad]. */
drift_sizes drift_deviation(const known *k, double W[NP][NP], double stiffness, double phi);

#endif

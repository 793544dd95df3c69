/* How noise that the force feeds back turns the pattern: its angle random walk. */

#ifndef STRAY_H
#define STRAY_H

#include "filter.h"
#include "foucault.h"

/* After the controller at a sample: adds to the variance by which the pattern strays. `forced` [4]: the response to the tones at the sample. */
void stray_by_force(filter *f, const foucault *c, const double forced[4]);

#endif

/* Blocks of samples fitted to the constants: grown at the start, folded later, and forgotten where the data say so. */

#ifndef FIT_H
#define FIT_H

#include "filter.h"

#define FITS 2.0  /* mean squared innovation of a start that has found the device; before that every sample may surprise */
#define FOUND 256 /* samples in which a start gets near the device; a fit of fewer claims more than it knows, and samples surprise it */

/* Begins a block with the next sample. */
void fit_begin(filter *f);

/* The block is full: one that grows goes on, any other is folded into the constants, but for the rows of its last samples, in which a jump of
   the rate may be under way that has not surprised yet. */
void fit_end(filter *f);

/* Folds what there is of the block. */
void fit_cut(filter *f);

/* Folds the block into the constants, L being the Cholesky factor of its information (block.h), and begins the next. */
void fit_fold(filter *f, double L[NP][NP]);

#endif

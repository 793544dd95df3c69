/* What a sample says of what moves; and of the constants, as rows of the block. */

#ifndef CORRECTION_H
#define CORRECTION_H

#include "filter.h"

/* Sets the noise [V2] of voltages that are at the converter's end so high that they tell nothing. */
void filter_leave_out(const filter *f, const double v[2], double noise[2]);

/* Corrects with one axis: c and by_p are the slopes of its sample by z and by p, `noise` its variance [V2], e its innovation [V]. Returns the squared
   innovation over its full variance where that is large, else 0. */
double filter_correct_axis(filter *f, const double *c, const double *by_p, double noise, double e);

/* Corrects with the sample of both axes [V]; returns the surprise, the sum of both. */
double filter_correct(filter *f, const double v[2]);

#endif

/* Several numbers side by side, in one register where the processor has it. A row by p, filled up with zeros, is made of whole ones, so that no
   compiler has to find out how to go along it. */

#ifndef WIDE_H
#define WIDE_H

#define WIDE 8
#define NW ((NP + WIDE - 1) / WIDE * WIDE) /* length of a row by p */
#define NB (NW / WIDE)                     /* wide numbers that it is */

typedef double wide __attribute__((vector_size(8 * WIDE), aligned(8), may_alias));

static inline wide *wide_row(double *row) { return (wide *)row; }
static inline const wide *wide_of(const double *row) { return (const wide *)row; }

/* Makes `count` wide numbers zero. */
static inline void wide_clear(double *rows, int count)
{
    for (int b = 0; b < count; b++) {
        wide_row(rows)[b] = (wide){0.0};
    }
}

/* out = rows, `count` wide numbers. */
static inline void wide_copy(const double *rows, int count, double *out)
{
    for (int b = 0; b < count; b++) {
        wide_row(out)[b] = wide_of(rows)[b];
    }
}

#endif

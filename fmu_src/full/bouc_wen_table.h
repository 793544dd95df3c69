/* A state z that follows a displacement x alone (Bouc-Wen), L dz/dx = 1 - c |z|^n, on one side of zero and in one direction of the motion. With
   s = |c|^(1/n) |x - x_0|/L from where z is zero, |c|^(1/n) |z| is one of two curves that n alone decides,

       dw/ds = 1 - w^n  and  dw/ds = 1 + w^n,  w(0) = 0.

   They are tabulated once, by polynomials on pieces whose width is a part of s, so that they hold beside the zero too, where w^n has no series
   unless n is whole. */

#ifndef GYRO_BOUC_WEN_TABLE_H
#define GYRO_BOUC_WEN_TABLE_H

#include <stdint.h>
#include <string.h>

#include "generated/names.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Pieces of s, 16 to an octave, from 2^-20, below which w is s but for 1e-12, to 32. The way back, from w to s, is a first guess only: pieces of w, and
   beside 1, which the first curve nears, of 1 - w from 2^-43 on, 8 to an octave. */
enum {
    GYRO_CURVE_POWER = 6,
    GYRO_CURVE_LOWEST = -20,
    GYRO_CURVE_BITS = 4,
    GYRO_CURVE_PIECES = 25 << GYRO_CURVE_BITS,
    GYRO_BACK_POWER = 3,
    GYRO_BACK_BITS = 3,
    GYRO_BACK_PIECES = 21 << GYRO_BACK_BITS,
    GYRO_NEAR_LOWEST = -43,
    GYRO_NEAR_PIECES = 42 << GYRO_BACK_BITS
};

/* A polynomial about the centre of its piece. A piece on which its powers don't do has no numbers. */
typedef struct {
    double centre;
    double c[GYRO_CURVE_POWER + 1];
} gyro_curve_piece;

typedef struct {
    double centre;
    double c[GYRO_BACK_POWER + 1];
} gyro_back_piece;

/* The first piece of each is what lies below the others, the last of a curve what lies above. */
typedef struct {
    double n;
    gyro_curve_piece curve[2][GYRO_CURVE_PIECES + 2];
    gyro_back_piece back[2][GYRO_BACK_PIECES + 1]; /* s by w */
    gyro_back_piece beside[GYRO_NEAR_PIECES + 1];    /* of the first curve, s by 1 - w */
} gyro_bouc_wen_table;

void gyro_tabulate_bouc_wen(gyro_bouc_wen_table *table, double n);

/* Which piece a number is in: the exponent and the first bits of a double count them. */
static inline int piece_of(double a, int lowest, int bits, int last)
{
    uint64_t whole;
    memcpy(&whole, &a, sizeof whole);
    /* Without its sign: rounding may have left a little below zero. */
    const int64_t piece = (int64_t)(whole << 1 >> (53 - bits)) - (int64_t)(1023 + lowest) * ((int64_t)1 << bits) + 1;
    return piece < 0 ? 0 : piece > last ? last : (int)piece;
}

static inline const gyro_curve_piece *curve_piece(const gyro_curve_piece *curve, double s)
{
    return curve + piece_of(s, GYRO_CURVE_LOWEST, GYRO_CURVE_BITS, GYRO_CURVE_PIECES + 1);
}

static inline double curve_at(const gyro_curve_piece *curve, double s)
{
    const gyro_curve_piece *of = curve_piece(curve, s);
    const double *c = of->c, t = s - of->centre;
    return (((((c[6] * t + c[5]) * t + c[4]) * t + c[3]) * t + c[2]) * t + c[1]) * t + c[0];
}

static inline double back_at(const gyro_back_piece *of, double a)
{
    const double t = a - of->centre;
    return ((of->c[3] * t + of->c[2]) * t + of->c[1]) * t + of->c[0];
}

/* About where on a curve w is. */
static inline double place_on(const gyro_bouc_wen_table *table, int curve, double w)
{
    double s;
    if (curve == 0 && w > 0.5) {
        s = back_at(table->beside + piece_of(1.0 - w, GYRO_NEAR_LOWEST, GYRO_BACK_BITS, GYRO_NEAR_PIECES), 1.0 - w);
    } else {
        s = back_at(table->back[curve] + piece_of(w, GYRO_CURVE_LOWEST, GYRO_BACK_BITS, GYRO_BACK_PIECES), w);
    }
    return s;
}

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

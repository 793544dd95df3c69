/* The motion near the carrier. Newton's law of the straight forces, with s the time derivative,

       (s² + C s + K) q = f/m,

   splits into a factor for each sense of rotation: with the 2 x 2 matrix S whose eigenvalues are the roots of positive frequency,

       S² + C S + K = 0,   (s + C + S)(s - S) q = f/m.

   In amplitudes relative to a carrier of rate ω, s becomes d/dt + iω. The first factor is then 2iω and more, and answers at once:

       q' = (S - iω) q + B f,   B = (iω + C + S)⁻¹/m.

   The steady state at any detuning and the free motion of both modes, frequency and decay, are exact; so is, where force or parameters jump,
   the free motion that this sets off, since displacement and velocity there are those of the present phase of the carrier (plant.c, joined):
   without it, that motion would be off by Δ/(2ω), Δ the distance of the mode from the carrier, or 1/(4 Q) on resonance. The usual reduction, detuning
   (k - mω²)/(2mω), is the first term of S - iω; it moves the beat of a mode Δ away from the carrier by Δ²/(2ω). */

#ifndef GYRO_SLOW_H
#define GYRO_SLOW_H

#include "complex2.h"
#include "generated/names.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

typedef struct {
    matrix stiffness; /* K, 1/s² */
    matrix damping;   /* C with the Coriolis coupling, 1/s */
    matrix rate;      /* S, 1/s */
    matrix input;     /* B, s/kg */
    double carrier;   /* ω, rad/s */
    double step;      /* length that decay and gain are for, s */
    matrix decay;     /* q over a step without force: e^(A step), A = S - iω */
    matrix gain;      /* what a held force adds in a step: ∫ e^(A s) ds B, m/N */
} gyro_slow;

/* Brings `slow` up to date; does nothing where no argument has changed. NaN where the device does not oscillate. */
void gyro_find_slow(gyro_slow *slow, matrix stiffness, matrix damping, double carrier, double inverse_mass, double step);

/* A root R of the covariance that white noise gathers in a step: R R* = ∫ e^(A s) N e^(A s)* ds, lower triangular; N Hermitian, m²/s. */
matrix gyro_gathered(const gyro_slow *slow, matrix noise);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

/* The motion over one sample period: exact for what is linear, fourth order for the rest, with the delay of the force cut out exactly. */

#ifndef MOTION_H
#define MOTION_H

#include "known.h"

/* Of the linear part over a duration: the state moves by phi, a held force by gamma; both to first order in the rate of turn. */
typedef struct {
    double phi[NS * NS], phi_by_omega[NS * NS];
    double gamma[NS * 2], gamma_by_omega[NS * 2];
} transition;

/* A first-order lag over a duration h of an input that is a polynomial of fifth degree in time, from its value, slope h v' and curvature h^2 v''
   at both ends: l(h) = stay l(0) + sum of start[i] and end[i] times them; and the derivatives by the time constant. */
typedef struct {
    double stay, start[3], end[3];
    double stay_by_tau, start_by_tau[3], end_by_tau[3];
} lagging;

/* A part of the sample period in which the force at the mass stays as it is. */
typedef struct {
    double duration; /* [s] */
    transition whole, half;
    lagging lag;
} piece;

/* What a known device does in one sample period; formed anew when its parameters change. */
typedef struct {
    double period;         /* [s] */
    double omega_z;        /* rate at which it is formed [rad/s] */
    double b[NS * 2];      /* rate by force */
    piece pieces[2];       /* until the change of the delayed force, and from then on; without a delay the second is the period */
    int64_t delay_samples; /* whole periods of the delay */
    double delay_rest;     /* the rest of it [s] */
    double lag;            /* time constant of the amplifier [s] */
} motion;

/* One piece of the motion: the states at three instants, and the transitions at the rate of turn that held. */
typedef struct {
    double start[NS], middle[NS], end[NS];
    double whole[NS * NS], half[NS * NS], force[NS * 2];
} passage;

/* Writes phi = exp(a duration) [n * n] and gamma = the integral of exp(a s) b over it [n * 2]; n <= NS. */
void transition_over(const double *a, const double *b, int n, double duration, double *phi, double *gamma);

/* Forms the motion of `k` at the rate `omega_z`. */
void motion_form(motion *m, const known *k, double omega_z, double period);

/* The same as if the force were held over the whole period and nothing lagged. */
void motion_form_held(motion *m, const known *k, double omega_z, double period);

/* Moves the state `start` [NS] through a piece under `force` [N]. */
void motion_move(const motion *m, const piece *part, const known *k, double omega_z, const double force[2], const double *start, passage *way);

#endif

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
    transition whole, near, far; /* over all of it, and from its start to the two nodes */
    lagging lag;
} piece;

/* What a known device does in one sample period; formed anew when its parameters change. */
typedef struct {
    double period;         /* [s] */
    double omega_z;        /* rate at which it is formed [rad/s] */
    double a[NS * NS];     /* rate by states, of what is linear */
    double b[NS * 2];      /* rate by force */
    piece pieces[2];       /* until the change of the delayed force, and from then on; without a delay the second is the period */
    int64_t delay_samples; /* whole periods of the delay */
    double delay_rest;     /* the rest of it [s] */
    double lag;            /* time constant of the amplifier [s] */
    double lag_by_p[NP];   /* its derivatives by p */
    double by_lag[NS * NS]; /* how a correction of the states answers to it, per deviation seen: A (1 + lag A)^-1, to the second power of A */
} motion;

/* What the linear part leaves out, and derivatives, are integrated over a piece by the rule of Gauss with two nodes: order 4, its error is
   (omega h)^4/4320 of them. The nodes lie symmetric, so that what leads from one to the end leads from the start to the other. Both weigh half. */
#define NODES 2

/* One piece of the motion: the states at its nodes and its ends, and the transitions at the rate of turn that held. */
typedef struct {
    double start[NS], s[NODES][NS], end[NS];
    double whole[NS * NS], near[NS * NS], far[NS * NS], force[NS * 2];
} passage;

/* What leads from the start of a piece to a node. */
static inline const double *passage_to(const passage *way, int node) { return node == 0 ? way->near : way->far; }
/* What leads from a node of a piece to its end. */
static inline const double *passage_from(const passage *way, int node) { return node == 0 ? way->far : way->near; }

/* Writes phi = exp(a duration) [n * n] and gamma = the integral of exp(a s) b over it [n * 2]; n <= NS. */
void transition_over(const double *a, const double *b, int n, double duration, double *phi, double *gamma);

/* Forms the motion of `k` at the rate `omega_z`. */
void motion_form(motion *m, const known *k, double omega_z, double period);

/* The same as if the force were held over the whole period and nothing lagged. */
void motion_form_held(motion *m, const known *k, double omega_z, double period);

/* Forms a piece of that duration [s], above zero, for `k` at the rate `omega_z`; nothing lags. */
void motion_form_piece(piece *part, const known *k, double omega_z, double duration);

/* Moves the state `start` [NS] through a piece under `force` [N]; `turn`: what `omega_z` is beyond the rate at which the piece was formed. */
void motion_move(const piece *part, const known *k, double turn, double omega_z, const double force[2], const double *start, passage *way);

#endif

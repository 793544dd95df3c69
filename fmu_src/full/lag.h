/* First-order lag of a voltage over a step: exact in the lag, the voltage that enters taken as a polynomial. */

#ifndef GYRO_LAG_H
#define GYRO_LAG_H

#include "generated/names.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* The voltage enters at these parts of a step: the nodes of Gauss and Lobatto, both ends among them. Between them the polynomial is off by
   less than (ωh)^6/3e6 of a sine: 1e-12 at 3.8 kHz and 5 us. */
enum { GYRO_LAG_NODES = 6 };
extern const double gyro_lag_nodes[GYRO_LAG_NODES];

/* Weights for one step and course of the time constant. */
typedef struct {
    double step;                   /* s */
    double tau[GYRO_LAG_NODES];    /* time constant at each node, s */
    double weight[GYRO_LAG_NODES]; /* out = before + sum of weight (entering - before) */
} gyro_lag_weights;

/* Kept, since both seldom change; two, since a delayed force cuts every sample period into two steps. */
typedef struct {
    gyro_lag_weights kept[2];
    int latest; /* of them */
} gyro_lag;

/* Finds the weights for a step [s] with the time constants `tau` [s] at its nodes, unless they are those that it has. Where tau is not
   above zero at some node, the last one holds throughout; where that is zero too, what enters at the end is what leaves. */
void gyro_weigh_lag(gyro_lag *lag, double step, const double tau[GYRO_LAG_NODES]);

/* The voltage behind the lag at the end of the step [V], from that at its start and what enters. */
double gyro_lagged(const gyro_lag *lag, double before, const double entering[GYRO_LAG_NODES]);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

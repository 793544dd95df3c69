/* The table of propagator.h where forces with states of their own act, which are linear in all states: over a step h

       s(t + h) = s + sum over k of rate^k M_k r

   with the rates r at its start. */

#ifndef GYRO_COUPLED_H
#define GYRO_COUPLED_H

#include "propagator.h"
#include "slopes.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

typedef struct {
    double step; /* s; 0: there is no table */
    double most; /* up to this rate the powers left out are below GYRO_RATE_ERROR, rad/s */
    chosen moving;
    double unit[GYRO_N_STATES]; /* of those that move, in which they move alike, SI */
    double within;              /* how far they may go in a step, over their units and the largest rate, s */
    double beside;              /* by how much they may be beside cubics through its ends, likewise, s */
    double part[GYRO_RATE_POWERS][GYRO_N_STATES][GYRO_N_STATES]; /* by power, then by rate and state of those that move, s in their units */
} gyro_coupled;

/* Tabulates for a step [s] with the parameters of the view, which is `even`. */
void gyro_tabulate_coupled(gyro_coupled *table, const gyro_view *view, double step);

/* Whether the table holds for a step [s] at the present rate. */
static inline int gyro_coupled_holds(const gyro_coupled *table, const gyro_view *g, double step)
{
    return step == table->step && fabs(g->p[GYRO_OMEGA_Z]) <= table->most;
}

/* What the rates at the start of a step change, by one power of the rate. */
static inline void add_changes(const gyro_coupled *table, int power, const double rate[], double change[])
{
    for (int i = 0; i < table->moving.n; i++) {
        change[i] = 0.0;
    }
    for (int j = 0; j < table->moving.n; j++) {
        const double *column = table->part[power][j], own = rate[table->moving.place[j]];
        for (int i = 0; i < table->moving.n; i++) {
            change[i] += own * column[i];
        }
    }
}

/* What the step of the table changes, of the states that move, by all rates at its start and the rate that the device turns at [rad/s]. */
static inline void find_changes(const gyro_coupled *table, double turning, const double rate[], double sum[])
{
    double change[GYRO_N_STATES], times = turning;
    add_changes(table, 0, rate, sum);
    for (int k = 1; k < GYRO_RATE_POWERS && times != 0.0; k++) {
        add_changes(table, k, rate, change);
        for (int i = 0; i < table->moving.n; i++) {
            sum[i] += times * change[i];
        }
        times *= turning;
    }
}

/* Moves the states of the view by the step of the table. */
static inline void gyro_apply_coupled(const gyro_coupled *table, gyro_view *g)
{
    double rate[GYRO_N_STATES], change[GYRO_N_STATES];
    state_rate(g, rate);
    find_changes(table, g->p[GYRO_OMEGA_Z], rate, change);
    for (int i = 0; i < table->moving.n; i++) {
        g->s[table->moving.place[i]] += change[i];
    }
}

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

/* The motion where forces bend it in places alone, as a dry friction does near rest and a stop where it touches. In between it is even, and the table
   of coupled.h moves it, with these forces as they are at the start of a step. */

#ifndef GYRO_LEVEL_H
#define GYRO_LEVEL_H

#include <string.h>

#include "coupled.h"
#include "generated/rooms.h"

/* The view without the forces that bend it in places. */
static inline gyro_view view_between(const gyro_view *g)
{
    gyro_view between = *g;
    between.n_acting = 0;
    for (int i = 0; i < GYRO_N_LEVEL; i++) {
        between.active[gyro_level[i]] = 0;
    }
    for (int i = 0; i < g->n_acting; i++) {
        if (between.active[g->acting[i]]) {
            between.acting[between.n_acting++] = g->acting[i];
        }
    }
    return between;
}

/* How far a curve through both ends of a step h [s] may lie beside the line through them, at most: 4/27 of what the rates there [SI/s] are beside that
   of the line. */
static inline double beside_line(double h, double change, const double rate[2])
{
    const double along = change / h;
    return 4.0 / 27.0 * h * (fabs(rate[0] - along) + fabs(rate[1] - along));
}

/* Whether a state that changes by so much, and lies so far beside the line at most, stays in its room, in its unit. */
static inline int goes_within(const double room[2], double change, double beside)
{
    return beside + larger(-change, 0.0) < room[0] && beside + larger(change, 0.0) < room[1];
}

/* The largest rate, in the units of the table. */
static inline double largest_rate_of(const gyro_coupled *table, const double rate[])
{
    double most = 0.0;
    for (int i = 0; i < table->moving.n; i++) {
        most = larger(most, fabs(rate[table->moving.place[i]]) / table->unit[i]);
    }
    return most;
}

/* How far states may go, as the largest rate at the start allows, and whether none leaves its room so. */
static inline int stays_surely(const gyro_coupled *table, const double room[GYRO_N_STATES][2], double fastest)
{
    int within = 1;
    for (int i = 0; i < table->moving.n && within; i++) {
        const double *own = room[table->moving.place[i]];
        within = table->within * fastest * table->unit[i] < smaller(own[0], own[1]);
    }
    return within;
}

/* Whether in a step that has the rates `rate` [SI/s] at its ends and changes the states that move by `change` none leaves its room. */
static inline int stays_within(const gyro_coupled *table, const double room[GYRO_N_STATES][2], double fastest, const double rate[2][GYRO_N_STATES],
                               const double change[GYRO_N_STATES])
{
    int within = 1;
    for (int i = 0; i < table->moving.n && within; i++) {
        const int place = table->moving.place[i];
        const double ends[2] = {rate[0][place], rate[1][place]};
        const double beside = beside_line(table->step, change[i], ends) + table->beside * fastest * table->unit[i];
        within = goes_within(room[place], change[i], beside);
    }
    return within;
}

/* Moves the states of the view by the step of the table where no force bends the motion in it; gives 0 where one may, and then has moved nothing. */
static inline int move_between(const gyro_coupled *table, gyro_view *g)
{
    double room[GYRO_N_STATES][2], rate[2][GYRO_N_STATES], change[GYRO_N_STATES], before[GYRO_N_STATES];
    const double(*rooms)[2] = (const double(*)[2])room;
    int moves = find_room(g, room);
    if (moves) {
        memcpy(before, g->s, sizeof before);
        state_rate(g, rate[0]);
        const double fastest = largest_rate_of(table, rate[0]);
        find_changes(table, g->p[GYRO_OMEGA_Z], rate[0], change);
        for (int i = 0; i < table->moving.n; i++) {
            g->s[table->moving.place[i]] += change[i];
        }
        if (!stays_surely(table, rooms, fastest)) {
            state_rate(g, rate[1]);
            moves = stays_within(table, rooms, fastest, (const double(*)[GYRO_N_STATES])rate, change);
        }
        if (!moves) {
            memcpy(g->s, before, sizeof before);
        }
    }
    return moves;
}

#endif

/* A view at the nodes of a part of a run. Used by variation.c and by generated/forces.h. */

#ifndef GYRO_NODES_H
#define GYRO_NODES_H

#include "passing.h"
#include "variation.h"

/* Nodes of some pieces of a run, or its samples. */
typedef struct {
    const gyro_run *run;
    int each;                             /* nodes a piece */
    const int64_t *lies;                  /* the step that each piece lies in, shape (n / each) */
    const double *place;                  /* of each node in it, shape (n) */
    int64_t n;                            /* nodes */
    const double (*state)[GYRO_N_STATES]; /* shape (n, GYRO_N_STATES), SI */
    const double (*rate)[GYRO_N_STATES];  /* of the run, likewise, SI/s */
    const double *command;                /* where it is another than that of the step, shape (n, 2), N; else NULL */
} gyro_nodes;

static inline int64_t step_of(const gyro_nodes *at, int64_t i) { return at->lies[i / at->each]; }

static inline void take_inputs(gyro_view *g, const gyro_run *run, int64_t step)
{
    const double *values = run->values + step * run->n_inputs;
    for (int64_t i = 0; i < run->n_inputs; i++) {
        g->p[run->inputs[i]] = values[i];
    }
}

/* The force in the view, as its parameters are. */
static inline void bring_command(gyro_view *g)
{
    g->u[0] = g->p[GYRO_U_X];
    g->u[1] = g->p[GYRO_U_Y];
    actuate(g);
}

/* Another command [N] than that of the step; NULL: none. */
static inline void take_command(gyro_view *g, const double *command)
{
    if (command) {
        g->p[GYRO_U_X] = command[0];
        g->p[GYRO_U_Y] = command[1];
    }
}

/* The same where the force has been brought. */
static inline void press(gyro_view *g, const double *command)
{
    if (command) {
        take_command(g, command);
        bring_command(g);
    }
}

static inline const double *command_of(const gyro_nodes *at, int64_t i) { return at->command ? at->command + 2 * i : NULL; }

/* Inputs at a node, which stay over its step, where no law acts. */
static inline void bring_inputs(gyro_view *g, const gyro_nodes *at, int64_t i)
{
    if (i % at->each == 0) {
        take_inputs(g, at->run, step_of(at, i));
        take_command(g, command_of(at, i));
        take_made(g, g->p);
    }
}

/* Time, inputs and command at a node, where no law acts. */
static inline void bring_all(gyro_view *g, const gyro_nodes *at, int64_t i)
{
    g->t = at->run->start + ((double)step_of(at, i) + at->place[i]) * at->run->step;
    bring_inputs(g, at, i);
    bring_command(g);
}

#endif

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

/* Steps that pass before a command acts, but for a part of one. */
static inline int64_t late_steps(const gyro_run *run) { return (int64_t)run->late; }

/* The part of a step in which a late command comes. */
static inline double late_part(const gyro_run *run) { return run->late - (double)late_steps(run); }

/* The step whose command acts at a part of `step`. */
static inline int64_t acting_step(const gyro_run *run, int64_t step, double part)
{
    const int64_t from = step - late_steps(run) - (part < late_part(run));
    return from > 0 ? from : 0;
}

static inline int is_command(uint32_t input) { return input == GYRO_U_X || input == GYRO_U_Y; }

/* Inputs at a part of a step. */
static inline void take_inputs(gyro_view *g, const gyro_run *run, int64_t step, double part)
{
    const double *values = run->values + step * run->n_inputs, *acting = run->values + acting_step(run, step, part) * run->n_inputs;
    for (int64_t i = 0; i < run->n_inputs; i++) {
        g->p[run->inputs[i]] = is_command(run->inputs[i]) ? acting[i] : values[i];
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

/* Inputs at a node, which stay over its piece, where no law acts. */
static inline void bring_inputs(gyro_view *g, const gyro_nodes *at, int64_t i)
{
    if (i % at->each == 0) {
        take_inputs(g, at->run, step_of(at, i), at->place[i]);
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

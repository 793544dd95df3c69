/* What is taken along a run: a view of an instance. Used by follow.c, linearise.c and variation.c. */

#ifndef GYRO_TRAVELLER_H
#define GYRO_TRAVELLER_H

#include <string.h>

#include "fmi_common.h"
#include "generated/forces.h"
#include "level.h"
#include "plant.h"

/* Pieces that pass differences on alike: whole steps, and their parts before and after a late force comes. */
enum { KIND_WHOLE, KIND_BEFORE, KIND_AFTER, KINDS };

/* Numbers that a column of the states that move takes: a whole number of four, by which processors add them. */
enum { ROOM = (GYRO_N_STATES + 3) / 4 * 4 };
static inline int column_room(int n) { return (n + 3) / 4 * 4; }

/* Of a step, what a late force may be off an end of one and come there: less than a millionth of it changes a column by no more. */
static const double NO_PART = 1e-6;

/* States that move beside those of a run, of which a small force on its motion comes: linear, driven by the states of the run. */
typedef struct {
    chosen among;
    matrix slope;             /* how their rates go with them, 1/s in their units */
    passing to[KINDS][NODES]; /* the nodes of a piece, by its kind */
    passing whole[KINDS];
    double state[GYRO_N_STATES]; /* SI */
} driven;

/* A view of an instance that is taken along a run. */
typedef struct {
    gyro_view view;
    double value[GYRO_N_VARIABLES]; /* as set, SI */
    int n_events;                   /* effects that switch */
    int switches[GYRO_N_EFFECTS];   /* these, by effect */
    double event[GYRO_N_EFFECTS];   /* when each does, s */
    chosen moving;                  /* states of the run that move, those of the motion first */
    double difference[ROOM];        /* of its states and those of the run, by `moving`, SI */
    driven own;                     /* where a force with states acts that does not in the run */
    int n_forced;                   /* states of the run that effects add, of which the rates differ */
    int forced[GYRO_N_STATES];      /* these, by `moving` */
    double lighter;                 /* mass of the run over its own, less 1 */
    int lawful;                     /* a law acts: each force may be another than that of the run */
    int maps;                       /* the command changes on its way to the mass, here or in the run */
    int n_added, n_left;            /* forces here, and of the run, where they are not the same */
    int added[GYRO_N_FORCES], left[GYRO_N_FORCES];
} traveller;

/* The first of the states that move: displacement and speed of each axis that a run has. */
static inline int motion_of(const gyro_run *run) { return 2 * (int)run->axes; }

/* The states of a run that move, with the parameters of the view. */
static inline chosen moving_of(const gyro_view *view, const gyro_run *run)
{
    chosen all = states_of(view, NULL);
    const int left_out = MOTION - motion_of(run);
    all.n -= left_out;
    for (int k = motion_of(run); k < all.n; k++) {
        all.place[k] = all.place[k + left_out];
    }
    return all;
}

/* Whether the sizes of a run can be those of one, and its inputs are inputs. */
static inline int is_run(const gyro_run *run)
{
    int good = run->steps >= 0 && run->stride >= 1 && run->axes >= 1 && run->axes <= 2 && run->n_inputs >= 0 && run->n_inputs <= GYRO_N_INPUTS;
    for (int64_t i = 0; good && i < run->n_inputs; i++) {
        good = run->inputs[i] < GYRO_N_INPUTS;
    }
    return good;
}

/* Whether no input but the force is another in a step than in the one before. */
static inline int is_alike(const gyro_run *run, int64_t step)
{
    int alike = step > 0;
    const double *now = run->values + step * run->n_inputs;
    for (int64_t i = 0; i < run->n_inputs && alike; i++) {
        const uint32_t vr = run->inputs[i];
        alike = is_command(vr) || now[i] == now[i - run->n_inputs];
    }
    return alike;
}

/* Whether nothing bends the motion, so that its slopes go with the inputs beside the force alone. */
static inline int is_straight(const gyro_view *view)
{
    int straight = !view->any_law;
    for (int i = 0; i < GYRO_N_BENDING; i++) {
        straight &= !view->active[gyro_bending[i]];
    }
    return straight;
}

/* The same in between, where forces bend it in places alone. */
static inline int is_straight_between(const gyro_view *view) { return is_straight(view) || (!view->any_law && is_even_between(view)); }

/* 0 where something acts that carries more than the states from step to step, or acts between them. */
static inline int is_followed(const gyro_instance *g)
{
    int lagging = 0;
    for (int i = 0; i < GYRO_N_LAGGING; i++) {
        lagging |= g->view.active[follow_effects[i]];
    }
    return !(g->plan.any_lag || g->view.any_memory || g->view.any_impulse || g->view.any_rate || lagging);
}

/* Steps of a run that the force of an instance is late. */
static inline double late_of(const gyro_instance *g, const gyro_run *run)
{
    const double late = gyro_between((gyro_instant){0, 0.0}, g->plan.delay) / run->step, nearest = (double)(int64_t)(late + 0.5);
    return late - nearest > -NO_PART && late - nearest < NO_PART ? nearest : late;
}

/* The length of a piece by its kind, steps. */
static inline double length_of_kind(const gyro_run *run, int kind)
{
    return kind == KIND_WHOLE ? 1.0 : kind == KIND_BEFORE ? late_part(run) : 1.0 - late_part(run);
}

static inline void set_off(const gyro_instance *g, traveller *at)
{
    at->view = g->view;
    memcpy(at->value, g->value, sizeof at->value);
    for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
        at->event[effect] = INFINITY;
        at->view.after[effect] = 0.0;
    }
    event_times(&at->view, at->event);
    at->n_events = 0;
    for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
        at->switches[at->n_events] = effect;
        at->n_events += at->event[effect] < INFINITY;
    }
}

/* Inputs and events of a part of a step; an event within the step counts from its nearer end. */
static inline void come_to(traveller *at, const gyro_run *run, int64_t step, double part)
{
    gyro_view *view = &at->view;
    take_inputs(view, run, step, part);
    if (view->any_law) {
        const double *values = run->values + step * run->n_inputs, middle = run->start + ((double)step + 0.5) * run->step;
        for (int64_t i = 0; i < run->n_inputs; i++) {
            at->value[run->inputs[i]] = values[i];
        }
        for (int i = 0; i < at->n_events; i++) {
            const int effect = at->switches[i];
            view->after[effect] = middle >= at->event[effect] ? 1.0 : 0.0;
        }
    } else {
        take_made(view, view->p);
        bring_command(view);
    }
}

/* The view at a part of a step, in some states. */
static inline void look_from(traveller *at, const gyro_run *run, int64_t step, double part, const double state[GYRO_N_STATES])
{
    gyro_view *view = &at->view;
    for (int i = 0; i < GYRO_N_STATES; i++) {
        view->s[i] = state[i];
    }
    view->t = run->start + ((double)step + part) * run->step;
    if (view->any_law) {
        view->since = part * run->step;
        apply_laws(view, at->value);
        bring_command(view);
    }
}

/* The voltage at a part of a step, in some states. */
static inline void find_voltage(traveller *at, const gyro_run *run, int64_t step, double part, const double state[GYRO_N_STATES], double found[2])
{
    gyro_view *view = &at->view;
    if (view->any_law || view->any_map) {
        come_to(at, run, step, part);
    }
    look_from(at, run, step, part, state);
    pick_off(view);
    amplify(view);
    convert(view);
    found[0] = view->v[0];
    found[1] = view->v[1];
}

/* The command [N] after so many steps, where it is another than that which was held; else NULL. */
static inline const double *command_after(const gyro_run *run, int64_t steps)
{
    return run->command && steps % run->stride == 0 ? run->command + 2 * (steps / run->stride) : NULL;
}

/* The accelerations of the view, under the force of `command` [N]; NULL: under that which acts. */
static inline void find_acceleration(gyro_view *view, const double *command, double found[2])
{
    double rate[GYRO_N_STATES];
    press(view, command);
    state_rate(view, rate);
    found[0] = rate[GYRO_STATE_X_DOT];
    found[1] = rate[GYRO_STATE_Y_DOT];
}

#endif

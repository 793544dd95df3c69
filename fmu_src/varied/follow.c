/* A run whose columns are wanted: its motion. variation.c says what for. */

#include "traveller.h"

/* Room for parts at first, beside one for each step: a drive that rubs turns round in one of 25, by some fifteen parts. */
enum { FIRST_PARTS = 64 };

int32_t gyro_acceleration(void *instance, const double *command, double found[2])
{
    gyro_view view = ((fmi_instance *)instance)->core->view;
    find_acceleration(&view, command, found);
    return 0;
}

/* Whether a force acts that bends the motion in places, where the series of the plant can say in which part of a step. */
static int is_bent_in_places(const gyro_instance *g)
{
    int cut = 0;
    for (int i = 0; i < GYRO_N_LEVEL; i++) {
        cut |= g->view.active[gyro_level[i]];
    }
    return cut && g->plan.series.holds;
}

int gyro_measure(void *instance, gyro_run *run)
{
    const gyro_instance *g = ((fmi_instance *)instance)->core;
    int followed = is_run(run) && is_followed(g), alike = followed;
    run->late = followed ? late_of(g, run) : 0.0;
    const int cut = late_part(run) > 0.0;
    /* The motion up to where a late force comes is found by the plant's series. */
    followed = followed && (!cut || g->plan.series.holds);
    for (int64_t step = 1; step < run->steps && alike; step++) {
        alike = is_alike(run, step);
    }
    run->states = GYRO_N_STATES;
    run->moving = moving_of(&g->view, run).n;
    run->room = column_room((int)run->moving);
    run->even = alike && is_straight(&g->view);
    run->shared = alike && is_straight_between(&g->view);
    run->kinds = cut ? KINDS : 1;
    run->parts = is_bent_in_places(g) ? FIRST_PARTS + run->steps : 0;
    run->size = (int64_t)sizeof(traveller);
    return followed;
}

/* Keeps the states of an instance that move, and its sample. */
static void keep(const gyro_instance *g, const chosen *moving, const gyro_run *run, int64_t step)
{
    double *state = run->state + step * GYRO_N_STATES;
    memset(state, 0, GYRO_N_STATES * sizeof *state);
    for (int k = 0; k < moving->n; k++) {
        state[moving->place[k]] = g->view.s[moving->place[k]];
    }
    memcpy(run->voltage + 2 * step, g->memory.sample, sizeof g->memory.sample);
}

int gyro_follow(void *instance, const gyro_run *run)
{
    fmi_instance *f = instance;
    gyro_instance *g = f->core;
    traveller *base = run->base;
    const size_t n = (size_t)run->n_inputs;
    int followed = 1;
    base->moving = moving_of(&g->view, run);
    keep(g, &base->moving, run, 0);
    for (int64_t step = 0; step < run->steps && followed; step++) {
        const double *values = run->values + step * run->n_inputs, from = run->start + (double)step * run->step;
        followed = fmi_set(f, "gyro_follow", GYRO_REAL, run->inputs, n, values, n) == FMI_OK && fmi_step(f, "gyro_follow", from, run->step) == FMI_OK;
        followed = followed && (run->axes > 1 || (g->view.s[GYRO_STATE_Y] == 0.0 && g->view.s[GYRO_STATE_Y_DOT] == 0.0));
        keep(g, &base->moving, run, step + 1);
    }
    if (followed) {
        set_off(g, base);
    }
    return followed;
}

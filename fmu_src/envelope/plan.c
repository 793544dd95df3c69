/* What follows from the parameters of an instance of the envelope form. */

#include <string.h>

#include "plant.h"

void gyro_drop(gyro_instance *g) { (void)g; }

static const char *foreign_effect(const gyro_instance *g, const double value[GYRO_N_VARIABLES])
{
    gyro_view trial = g->view;
    memcpy(trial.p, value, sizeof trial.p);
    find_active(&trial);
    return refused_effect(&trial);
}

const char *gyro_foreign_effect(const gyro_instance *g, uint32_t vr, double value)
{
    double values[GYRO_N_VARIABLES];
    memcpy(values, g->value, sizeof values);
    values[vr] = value;
    return foreign_effect(g, values);
}

gyro_status gyro_prepare(gyro_instance *g)
{
    gyro_view *view = &g->view;
    gyro_status status = gyro_check(g);
    if (status == GYRO_OK) {
        g->plan.cuts.grid = gyro_beat_of(g->value[GYRO_INTERNAL_STEP]);
        g->plan.cuts.sample = g->plan.cuts.grid;
        const char *why = gyro_impossible_clock(g);
        status = why != NULL ? gyro_refuse(g, "%s", why) : GYRO_OK;
    }
    if (status == GYRO_OK) {
        /* Inputs may have been set that do not act yet. */
        const double *acting = g->memory.clock.held;
        g->plan.step = g->value[GYRO_INTERNAL_STEP];
        g->plan.noise_scale = sqrt(2.0 * g->value[GYRO_SAMPLE_PERIOD] / g->plan.step);
        memcpy(view->p, acting, sizeof view->p);
        take_made(view, acting);
        view->inverse_mass = 1.0 / g->value[GYRO_M];
        view->t = gyro_time_of(g, g->memory.clock.settled);
        view->since = 0.0;
        find_active(view);
        gyro_plan_cuts(g);
        const char *pending = foreign_effect(g, g->value);
        const char *refused = pending != NULL ? pending : refused_effect(view);
        if (refused != NULL) {
            status = gyro_refuse(g, "effect %s has states and is not linear, or remembers the fast signal, which the envelope form can't follow: use the full FMU, or leave its sizes neutral",
                                 refused);
        }
    }
    return status;
}

void gyro_before_tuning(gyro_instance *g) { (void)g; }

void gyro_after_tuning(gyro_instance *g, const unsigned char acted[GYRO_N_EFFECTS])
{
    /* Mean and harmonics answer at once; what made them may act no more. */
    gyro_harmonics *q = &g->memory.q;
    const gyro_harmonics carrier = {{0.0, 0.0}, {q->part[0]}};
    (void)acted;
    *q = carrier;
    g->memory.jumped = 1;
}

size_t gyro_room(const gyro_instance *g)
{
    (void)g;
    return 0;
}

gyro_status gyro_make_room(gyro_instance *g)
{
    (void)g;
    return GYRO_OK;
}

const char *gyro_impossible_memory(const gyro_instance *g)
{
    const gyro_memory *memory = &g->memory;
    return memory->phase_at.tick < 0 || gyro_before(memory->clock.settled, memory->phase_at) ? "its carrier changes in the future" : NULL;
}

const char *gyro_impossible_room(const gyro_instance *g)
{
    (void)g;
    return NULL;
}

void gyro_list_parts(gyro_instance *g, gyro_part parts[])
{
    parts[0] = (gyro_part){g->value, sizeof g->value};
    parts[1] = (gyro_part){&g->memory, sizeof g->memory};
    parts[2] = (gyro_part){g->view.lagging, sizeof g->view.lagging};
    parts[3] = (gyro_part){g->view.remembered, sizeof g->view.remembered};
    parts[4] = (gyro_part){NULL, 0};
}

const char *gyro_infinite_state(const gyro_instance *g)
{
    static const char *const names[] = {"the amplitude of x", "the amplitude of y"};
    const char *name = NULL;
    for (int axis = 0; axis < 2 && name == NULL; axis++) {
        const number q = g->memory.q.part[0].e[axis];
        if (!(gyro_finite(q.re) && gyro_finite(q.im) && gyro_finite(g->memory.q.mean[axis]))) {
            name = names[axis];
        }
    }
    return name;
}

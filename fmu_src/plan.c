/* What follows from the parameters of an instance: samples and delay. */

#include <stdlib.h>
#include <string.h>

#include "plant.h"

void gyro_drop(gyro_instance *g)
{
    free(g->delay_line);
    g->delay_line = NULL;
    g->delay_length = 0;
}

static gyro_status plan_samples(gyro_instance *g)
{
    const double step = g->value[GYRO_INTERNAL_STEP], period = g->value[GYRO_SAMPLE_PERIOD];
    gyro_status status = GYRO_OK;
    int64_t ticks;
    g->plan.step = step;
    if (!gyro_whole_steps(period, step, GYRO_ON_GRID, &ticks) || ticks < 1) {
        const double below = floor(period / step) > 1.0 ? floor(period / step) : 1.0;
        status = gyro_refuse(g, "sample_period = %.9g s is no multiple of internal_step = %.9g s: nearest are %.9g s and %.9g s", period, step,
                             below * step, (below + 1.0) * step);
    }
    g->plan.sample_ticks = ticks;
    return status;
}

static void plan_delay(gyro_instance *g)
{
    const double steps = force_delay(&g->view) / g->plan.step;
    const double nearest = floor(steps + 0.5);
    const double whole = fabs(steps - nearest) <= GYRO_ON_GRID ? nearest : floor(steps);
    g->plan.any_delay = steps > 0.0;
    g->plan.delay_ticks = (int64_t)whole;
    g->plan.delay_fraction = larger(0.0, steps - whole);
}

size_t gyro_room(const gyro_instance *g)
{
    return g->plan.any_delay ? ((size_t)g->plan.delay_ticks + 2) * sizeof *g->delay_line : 0;
}

gyro_status gyro_make_room(gyro_instance *g)
{
    gyro_status status = GYRO_OK;
    const size_t room = gyro_room(g);
    gyro_drop(g);
    if (room > 0) {
        g->delay_line = calloc(1, room);
        g->delay_length = g->delay_line != NULL ? room / sizeof *g->delay_line : 0;
        if (g->delay_line == NULL) {
            status = gyro_refuse(g, "no memory for a delay of %.9g s: make internal_step longer", force_delay(&g->view));
        }
    }
    return status;
}

const char *gyro_impossible_memory(const gyro_instance *g)
{
    const gyro_memory *m = &g->memory;
    const char *why = NULL;
    if (m->tick < 0 || m->tick > GYRO_MOST_STEPS || m->sample < 0 || m->sample > GYRO_MOST_STEPS) {
        why = "its count of steps or samples is impossible";
    } else if (m->ticks_to_sample < 1 || m->ticks_to_sample > g->plan.sample_ticks) {
        why = "its next sample is not within a sample period";
    }
    return why;
}

gyro_status gyro_prepare(gyro_instance *g)
{
    gyro_view *view = &g->view;
    gyro_status status = gyro_check(g);
    if (status == GYRO_OK) {
        status = plan_samples(g);
    }
    if (status == GYRO_OK) {
        memcpy(view->p, g->value, sizeof view->p);
        view->inverse_mass = 1.0 / g->value[GYRO_M];
        view->t = gyro_time(g);
        view->step_start = view->t;
        find_active(view);
        gyro_plan_events(g);
        gyro_pass_events(g, g->memory.tick, 0.0);
        g->plan.any_draw = 0;
        for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
            g->plan.any_draw |= (unsigned char)(streams[effect] != 0u && view->active[effect]);
        }
        if (g->plan.any_draw) {
            gyro_pink_design(&g->plan.pink, g->value[GYRO_SAMPLE_PERIOD]);
        }
        g->plan.any_lag = (unsigned char)lag_acts(view);
        plan_delay(g);
    }
    return status;
}

void gyro_list_parts(gyro_instance *g, gyro_part parts[])
{
    parts[0] = (gyro_part){g->value, sizeof g->value};
    parts[1] = (gyro_part){&g->memory, sizeof g->memory};
    parts[2] = (gyro_part){g->view.s, sizeof g->view.s};
    parts[3] = (gyro_part){g->view.drawn, sizeof g->view.drawn};
    parts[4] = (gyro_part){g->view.lagging, sizeof g->view.lagging};
    parts[5] = (gyro_part){g->delay_line, g->delay_length * sizeof *g->delay_line};
}

const char *gyro_infinite_state(const gyro_instance *g)
{
    static const char *const names[] = {"x", "x_dot", "y", "y_dot"};
    const char *name = NULL;
    for (int i = 0; i < GYRO_N_STATES && name == NULL; i++) {
        if (!isfinite(g->view.s[i])) {
            name = i <= GYRO_STATE_Y_DOT ? names[i] : "a state of an effect";
        }
    }
    return name;
}

/* What follows from the parameters of an instance, and what it holds of the past. */

#include <stdlib.h>
#include <string.h>

#include "level.h"
#include "plant.h"

static void drop_late(gyro_instance *g)
{
    free(g->late);
    g->late = NULL;
    g->late_first = 0;
    g->late_room = 0;
}

void gyro_drop(gyro_instance *g)
{
    drop_late(g);
    free(g->plan.table);
    g->plan.table = NULL;
}

/* How the motion goes on over the steps between cuts, where nothing bends it. */
static void tabulate(gyro_instance *g)
{
    /* Most steps go from one point of the finer of the two beats to the next, in whole ticks: 1e-6 * 5 is not quite 5e-6. */
    const gyro_beat *grid = &g->plan.cuts.grid, *sample = &g->plan.cuts.sample, *finer = grid->whole < sample->whole ? grid : sample;
    const gyro_instant start = {0, 0.0};
    const gyro_view between = view_between(&g->view);
    for (int i = 0; i < GYRO_LENGTHS; i++) {
        const double step = gyro_between(start, (gyro_instant){finer->whole + i, 0.0});
        g->plan.propagator[i].step = 0.0;
        g->plan.coupled[i].step = 0.0;
        if (i > 0 && !(finer->part > 0.0)) {
            /* All are as long. */
        } else if (g->view.steady) {
            gyro_tabulate(&g->plan.propagator[i], &g->view, step);
        } else if (g->view.even || g->plan.between) {
            gyro_tabulate_coupled(&g->plan.coupled[i], g->plan.between ? &between : &g->view, step);
        }
    }
}

/* Which noises and lags there are, and how the motion goes on. */
static void plan_effects(gyro_instance *g)
{
    g->plan.any_draw = 0;
    for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
        g->plan.any_draw |= (unsigned char)(streams[effect] != 0u && g->view.active[effect]);
    }
    if (g->plan.any_draw) {
        gyro_pink_design(&g->plan.pink, g->value[GYRO_SAMPLE_PERIOD]);
    }
    g->plan.any_lag = (unsigned char)lag_acts(&g->view);
    gyro_plan_series(g);
    g->plan.between = (unsigned char)(!g->view.even && is_even_between(&g->view));
    tabulate(g);
}

void gyro_before_tuning(gyro_instance *g)
{
    if (!g->plan.any_lag) {
        gyro_start_lag(g);
    }
}

void gyro_after_tuning(gyro_instance *g, const unsigned char acted[GYRO_N_EFFECTS])
{
    plan_effects(g);
    for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
        if (streams[effect] != 0u && g->view.active[effect] && !acted[effect]) {
            gyro_draw(g, effect);
        }
    }
}

const char *gyro_foreign_effect(const gyro_instance *g, uint32_t vr, double value)
{
    (void)g, (void)vr, (void)value;
    return NULL;
}

gyro_status gyro_prepare(gyro_instance *g)
{
    gyro_view *view = &g->view;
    gyro_status status = gyro_check(g);
    if (status == GYRO_OK) {
        g->plan.cuts.grid = gyro_beat_of(g->value[GYRO_INTERNAL_STEP]);
        g->plan.cuts.sample = gyro_beat_of(g->value[GYRO_SAMPLE_PERIOD]);
        const char *why = gyro_impossible_clock(g);
        status = why != NULL ? gyro_refuse(g, "%s", why) : GYRO_OK;
    }
    if (status == GYRO_OK) {
        /* Inputs may have been set that do not act yet. */
        const double *acting = g->memory.clock.held;
        memcpy(view->p, acting, sizeof view->p);
        take_made(view, acting);
        view->inverse_mass = 1.0 / g->value[GYRO_M];
        view->t = gyro_time_of(g, g->memory.clock.settled);
        view->since = 0.0;
        find_active(view);
        gyro_plan_cuts(g);
        plan_effects(g);
        gyro_refresh(view, acting);
        g->plan.delay = gyro_instant_of(gyro_ticks(force_delay(view)));
        g->plan.any_delay = g->plan.delay.tick > 0 || g->plan.delay.part > 0.0;
        status = !g->plan.any_delay && g->memory.n_late > 0 ? gyro_refuse(g, "forces are on their way, but there is no delay") : GYRO_OK;
    }
    return status;
}

size_t gyro_room(const gyro_instance *g) { return (size_t)g->memory.n_late * sizeof *g->late; }

gyro_status gyro_make_room(gyro_instance *g)
{
    gyro_status status = GYRO_OK;
    drop_late(g);
    if (g->memory.n_late > 0) {
        g->late = calloc((size_t)g->memory.n_late, sizeof *g->late);
        g->late_room = g->late != NULL ? g->memory.n_late : 0;
        if (g->late == NULL) {
            status = gyro_refuse(g, "no memory for %lld late forces", (long long)g->memory.n_late);
        }
    }
    return status;
}

const char *gyro_impossible_memory(const gyro_instance *g)
{
    /* So that the count in bytes, which is then compared with the bytes present, can't overflow. */
    const int64_t most = INT64_MAX / (int64_t)sizeof(gyro_late_force) / 2;
    return g->memory.n_late < 0 || g->memory.n_late > most || (uint64_t)g->memory.n_late > SIZE_MAX / sizeof(gyro_late_force)
               ? "its count of late forces is impossible"
               : NULL;
}

const char *gyro_impossible_room(const gyro_instance *g)
{
    const char *why = NULL;
    gyro_instant before = {g->memory.clock.now, 0.0};
    for (int64_t i = 0; i < g->memory.n_late && why == NULL; i++) {
        const gyro_instant due = {g->late[g->late_first + i].due, g->plan.delay.part};
        if (!gyro_before(before, due) || due.tick - g->plan.delay.tick > g->memory.clock.now) {
            why = "its late forces act in no order";
        }
        before = due;
    }
    return why;
}

void gyro_list_parts(gyro_instance *g, gyro_part parts[])
{
    parts[0] = (gyro_part){g->value, sizeof g->value};
    parts[1] = (gyro_part){&g->memory, sizeof g->memory};
    parts[2] = (gyro_part){g->view.s, sizeof g->view.s};
    parts[3] = (gyro_part){g->view.drawn, sizeof g->view.drawn};
    parts[4] = (gyro_part){g->view.lagging, sizeof g->view.lagging};
    parts[5] = (gyro_part){g->view.remembered, sizeof g->view.remembered};
    parts[6] = (gyro_part){g->late != NULL ? g->late + g->late_first : NULL, gyro_room(g)};
}

const char *gyro_infinite_state(const gyro_instance *g)
{
    static const char *const names[] = {"x", "x_dot", "y", "y_dot"};
    const char *name = NULL;
    double none = 0.0;
    for (int i = 0; i < GYRO_N_STATES; i++) {
        none += g->view.s[i] - g->view.s[i];
    }
    for (int i = 0; none != 0.0 && i < GYRO_N_STATES && name == NULL; i++) {
        if (!gyro_finite(g->view.s[i])) {
            name = i <= GYRO_STATE_Y_DOT ? names[i] : "a state of an effect";
        }
    }
    return name;
}

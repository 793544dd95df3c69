#include "continuous.h"

#include <string.h>

#include "generated/tangent.h"
#include "gyro_math.h"
#include "plant.h"

/* Where the parts of the continuous states begin. */
enum { AT_LAGGED = GYRO_N_STATES, AT_LAGGING = GYRO_N_STATES + 2, AT_FLOWING = AT_LAGGING + GYRO_N_LAGGING };

/* Bytes of what flows, which is the first that effects remember. */
static const size_t FLOWING = GYRO_N_FLOWING * sizeof(double);

const char *gyro_no_equation(void) { return NULL; }

/* Variable and set value that each lagging quantity follows, with the time constant's variable. */
static double lag_rate(const gyro_view *view, const double value[GYRO_N_VARIABLES], int i)
{
    const double lag = view->p[follow_constants[i]];
    return view->active[follow_effects[i]] && lag > 0.0 ? (value[follow_sources[i]] - view->lagging[i]) / lag : 0.0;
}

/* A view of what acts right after the communication point, with inputs and parameters as they are set; the voltages behind the lag in
   `lagged`. Impulses are left to the step. */
static gyro_view present(gyro_instance *g, double lagged[2])
{
    gyro_view view;
    gyro_peek(g, &view, lagged);
    for (int vr = 0; vr < GYRO_N_VARIABLES; vr++) {
        if (gyro_variables[vr].kind != GYRO_OUTPUT) {
            view.p[vr] = g->value[vr];
        }
    }
    take_made(&view, g->value);
    find_active(&view);
    view.since = 0.0;
    view.u[0] = g->plan.any_delay ? g->memory.acting[0] : g->value[GYRO_U_X];
    view.u[1] = g->plan.any_delay ? g->memory.acting[1] : g->value[GYRO_U_Y];
    return view;
}

void gyro_get_continuous(gyro_instance *g, double states[GYRO_N_CONTINUOUS])
{
    double lagged[2];
    const gyro_view view = present(g, lagged);
    memcpy(states, view.s, sizeof view.s);
    memcpy(states + AT_LAGGED, lagged, sizeof lagged);
    memcpy(states + AT_LAGGING, view.lagging, sizeof view.lagging);
    memcpy(states + AT_FLOWING, view.remembered, FLOWING);
}

void gyro_get_rates(gyro_instance *g, double rates[GYRO_N_CONTINUOUS])
{
    double lagged[2];
    gyro_view view = present(g, lagged);
    if (view.any_law) {
        apply_laws(&view, g->value);
    }
    actuate(&view);
    state_rate(&view, rates);
    flow_memories(&view, rates + AT_FLOWING);
    pick_off(&view);
    const double lag = lag_acts(&view) ? lag_time_constant(&view) : 0.0;
    for (int axis = 0; axis < 2; axis++) {
        rates[AT_LAGGED + axis] = lag > 0.0 ? (view.v[axis] - lagged[axis]) / lag : 0.0;
    }
    for (int i = 0; i < GYRO_N_LAGGING; i++) {
        rates[AT_LAGGING + i] = lag_rate(&view, g->value, i);
    }
}

void gyro_respond(gyro_instance *g, const gyro_direction *along, gyro_response *response)
{
    double lagged[2];
    gyro_view view = present(g, lagged);
    gyro_tangent d;
    memset(&d, 0, sizeof d);
    memset(response, 0, sizeof *response);
    memcpy(d.p, along->input, sizeof along->input);
    memcpy(d.s, along->state, sizeof d.s);
    memcpy(d.lagging, along->state + AT_LAGGING, sizeof d.lagging);
    memcpy(d.remembered, along->state + AT_FLOWING, FLOWING);
    d.u[0] = g->plan.any_delay ? 0.0 : along->input[GYRO_U_X];
    d.u[1] = g->plan.any_delay ? 0.0 : along->input[GYRO_U_Y];
    tangent_laws(&view, g->value, &d);
    tangent_actuate(&view, &d);
    tangent_rate(&view, &d, response->rate);
    tangent_flow(&view, &d, response->rate + AT_FLOWING);
    tangent_pick_off(&view, &d);
    const double lag = lag_acts(&view) ? lag_time_constant(&view) : 0.0;
    const double d_lag = lag_tangent(&d);
    for (int axis = 0; axis < 2 && lag > 0.0; axis++) {
        const double rate = (view.v[axis] - lagged[axis]) / lag;
        response->rate[AT_LAGGED + axis] = (d.v[axis] - along->state[AT_LAGGED + axis] - rate * d_lag) / lag;
    }
    for (int i = 0; i < GYRO_N_LAGGING; i++) {
        const double constant = view.p[follow_constants[i]];
        if (view.active[follow_effects[i]] && constant > 0.0) {
            response->rate[AT_LAGGING + i] = (along->input[follow_sources[i]] - d.lagging[i]) / constant;
        }
    }
    response->output[GYRO_X] = d.s[GYRO_STATE_X];
    response->output[GYRO_Y] = d.s[GYRO_STATE_Y];
    response->output[GYRO_X_DOT] = d.s[GYRO_STATE_X_DOT];
    response->output[GYRO_Y_DOT] = d.s[GYRO_STATE_Y_DOT];
    response->output[GYRO_TEMPERATURE_STRUCTURE] = d.p[GYRO_TEMPERATURE_STRUCTURE];
    response->output[GYRO_TEMPERATURE_CIRCUIT] = d.p[GYRO_TEMPERATURE_CIRCUIT];
}

gyro_status gyro_set_continuous(gyro_instance *g, const double states[GYRO_N_CONTINUOUS])
{
    gyro_status status = GYRO_OK;
    for (int i = 0; i < GYRO_N_CONTINUOUS && status == GYRO_OK; i++) {
        if (!gyro_finite(states[i])) {
            status = gyro_refuse(g, "state %d of %d is %g; give a finite value", i, (int)GYRO_N_CONTINUOUS, states[i]);
        }
    }
    if (status == GYRO_OK) {
        memcpy(g->view.s, states, sizeof g->view.s);
        memcpy(g->memory.lagged, states + AT_LAGGED, sizeof g->memory.lagged);
        memcpy(g->view.lagging, states + AT_LAGGING, sizeof g->view.lagging);
        memcpy(g->view.remembered, states + AT_FLOWING, FLOWING);
    }
    return status;
}

void gyro_set_time(gyro_instance *g, double time)
{
    g->memory.clock.next_time = time;
    g->plan.cuts.time = time;
    g->view.t = time;
}

void gyro_resume_time(gyro_instance *g) { gyro_set_time(g, g->memory.clock.next_time); }

void gyro_put_out_continuous(gyro_instance *g)
{
    double lagged[2];
    gyro_view view = present(g, lagged);
    if (view.any_law) {
        apply_laws(&view, g->value);
    }
    gyro_put_out_of(g, &view);
}

int gyro_is_sample(uint32_t vr) { return vr == GYRO_V_X || vr == GYRO_V_Y; }

const char *gyro_jumping(const gyro_instance *g, uint32_t vr) { return jumping_effect(&g->view, (int)vr); }

/* The tick of the present time, and an event or sample nearby, which is meant. */
static gyro_instant present_instant(const gyro_instance *g)
{
    gyro_instant now = {gyro_nearest_tick(g, 0, gyro_ticks(g->memory.clock.next_time - g->memory.clock.start_time)), 0.0};
    const gyro_instant due[2] = {g->plan.cuts.next_event, gyro_next_own_cut(g)};
    for (int i = 0; i < 2; i++) {
        /* A time in doubles is within a tick of the instant that it was told. */
        if (gyro_before(now, due[i]) && due[i].tick - now.tick <= 1) {
            now = due[i];
        }
    }
    return now;
}

/* An event can be at `now` only where no sample but the next has been passed, so that their count fits the time. */
static gyro_status check_event(gyro_instance *g, gyro_instant now)
{
    const gyro_clock *clock = &g->memory.clock;
    const int64_t after = gyro_tick_of(g->plan.cuts.sample, clock->sample + 2);
    gyro_status status = GYRO_OK;
    if (now.tick >= after || gyro_before(now, clock->settled)) {
        status = gyro_refuse(g, "time %.15g s is beyond the sample that was due, or before the latest event; stop at the time of each event",
                             clock->next_time);
    }
    return status;
}

gyro_status gyro_enter_event(gyro_instance *g)
{
    gyro_clock *clock = &g->memory.clock;
    const gyro_status status = check_event(g, present_instant(g));
    if (status == GYRO_OK) {
        /* What has been set until now glided here. */
        for (int vr = 0; vr < GYRO_N_INPUTS; vr++) {
            g->view.p[vr] = g->value[vr];
            clock->held[vr] = g->value[vr];
        }
        take_made(&g->view, g->value);
        if (!g->plan.any_delay) {
            g->memory.acting[0] = g->value[GYRO_U_X];
            g->memory.acting[1] = g->value[GYRO_U_Y];
        }
        g->view.since = 0.0;
        if (g->view.any_law) {
            apply_laws(&g->view, g->value);
        }
        gyro_remember(g);
    }
    return status;
}

/* Brings counts and what is due to `now`, inputs being those before the event. */
static void settle(gyro_instance *g, gyro_instant now)
{
    gyro_clock *clock = &g->memory.clock;
    gyro_cuts *cuts = &g->plan.cuts;
    const int sampled = now.tick >= cuts->next_sample, happened = !gyro_before(now, cuts->next_event);
    gyro_swap_values(g, GYRO_N_VARIABLES);
    clock->settled = now;
    clock->now = now.tick;
    clock->rest = 0.0;
    clock->sample += sampled;
    clock->grid = gyro_beats_until(cuts->grid, now.tick);
    gyro_plan_cuts(g);
    gyro_set_time(g, clock->next_time);
    if (happened) {
        gyro_refresh(&g->view, g->value);
    }
    if (sampled) {
        gyro_sample_here(g);
    }
    while (!gyro_before(now, gyro_next_own_cut(g))) {
        gyro_bring_force(g);
    }
    gyro_swap_values(g, GYRO_N_VARIABLES);
}

gyro_status gyro_update(gyro_instance *g, int *jumped, double *next)
{
    double before[GYRO_N_CONTINUOUS], after[GYRO_N_CONTINUOUS];
    /* The time may be set in event mode too. */
    const gyro_instant now = present_instant(g);
    gyro_status status = check_event(g, now);
    if (status != GYRO_OK) {
        return status;
    }
    gyro_get_continuous(g, before);
    settle(g, now);
    status = gyro_take_values(g);
    gyro_get_continuous(g, after);
    gyro_put_out_continuous(g);
    *jumped = memcmp(before, after, sizeof before) != 0;
    gyro_instant first = {g->plan.cuts.next_sample, 0.0};
    const gyro_instant others[2] = {g->plan.cuts.next_event, gyro_next_own_cut(g)};
    for (int i = 0; i < 2; i++) {
        first = gyro_before(others[i], first) ? others[i] : first;
    }
    *next = gyro_time_of(g, first);
    return status;
}

/* The motion between two instants that cut it, and the sample. */

#include "plant.h"

#include <stdlib.h>
#include <string.h>

#include "collocation.h"
#include "generated/starts.h"
#include "hermite.h"
#include "level.h"
#include "noise.h"
#include "taylor.h"

/* No effect has acted. */
static const unsigned char NONE[GYRO_N_EFFECTS] = {0};

void gyro_refresh(gyro_view *view, const double value[GYRO_N_VARIABLES])
{
    if (view->any_law) {
        apply_laws(view, value);
    }
    hold_noise(view);
}

/* One more late force has room behind the last. */
static gyro_status make_way(gyro_instance *g)
{
    gyro_status status = GYRO_OK;
    const int64_t n = g->memory.n_late;
    if (g->late_first + n == g->late_room && g->late_first > n) {
        /* More than half of the room is free: moving costs less than has been gained since it was last filled. */
        memmove(g->late, g->late + g->late_first, (size_t)n * sizeof *g->late);
        g->late_first = 0;
    } else if (g->late_first + n == g->late_room) {
        const int64_t room = 2 * g->late_room + 8;
        gyro_late_force *late = realloc(g->late, (size_t)room * sizeof *late);
        if (late == NULL) {
            status = gyro_refuse(g, "no memory for %lld late forces: change the force less often or shorten actuator_delay", (long long)n + 1);
        } else {
            g->late = late;
            g->late_room = room;
        }
    }
    return status;
}

/* The force that is on its way from now on: a new one behind the last, or the last, which was sent at this very tick and never acts. NULL
   when memory is short. */
static gyro_late_force *send_force(gyro_instance *g)
{
    const int64_t n = g->memory.n_late, due = g->memory.clock.now + g->plan.delay.tick;
    gyro_late_force *sent = NULL;
    if (n > 0 && g->late[g->late_first + n - 1].due == due) {
        sent = &g->late[g->late_first + n - 1];
    } else if (make_way(g) == GYRO_OK) {
        sent = &g->late[g->late_first + n];
        sent->due = due;
        g->memory.n_late++;
    }
    return sent;
}

gyro_status gyro_take_inputs(gyro_instance *g)
{
    gyro_view *view = &g->view;
    gyro_memory *memory = &g->memory;
    const double *u = &g->value[GYRO_U_X], *held = &memory->clock.held[GYRO_U_X];
    const int first = memory->clock.now == 0;
    const int late = g->plan.any_delay && !first && (u[0] != held[0] || u[1] != held[1]);
    gyro_late_force *sent = late ? send_force(g) : NULL;
    const gyro_status status = late && sent == NULL ? GYRO_ERROR : GYRO_OK;
    if (status == GYRO_OK) {
        for (int vr = 0; vr < GYRO_N_INPUTS; vr++) {
            view->change[vr] = 0.0;
            if (first || g->value[vr] != memory->clock.held[vr]) {
                view->p[vr] = g->value[vr];
                view->change[vr] = first ? 0.0 : g->value[vr] - memory->clock.held[vr];
            }
        }
        take_made(view, g->value);
        if (first) {
            /* What holds in the first step has held before. */
            start_lagging(view, g->value);
            gyro_begin_memories(g, g->value, NONE);
        }
        if (late) {
            sent->u[0] = u[0];
            sent->u[1] = u[1];
        } else if (first || !g->plan.any_delay) {
            memory->acting[0] = u[0];
            memory->acting[1] = u[1];
        }
        if (first || memory->clock.tuned || laws_read_new(g->value, memory->clock.held)) {
            gyro_refresh(view, g->value);
        }
        if (view->any_impulse) {
            kick(view);
        }
    }
    return status;
}

gyro_instant gyro_next_own_cut(const gyro_instance *g)
{
    return g->memory.n_late > 0 ? (gyro_instant){g->late[g->late_first].due, g->plan.delay.part} : (gyro_instant){GYRO_NEVER, 0.0};
}

void gyro_bring_force(gyro_instance *g)
{
    gyro_memory *memory = &g->memory;
    const double *u = g->late[g->late_first].u;
    memory->acting[0] = u[0];
    memory->acting[1] = u[1];
    memory->n_late--;
    g->late_first = memory->n_late > 0 ? g->late_first + 1 : 0;
}

/* The force on the mass. */
static void find_force(gyro_instance *g)
{
    g->view.u[0] = g->memory.acting[0];
    g->view.u[1] = g->memory.acting[1];
    actuate(&g->view);
}

/* States and their rates at one end of a step. */
typedef struct {
    double s[GYRO_N_STATES];    /* SI */
    double rate[GYRO_N_STATES]; /* SI/s */
} gyro_end;

static gyro_end end_here(const gyro_view *view)
{
    gyro_end end;
    memcpy(end.s, view->s, sizeof end.s);
    state_rate(view, end.rate);
    return end;
}

static gyro_jet jet_of(const gyro_end *end, int place, int speed)
{
    return (gyro_jet){end->s[place], end->s[speed], end->rate[speed]};
}

/* What enters the lag at its nodes in a part of a step. */
typedef struct {
    double v[2][GYRO_LAG_NODES];  /* V */
    double tau[GYRO_LAG_NODES];   /* time constant, s */
} gyro_entering;

/* Of a node, the states and laws of the view being those of it. */
static void enter_lag(gyro_view *view, int node, gyro_entering *entering)
{
    pick_off(view);
    entering->tau[node] = lag_time_constant(view);
    entering->v[0][node] = view->v[0];
    entering->v[1][node] = view->v[1];
}

static void pass_part(gyro_instance *g, const gyro_entering *entering, double h)
{
    gyro_weigh_lag(&g->plan.lag, h, entering->tau);
    for (int axis = 0; axis < 2; axis++) {
        g->memory.lagged[axis] = gyro_lagged(&g->plan.lag, g->memory.lagged[axis], entering->v[axis]);
    }
}

/* The amplifier's lag from time t by h [s], which is `from` [s] into the step, the force being that of the view; states, laws and time of the
   view end at the end. */
static void move_lag(gyro_instance *g, const gyro_end *start, double t, double from, double h)
{
    gyro_view *view = &g->view;
    const gyro_end end = end_here(view);
    gyro_entering entering;
    for (int node = 0; node < GYRO_LAG_NODES; node++) {
        const double c = gyro_lag_nodes[node];
        if (node == 0) {
            memcpy(view->s, start->s, sizeof view->s);
        } else if (node == GYRO_LAG_NODES - 1) {
            memcpy(view->s, end.s, sizeof view->s);
        } else {
            for (int i = 0; i < GYRO_N_STATES; i++) {
                view->s[i] = cubic(start->s[i], start->rate[i], end.s[i], end.rate[i], h, c);
            }
            view->s[GYRO_STATE_X] = quintic(jet_of(start, GYRO_STATE_X, GYRO_STATE_X_DOT), jet_of(&end, GYRO_STATE_X, GYRO_STATE_X_DOT), h, c);
            view->s[GYRO_STATE_Y] = quintic(jet_of(start, GYRO_STATE_Y, GYRO_STATE_Y_DOT), jet_of(&end, GYRO_STATE_Y, GYRO_STATE_Y_DOT), h, c);
        }
        view->t = t + c * h;
        view->since = from + c * h;
        if (view->moving) {
            apply_laws(view, g->value);
        }
        enter_lag(view, node, &entering);
    }
    pass_part(g, &entering, h);
}

/* The voltage and its rate behind the lag, by the lag's own equation: tau v' = v_in - v. */
static void pass_lag(gyro_instance *g, double tau)
{
    gyro_view *view = &g->view;
    for (int axis = 0; axis < 2; axis++) {
        if (tau > 0.0) {
            view->v_rate[axis] = (view->v[axis] - g->memory.lagged[axis]) / tau;
        }
        view->v[axis] = g->memory.lagged[axis];
    }
}

void gyro_draw(gyro_instance *g, int effect)
{
    const uint32_t seed = (uint32_t)g->value[GYRO_SEED];
    const uint64_t sample = (uint64_t)g->memory.clock.sample;
    double *drawn = g->view.drawn[effect];
    if (pink_places[effect] < 0) {
        gyro_normal_pair(seed, streams[effect], sample, 0u, drawn);
    } else {
        gyro_pink_memory *pink = &g->memory.pink[pink_places[effect]];
        if (!pink->started) {
            gyro_pink_start(&g->plan.pink, seed, streams[effect], pink);
        }
        gyro_pink_next(&g->plan.pink, seed, streams[effect], sample, pink, drawn);
    }
}

static void draw_noise(gyro_instance *g)
{
    for (int effect = 0; g->plan.any_draw && effect < GYRO_N_EFFECTS; effect++) {
        if (streams[effect] != 0u && g->view.active[effect]) {
            gyro_draw(g, effect);
        }
    }
}

/* What effects remember changes with the numbers drawn, and the laws with it. */
static void renew(gyro_instance *g)
{
    gyro_view *view = &g->view;
    view->since = g->value[GYRO_SAMPLE_PERIOD];
    renew_memories(view);
    view->since = 0.0;
    apply_laws(view, g->value);
}

/* The sample at the present time, the force being the one that has acted until now. */
static void take_sample(gyro_instance *g)
{
    gyro_view *view = &g->view;
    draw_noise(g);
    if (view->any_renewed && g->memory.clock.sample > 0) {
        renew(g);
    }
    const double tau = g->plan.any_lag ? lag_time_constant(view) : 0.0;
    if (view->any_rate && !(tau > 0.0)) {
        pick_off_moving(view);
    } else if (view->any_rate || !g->plan.any_lag) {
        /* Behind a lag the rate follows from the voltages on both sides. */
        pick_off(view);
    }
    if (g->plan.any_lag) {
        pass_lag(g, tau);
    }
    if (view->any_rate) {
        amplify_moving(view);
    } else {
        amplify(view);
    }
    convert(view);
    g->memory.sample[0] = view->v[0];
    g->memory.sample[1] = view->v[1];
    if (!g->memory.hold) {
        gyro_latch(g);
    }
}

void gyro_hold_samples(gyro_instance *g, int hold) { g->memory.hold = hold; }

void gyro_latch(gyro_instance *g)
{
    g->value[GYRO_V_X] = g->memory.sample[0];
    g->value[GYRO_V_Y] = g->memory.sample[1];
}

void gyro_start_lag(gyro_instance *g)
{
    find_force(g);
    pick_off(&g->view);
    g->memory.lagged[0] = g->view.v[0];
    g->memory.lagged[1] = g->view.v[1];
}

void gyro_put_out_of(gyro_instance *g, const gyro_view *view)
{
    g->value[GYRO_X] = view->s[GYRO_STATE_X];
    g->value[GYRO_Y] = view->s[GYRO_STATE_Y];
    g->value[GYRO_X_DOT] = view->s[GYRO_STATE_X_DOT];
    g->value[GYRO_Y_DOT] = view->s[GYRO_STATE_Y_DOT];
    g->value[GYRO_TEMPERATURE_STRUCTURE] = view->p[GYRO_TEMPERATURE_STRUCTURE];
    g->value[GYRO_TEMPERATURE_CIRCUIT] = view->p[GYRO_TEMPERATURE_CIRCUIT];
}

void gyro_put_out(gyro_instance *g) { gyro_put_out_of(g, &g->view); }

void gyro_sample_here(gyro_instance *g)
{
    gyro_view *view = &g->view;
    if (view->any_law) {
        apply_laws(view, g->value);
    }
    find_force(g);
    if (g->plan.any_lag && !(lag_time_constant(view) > 0.0)) {
        gyro_start_lag(g);
    }
    take_sample(g);
    hold_noise(view);
}

void gyro_first_sample(gyro_instance *g)
{
    gyro_view *view = &g->view;
    start_lagging(view, g->value);
    gyro_begin_memories(g, g->value, NONE);
    view->s[GYRO_STATE_X] = g->value[GYRO_X_START];
    view->s[GYRO_STATE_X_DOT] = g->value[GYRO_X_DOT_START];
    view->s[GYRO_STATE_Y] = g->value[GYRO_Y_START];
    view->s[GYRO_STATE_Y_DOT] = g->value[GYRO_Y_DOT_START];
    start_states(view, g->value);
    g->memory.acting[0] = g->value[GYRO_U_X];
    g->memory.acting[1] = g->value[GYRO_U_Y];
    if (view->any_law) {
        apply_laws(view, g->value);
    }
    gyro_start_lag(g);
    take_sample(g);
    gyro_put_out(g);
}

void gyro_plan_series(gyro_instance *g)
{
    gyro_followers *all = &g->plan.followers;
    plan_series(&g->plan.series, &g->view);
    find_followers(all, &g->plan.series, &g->view);
    /* The lag asks for the motion between the ends of a step, which values leave open. */
    all->holds = all->holds && !g->plan.any_lag;
    if (all->holds && g->plan.table == NULL) {
        g->plan.table = malloc(sizeof *g->plan.table);
        if (g->plan.table != NULL) {
            gyro_tabulate_bouc_wen(g->plan.table, all->n);
        }
    } else if (all->holds && g->plan.table->n != all->n) {
        gyro_tabulate_bouc_wen(g->plan.table, all->n);
    }
    /* Without the memory for it series do. */
    all->holds = all->holds && g->plan.table != NULL;
}

/* The lag over the part of a step h [s] from time t that the latest series has gone, from `begin` of the step on; states and laws of the view
   end at the end. `start` shape (GYRO_N_STATES): the states at `begin`. */
static void move_lag_along(gyro_instance *g, const gyro_course *course, const gyro_passage *at, double t, double h, int pairs, double begin,
                           const double start[GYRO_N_STATES])
{
    gyro_view *view = &g->view;
    gyro_entering entering;
    double end[GYRO_N_STATES];
    memcpy(end, view->s, sizeof end);
    for (int node = 0; node < GYRO_LAG_NODES; node++) {
        const double c = gyro_lag_nodes[node], part = begin + c * (at->done - begin);
        if (node == 0) {
            memcpy(view->s, start, sizeof view->s);
        } else if (node == GYRO_LAG_NODES - 1) {
            memcpy(view->s, end, sizeof view->s);
        } else {
            set_states(&at->series, at->power, c * at->reach, pairs, view);
        }
        view->t = t + part * h;
        view->since = part * h;
        if (view->moving && course->smooth) {
            set_changed(view, course, part);
        } else if (view->moving) {
            apply_laws(view, g->value);
        }
        enter_lag(view, node, &entering);
    }
    pass_part(g, &entering, h * at->done - h * begin);
}

/* The states of the view over h [s] from time t by series, and the voltage behind the lag where `lags`. */
static void move_by_series(gyro_instance *g, const gyro_course *course, double t, double h, int lags)
{
    gyro_view *view = &g->view;
    const int pairs = view->any_state ? GYRO_STATE_PAIRS : GYRO_MOTION_PAIRS;
    gyro_passage at;
    begin_passage(&at, &g->plan.series, course);
    while (at.done < 1.0) {
        const double begin = at.done;
        double before[GYRO_N_STATES];
        if (lags) {
            memcpy(before, view->s, sizeof before);
        }
        advance_next(view, g->value, course, t, h, pairs, &at);
        if (lags && at.power > 0) {
            move_lag_along(g, course, &at, t, h, pairs, begin, before);
        } else if (lags) {
            double after[GYRO_N_STATES];
            memcpy(after, view->s, sizeof after);
            memcpy(view->s, before, sizeof before);
            const gyro_end start = end_here(view);
            memcpy(view->s, after, sizeof after);
            move_lag(g, &start, t + h * begin, h * begin, h * at.done - h * begin);
        }
        if (lags && view->moving && at.done < 1.0 && course->smooth) {
            set_changed(view, course, 0.5);
        } else if (lags && view->moving && at.done < 1.0) {
            apply_laws_at(view, g->value, t, h, 0.5);
        }
    }
}

/* The table of the motion over a step h [s] where it is steady; NULL: there is none. */
static const gyro_propagator *steady_table(const gyro_instance *g, double h)
{
    const gyro_propagator *found = NULL;
    for (int i = 0; i < GYRO_LENGTHS && g->view.steady; i++) {
        found = gyro_holds(&g->plan.propagator[i], &g->view, h) ? &g->plan.propagator[i] : found;
    }
    return found;
}

/* The same where forces with states act, or those that bend it in places alone. */
static const gyro_coupled *coupled_table(const gyro_instance *g, double h)
{
    const gyro_coupled *found = NULL;
    for (int i = 0; i < GYRO_LENGTHS && (g->view.even || g->plan.between); i++) {
        found = gyro_coupled_holds(&g->plan.coupled[i], &g->view, h) ? &g->plan.coupled[i] : found;
    }
    return found;
}

/* Moves the states of the view over h [s] where there is a table for that; gives whether it has. */
static int move_by_table(gyro_instance *g, double h)
{
    const gyro_propagator *steady = steady_table(g, h);
    const gyro_coupled *coupled = steady ? NULL : coupled_table(g, h);
    int moved = steady || coupled;
    if (steady) {
        gyro_apply(steady, &g->view);
    } else if (coupled && g->plan.between) {
        moved = move_between(coupled, &g->view);
    } else if (coupled) {
        gyro_apply_coupled(coupled, &g->view);
    }
    return moved;
}

/* The same while the motion is linear, or by stages. */
static void move_by_halves(gyro_instance *g, double t, double h, int lags)
{
    gyro_view *view = &g->view;
    const gyro_propagator *table = steady_table(g, h);
    for (gyro_progress at = {0, GYRO_WHOLE}; at.done < GYRO_WHOLE;) {
        const double begin = h * at.done / GYRO_WHOLE;
        gyro_end start;
        if (lags) {
            start = end_here(view);
        }
        if (table) {
            gyro_apply(table, view);
            at.done = GYRO_WHOLE;
        } else if (!view->any_curved && !view->moving && at.done == 0 && propagate_linear(view, h)) {
            at.done = GYRO_WHOLE;
        } else {
            integrate_next(view, g->value, t, h, &at);
        }
        if (lags) {
            move_lag(g, &start, t + begin, begin, h * at.done / GYRO_WHOLE - begin);
        }
    }
}

/* The states of the view over h [s] from `settled` to time `end`, and the voltage behind the lag where `lags`; gives 1 where it leaves the laws of
   the end. */
static int move_by(gyro_instance *g, double end, double h, int lags)
{
    gyro_view *view = &g->view;
    const double t = gyro_time_of(g, g->memory.clock.settled);
    gyro_course course;
    const int by_values = g->plan.followers.holds && !view->moving && move_by_values(view, &g->plan.followers, g->plan.table, h);
    const int curves = view->any_curved || view->moving;
    const int by_series = !by_values && curves && g->plan.series.holds && find_course(view, g->value, t, end, h, &course);
    if (by_values) {
        /* It is there. */
    } else if (by_series) {
        move_by_series(g, &course, t, h, lags);
    } else {
        move_by_halves(g, t, h, lags);
    }
    if (by_series && view->moving) {
        bring_laws(view, &course.end);
    }
    return by_series;
}

/* The view from `settled` to `to`, with the laws there, and the voltage behind the lag where `lags`. */
static void move_states(gyro_instance *g, gyro_instant to, int lags)
{
    gyro_view *view = &g->view;
    /* From the count, not by addition: rounding would add up, and a restored instance would differ in the last bit. */
    const double end = gyro_time_of(g, to), h = gyro_between(g->memory.clock.settled, to);
    int laws_known = 0;
    view->moving = view->any_law && laws_move(view, g->value);
    if (lags || !move_by_table(g, h)) {
        laws_known = move_by(g, end, h, lags);
    }
    view->t = end;
    view->since = h;
    if (view->moving && !laws_known) {
        apply_laws(view, g->value);
    }
}

/* States, what lags, and the laws from `settled` to `to`, the force being that which acts. */
static void move_view(gyro_instance *g, gyro_instant to)
{
    gyro_view *view = &g->view;
    find_force(g);
    move_states(g, to, g->plan.any_lag);
    view->since = 0.0;
}

static void keep_memories(gyro_view *view)
{
    if (view->any_memory) {
        memcpy(view->remembered, view->remembered_now, sizeof view->remembered);
    }
}

void gyro_remember(gyro_instance *g)
{
    find_force(g);
    keep_memories(&g->view);
}

void gyro_peek(gyro_instance *g, gyro_view *view, double lagged[2])
{
    const gyro_view kept = g->view;
    const double kept_lagged[2] = {g->memory.lagged[0], g->memory.lagged[1]};
    const gyro_instant now = {g->memory.clock.now, 0.0};
    if (gyro_before(g->memory.clock.settled, now)) {
        gyro_swap_values(g, GYRO_N_VARIABLES);
        move_view(g, now);
        gyro_swap_values(g, GYRO_N_VARIABLES);
        if (g->view.moving) {
            memcpy(g->view.lagging, g->view.lagging_now, sizeof g->view.lagging);
        }
        keep_memories(&g->view);
    }
    *view = g->view;
    memcpy(lagged, g->memory.lagged, sizeof g->memory.lagged);
    g->view = kept;
    memcpy(g->memory.lagged, kept_lagged, sizeof kept_lagged);
}

void gyro_move(gyro_instance *g, gyro_instant to)
{
    gyro_view *view = &g->view;
    move_view(g, to);
    const int at = gyro_settle(g, to);
    if (view->moving) {
        memcpy(view->lagging, view->lagging_now, sizeof view->lagging);
    }
    keep_memories(view);
    if (at & GYRO_AT_EVENT) {
        gyro_refresh(view, g->value);
    } else if (view->moving) {
        /* The laws are those that a restored instance finds from here on: over no time, what lags or is remembered stays to the last bit, by the
           contract of effects (gyro_model/contract.py). */
        hold_noise(view);
    }
    if (at & GYRO_AT_SAMPLE) {
        take_sample(g);
        hold_noise(view);
    }
    if (!gyro_before(to, gyro_next_own_cut(g))) {
        gyro_bring_force(g);
    }
}

void gyro_look_ahead(gyro_instance *g, gyro_instant to)
{
    const gyro_view kept = g->view;
    find_force(g);
    move_states(g, to, 0);
    gyro_put_out(g);
    if (gyro_infinite_state(g) == NULL) {
        g->view = kept;
    }
}

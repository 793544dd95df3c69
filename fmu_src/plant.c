#include "plant.h"

#include <string.h>

#include "integrator.h"
#include "noise.h"

/* Inputs are held: the view takes them over once a call. */
static void take_inputs(gyro_instance *g)
{
    gyro_view *view = &g->view;
    for (int vr = 0; vr < GYRO_N_INPUTS; vr++) {
        view->p[vr] = g->value[vr];
    }
    for (int vr = 0; view->any_impulse && vr < GYRO_N_INPUTS; vr++) {
        view->change[vr] = g->memory.tick > 0 ? g->value[vr] - g->memory.held[vr] : 0.0;
        g->memory.held[vr] = g->value[vr];
    }
    take_made(view, g->value);
    if (g->memory.tick == 0) {
        /* What holds in the first step has held before. */
        start_lagging(view, g->value);
    }
}

/* The commanded force of `age` internal steps ago [N]; before the start it is the first one. */
static const double *past_force(const gyro_instance *g, int64_t age)
{
    const int64_t tick = g->memory.tick - age;
    return g->delay_line[(size_t)(tick > 0 ? tick : 0) % g->delay_length];
}

/* Keeps the commanded force of the coming internal step, where a delay needs it later. */
static void keep_force(gyro_instance *g)
{
    if (g->plan.any_delay) {
        double *now = g->delay_line[(size_t)g->memory.tick % g->delay_length];
        now[0] = g->value[GYRO_U_X];
        now[1] = g->value[GYRO_U_Y];
    }
}

/* The commanded force that acts from the fraction `done` of the internal step on [N]: the delay's own fraction is where it changes. */
static const double *acting_force(const gyro_instance *g, double done)
{
    return past_force(g, g->plan.delay_ticks + (done < g->plan.delay_fraction ? 1 : 0));
}

/* The force on the mass from the fraction `done` of the internal step on. */
static void find_force(gyro_instance *g, double done)
{
    gyro_view *view = &g->view;
    const double *command = g->plan.any_delay ? acting_force(g, done) : &g->value[GYRO_U_X];
    view->u[0] = command[0];
    view->u[1] = command[1];
    actuate(view);
}

/* Where in the internal step the delayed force changes next, after the fraction `done`; 1 where it does not. A force that stays is no
   reason to cut, so that bits do not depend on a delay that shows nothing. */
static double next_force(const gyro_instance *g, double done)
{
    double next = 1.0;
    if (g->plan.any_delay && done < g->plan.delay_fraction) {
        const double *before = acting_force(g, done), *after = acting_force(g, g->plan.delay_fraction);
        next = before[0] != after[0] || before[1] != after[1] ? g->plan.delay_fraction : 1.0;
    }
    return next;
}

/* Everything that holds between two events: laws, then the noise force, which depends on them. */
static void refresh(gyro_view *view, const double *value)
{
    if (view->any_law) {
        apply_laws(view, value);
    }
    hold_noise(view);
}

/* The time of a step in time constants, z = integral of dt/tau, and what part of it has passed in the middle of the step. */
typedef struct {
    double z;
    double middle;
} lag_time;

/* From tau [s] at the start, middle and end of a step h [s]: 1/tau is taken as quadratic in time. The last counts alone where it stays, or
   where there was no lag before. */
static lag_time in_time_constants(const double tau[3], double h)
{
    lag_time time = {h / tau[2], 0.5};
    if (tau[0] != tau[2] && tau[0] > 0.0 && tau[1] > 0.0) {
        time.z = h / 6.0 * (1.0 / tau[0] + 4.0 / tau[1] + 1.0 / tau[2]);
        time.middle = h / 24.0 * (5.0 / tau[0] + 8.0 / tau[1] - 1.0 / tau[2]) / time.z;
    }
    return time;
}

/* First-order lag over a step, exact for an input v = start, middle, end that is quadratic in the time z counted in time
   constants, m being the part of z in the middle of the step. phi_1 = (1 - e^-z)/z and phi_2 = (1 - phi_1)/z; the series for small z avoid
   the cancellation. */
static double lag(double before, const double v[3], lag_time time)
{
    const double z = time.z, m = time.middle, start = v[0];
    const double curvature = ((v[2] - start) * m - (v[1] - start)) / (m - m * m);
    const double slope = v[2] - start - curvature;
    const double gone = -expm1(-z);
    double phi_1, phi_2;
    if (z < 0.5) {
        /* Terms fall faster than z^k/k!: 0.5^13/15! < 1e-16. */
        double term = 1.0;
        phi_1 = 0.0;
        phi_2 = 0.0;
        for (int k = 1; k <= 13; k++) {
            phi_1 += term / k;
            phi_2 += term / (k * (k + 1));
            term *= -z / k;
        }
    } else {
        phi_1 = gone / z;
        phi_2 = (1.0 - phi_1) / z;
    }
    return (1.0 - gone) * before + gone * start + (1.0 - phi_1) * slope + (1.0 - 2.0 * phi_2) * curvature;
}

/* The pickoff's voltage at time `t` [s] with the displacement at `q` [m], into the view; the laws stay at that time. */
static void voltage_at(gyro_instance *g, double t, const double q[2])
{
    gyro_view *view = &g->view;
    const double x = view->s[GYRO_STATE_X], y = view->s[GYRO_STATE_Y];
    view->s[GYRO_STATE_X] = q[0];
    view->s[GYRO_STATE_Y] = q[1];
    view->t = t;
    if (view->any_law) {
        apply_laws(view, g->value);
    }
    pick_off(view);
    view->s[GYRO_STATE_X] = x;
    view->s[GYRO_STATE_Y] = y;
}

/* The amplifier's lag from time t by h [s], the force being that of the view; `before` shape (GYRO_N_STATES), the states at its start. */
static void move_lag(gyro_instance *g, const double *before, double t, double h)
{
    gyro_view *view = &g->view;
    const double *after = view->s;
    const double q_start[2] = {before[GYRO_STATE_X], before[GYRO_STATE_Y]};
    /* Cubic Hermite interpolation: off by h^4 q''''/384. */
    const double q_middle[2] = {
        0.5 * (before[GYRO_STATE_X] + after[GYRO_STATE_X]) + 0.125 * h * (before[GYRO_STATE_X_DOT] - after[GYRO_STATE_X_DOT]),
        0.5 * (before[GYRO_STATE_Y] + after[GYRO_STATE_Y]) + 0.125 * h * (before[GYRO_STATE_Y_DOT] - after[GYRO_STATE_Y_DOT])};
    const double q_end[2] = {after[GYRO_STATE_X], after[GYRO_STATE_Y]};
    const double *const q[3] = {q_start, q_middle, q_end};
    double v[2][3], tau[3];
    for (int i = 0; i < 3; i++) {
        voltage_at(g, t + 0.5 * i * h, q[i]);
        tau[i] = lag_time_constant(view);
        v[0][i] = view->v[0];
        v[1][i] = view->v[1];
    }
    for (int axis = 0; axis < 2; axis++) {
        g->memory.lagged[axis] = tau[2] > 0.0 ? lag(g->memory.lagged[axis], v[axis], in_time_constants(tau, h)) : v[axis][2];
    }
}

/* From time t by h [s], in which nothing jumps. */
static void move_smoothly(gyro_instance *g, double t, double h)
{
    gyro_view *view = &g->view;
    double before[GYRO_N_STATES];
    for (int k = 0; g->plan.any_lag && k < GYRO_N_STATES; k++) {
        before[k] = view->s[k];
    }
    integrate(view, g->value, t, h);
    if (g->plan.any_lag) {
        move_lag(g, before, t, h);
    }
}

/* One internal step of states and lag, cut where an event falls or the delayed force changes. The lag is cut too: its input jumps with
   the force that feeds through. */
static void move(gyro_instance *g)
{
    const double h = g->plan.step;
    const double start = g->memory.start_time + (double)g->memory.tick * h;
    double done = 0.0;
    while (done < 1.0) {
        const double force = next_force(g, done);
        const double until = g->plan.any_event ? smaller(force, gyro_next_event(g, done)) : force;
        if (g->plan.any_event) {
            gyro_pass_events(g, g->memory.tick, done);
            refresh(&g->view, g->value);
        }
        find_force(g, done);
        move_smoothly(g, start + done * h, (until - done) * h);
        done = until;
    }
}

/* The voltage and its rate behind the lag, by the lag's own equation: tau v' = v_in - v. */
static void pass_lag(gyro_instance *g)
{
    gyro_view *view = &g->view;
    const double tau = lag_time_constant(view);
    for (int axis = 0; axis < 2; axis++) {
        if (tau > 0.0) {
            view->v_rate[axis] = (view->v[axis] - g->memory.lagged[axis]) / tau;
        }
        view->v[axis] = g->memory.lagged[axis];
    }
}

/* Draws the numbers of one effect for the latest sample. */
static void draw(gyro_instance *g, int effect)
{
    const uint32_t seed = (uint32_t)g->value[GYRO_SEED];
    const uint64_t sample = (uint64_t)g->memory.sample;
    double *drawn = g->view.drawn[effect];
    if (pink_places[effect] < 0) {
        gyro_normal_pair(seed, streams[effect], sample, 0u, drawn);
    } else {
        gyro_pink_memory *pink = &g->memory.pink[pink_places[effect]];
        if (sample == 0) {
            gyro_pink_start(&g->plan.pink, seed, streams[effect], pink);
        }
        gyro_pink_next(&g->plan.pink, seed, streams[effect], sample, pink, drawn);
    }
}

static void draw_noise(gyro_instance *g)
{
    for (int effect = 0; g->plan.any_draw && effect < GYRO_N_EFFECTS; effect++) {
        if (streams[effect] != 0u && g->view.active[effect]) {
            draw(g, effect);
        }
    }
}

/* The sample at the present time, the force being the one that has acted until now. */
static void take_sample(gyro_instance *g)
{
    gyro_view *view = &g->view;
    draw_noise(g);
    if (view->any_rate) {
        pick_off_moving(view);
    } else if (!g->plan.any_lag) {
        pick_off(view);
    }
    if (g->plan.any_lag) {
        pass_lag(g);
    }
    if (view->any_rate) {
        amplify_moving(view);
    } else {
        amplify(view);
    }
    convert(view);
    g->value[GYRO_V_X] = view->v[0];
    g->value[GYRO_V_Y] = view->v[1];
}

static void put_out(gyro_instance *g)
{
    const gyro_view *view = &g->view;
    g->value[GYRO_X] = view->s[GYRO_STATE_X];
    g->value[GYRO_Y] = view->s[GYRO_STATE_Y];
    g->value[GYRO_X_DOT] = view->s[GYRO_STATE_X_DOT];
    g->value[GYRO_Y_DOT] = view->s[GYRO_STATE_Y_DOT];
    g->value[GYRO_TEMPERATURE_STRUCTURE] = view->p[GYRO_TEMPERATURE_STRUCTURE];
    g->value[GYRO_TEMPERATURE_CIRCUIT] = view->p[GYRO_TEMPERATURE_CIRCUIT];
}

void gyro_first_sample(gyro_instance *g)
{
    gyro_view *view = &g->view;
    take_inputs(g);
    view->t = g->memory.start_time;
    view->step_start = view->t;
    view->s[GYRO_STATE_X] = g->value[GYRO_X_START];
    view->s[GYRO_STATE_X_DOT] = g->value[GYRO_X_DOT_START];
    view->s[GYRO_STATE_Y] = g->value[GYRO_Y_START];
    view->s[GYRO_STATE_Y_DOT] = g->value[GYRO_Y_DOT_START];
    g->memory.ticks_to_sample = g->plan.sample_ticks;
    if (view->any_law) {
        apply_laws(view, g->value);
    }
    view->u[0] = g->value[GYRO_U_X];
    view->u[1] = g->value[GYRO_U_Y];
    actuate(view);
    pick_off(view);
    g->memory.lagged[0] = view->v[0];
    g->memory.lagged[1] = view->v[1];
    take_sample(g);
    put_out(g);
}

void gyro_tick(gyro_instance *g, int64_t ticks)
{
    gyro_view *view = &g->view;
    take_inputs(g);
    refresh(view, g->value);
    if (view->any_impulse) {
        kick(view);
    }
    for (int64_t i = 0; i < ticks; i++) {
        keep_force(g);
        move(g);
        g->memory.tick++;
        g->memory.ticks_to_sample--;
        /* From the count, not by addition: rounding would add up, and a restored instance would differ in the last bit. */
        view->t = g->memory.start_time + (double)g->memory.tick * g->plan.step;
        if (view->any_law) {
            apply_laws(view, g->value);
            hold_noise(view);
            memcpy(view->lagging, view->lagging_now, sizeof view->lagging);
        }
        view->step_start = view->t;
        if (g->memory.ticks_to_sample == 0) {
            g->memory.ticks_to_sample = g->plan.sample_ticks;
            g->memory.sample++;
            take_sample(g);
            hold_noise(view);
        }
    }
    put_out(g);
}

/* The motion of the envelope form between two instants that cut it. */

#include "plant.h"

#include <string.h>

#include "straight.h"

static const double TWO_PI = 6.283185307179586;

/* m²; an amplitude of 1e-30 m is none, and its inverse square is still a number. */
static const double NO_MOTION = 1e-60;

static const pair NO_PAIR = {{{0.0, 0.0}, {0.0, 0.0}}};

/* No curved force: steepness [N/m] of each axis. */
static const double NO_FORCE[2] = {0.0, 0.0};

/* No effect has acted. */
static const unsigned char NONE[GYRO_N_EFFECTS] = {0};

/* The velocities jump by the impulses that a change of the held inputs gives. */
static void jolt(gyro_instance *g)
{
    gyro_view *view = &g->view;
    gyro_memory *memory = &g->memory;
    double jump[2][2];
    for (int quadrature = 0; quadrature < 2; quadrature++) {
        memset(view->s, 0, sizeof view->s);
        view->s[GYRO_STATE_X] = *part_of(&memory->q.part[0].e[0], quadrature);
        view->s[GYRO_STATE_Y] = *part_of(&memory->q.part[0].e[1], quadrature);
        kick(view);
        jump[0][quadrature] = view->s[GYRO_STATE_X_DOT];
        jump[1][quadrature] = view->s[GYRO_STATE_Y_DOT];
    }
    memory->q_dot = pair_plus(memory->q_dot, (pair){{{jump[0][0], jump[0][1]}, {jump[1][0], jump[1][1]}}});
}

/* Parameters at `part` of the step from `settled` to `to`. */
static void apply_laws_at(gyro_instance *g, gyro_instant to, double part)
{
    const double h = gyro_between(g->memory.clock.settled, to);
    g->view.since = part * h;
    g->view.t = part < 1.0 ? gyro_time_of(g, g->memory.clock.settled) + part * h : gyro_time_of(g, to);
    if (g->view.any_law) {
        apply_laws(&g->view, g->value);
    }
}

double gyro_carrier(const gyro_instance *g) { return TWO_PI * g->value[GYRO_CARRIER_FREQUENCY]; }

/* The phase factor e^(iψ) by which the cycle of an axis is turned before it is sampled: that of its own amplitude, so that its turning points
   lie on a sample. A stop that is met between two samples at one phase and on one at another would feed or drain energy. Forces that join the
   axes need one phase for both, that of the larger amplitude. */
static pair phases_of(const gyro_instance *g, const gyro_harmonics *q)
{
    const pair a = q->part[0];
    const int larger = square(a.e[1]) > square(a.e[0]);
    pair phase;
    for (int i = 0; i < 2; i++) {
        const number of = any_crossed_force(&g->view) ? a.e[larger] : a.e[i];
        const double size = square(of);
        phase.e[i] = size > NO_MOTION ? scaled(of, 1.0 / sqrt(size)) : number_of(1.0, 0.0);
    }
    return phase;
}

/* `s` with its axes turned by `phase`, harmonic by harmonic. */
static gyro_harmonics turned(const gyro_harmonics *s, pair phase)
{
    gyro_harmonics result = *s;
    for (int i = 0; i < 2; i++) {
        number factor = phase.e[i];
        for (int h = 1; h <= GYRO_HARMONICS; h++) {
            result.part[h - 1].e[i] = times(result.part[h - 1].e[i], factor);
            factor = times(factor, phase.e[i]);
        }
    }
    return result;
}

/* The curved forces [N] around the cycle. */
static gyro_cycle forces_around(gyro_view *view, const gyro_cycle *at, const gyro_cycle *speed, const gyro_cycle *drive)
{
    gyro_cycle force;
    for (int k = 0; k < GYRO_PHASES; k++) {
        view->s[GYRO_STATE_X] = at->at[k][0];
        view->s[GYRO_STATE_Y] = at->at[k][1];
        view->s[GYRO_STATE_X_DOT] = speed->at[k][0];
        view->s[GYRO_STATE_Y_DOT] = speed->at[k][1];
        view->u[0] = drive->at[k][0];
        view->u[1] = drive->at[k][1];
        force.at[k][0] = 0.0;
        force.at[k][1] = 0.0;
        curved_force(view, force.at[k]);
    }
    return force;
}

/* How steep the curved forces are on each axis: their change over a small displacement from the motion `at` where they are `force`, mean of the
   cycle's absolute values [N/m]. */
static void find_steepness(gyro_instance *g, gyro_cycle at, const gyro_cycle *speed, const gyro_cycle *drive, const gyro_cycle *force, double steepness[2])
{
    /* Of the amplitude: the part that the cycle's samples next to a turning point lie below it, 1 - cos(2π/32). */
    static const double NEAR = 0.02;
    double shift[2];
    for (int i = 0; i < 2; i++) {
        shift[i] = NEAR * sqrt(square(g->memory.q.part[0].e[i]));
        for (int k = 0; k < GYRO_PHASES; k++) {
            at.at[k][i] += shift[i];
        }
    }
    const gyro_cycle shifted = forces_around(&g->view, &at, speed, drive);
    for (int i = 0; i < 2; i++) {
        double sum = 0.0;
        for (int k = 0; k < GYRO_PHASES; k++) {
            const double change = fabs(shifted.at[k][i] - force->at[k][i]);
            /* A film ends at its gap, beyond which there is no force to compare. */
            sum += gyro_finite(change) ? change : 0.0;
        }
        steepness[i] = shift[i] > 0.0 ? sum / (GYRO_PHASES * shift[i]) : 0.0;
    }
}

/* The curved forces of the motion in memory under the force `u` of the actuators, by harmonics [N]. Finds how steep they are where that is
   below 0, unknown. */
static gyro_harmonics curved_forces(gyro_instance *g, const gyro_harmonics *u, double steepness[2])
{
    const gyro_harmonics *q = &g->memory.q;
    gyro_harmonics velocity = {{0.0, 0.0}, {g->memory.q_dot}};
    for (int h = 2; h <= GYRO_HARMONICS; h++) {
        for (int i = 0; i < 2; i++) {
            velocity.part[h - 1].e[i] = times(number_of(0.0, h * gyro_carrier(g)), q->part[h - 1].e[i]);
        }
    }
    const pair phase = phases_of(g, q), back = {{conjugate(phase.e[0]), conjugate(phase.e[1])}};
    const gyro_harmonics own_q = turned(q, back), own_velocity = turned(&velocity, back), own_u = turned(u, back);
    const gyro_cycle at = gyro_around(&own_q), speed = gyro_around(&own_velocity), drive = gyro_around(&own_u);
    const gyro_cycle force = forces_around(&g->view, &at, &speed, &drive);
    if (steepness[0] < 0.0) {
        find_steepness(g, at, &speed, &drive, &force, steepness);
    }
    const gyro_harmonics spectrum = gyro_spectrum(&force);
    return turned(&spectrum, phase);
}

/* Forces [N] by harmonics, and the mean and harmonics of the motion in memory brought to what they make of it. */
static gyro_harmonics follow_curves(gyro_instance *g, const gyro_harmonics *u, const gyro_motion *m, double steepness[2])
{
    gyro_memory *memory = &g->memory;
    const gyro_harmonics f = curved_forces(g, u, steepness);
    gyro_harmonics force = *u;
    for (int i = 0; i < 2; i++) {
        force.mean[i] += f.mean[i];
        for (int h = 2; h <= GYRO_HARMONICS; h++) {
            force.part[h - 1].e[i] = plus(force.part[h - 1].e[i], f.part[h - 1].e[i]);
        }
    }
    gyro_follow_force(g, m, &force, steepness, &memory->q);
    return f;
}

/* Mean and harmonics of the motion in memory, and what the curved forces make of the carrier's part. Where each depends on its own axis
   alone, its ratio to the displacement is a stiffness, so that a frequency that is pulled by the amplitude is followed exactly; else it is held
   as a force. Gives how steep they are [N/m]. */
static void take_curves(gyro_instance *g, const gyro_harmonics *u, const gyro_motion *m, double steepness[2])
{
    /* A force of its own axis is at most as large as its steepness makes it along the amplitude. */
    static const double OWN = 2.0;
    gyro_memory *memory = &g->memory;
    steepness[0] = -1.0;
    /* Twice: the harmonics in memory are turned as the amplitude was a step ago, which would feed or drain energy. */
    follow_curves(g, u, m, steepness);
    const gyro_harmonics f = follow_curves(g, u, m, steepness);
    for (int i = 0; i < 2; i++) {
        const number q = memory->q.part[0].e[i];
        const double most = OWN * steepness[i];
        const int held = !(square(q) > NO_MOTION) || (any_crossed_force(&g->view) && square(f.part[0].e[i]) > most * most * square(q));
        memory->bent_force.e[i] = held ? f.part[0].e[i] : number_of(0.0, 0.0);
        memory->bent_stiffness.e[i] = held ? number_of(0.0, 0.0) : scaled(over(f.part[0].e[i], q), -g->view.inverse_mass);
    }
}

/* Mean and harmonics of the motion where no force is curved. */
static void follow_actuators(gyro_instance *g, const gyro_harmonics *u, const gyro_motion *m)
{
    gyro_memory *memory = &g->memory;
    if (any_curved_actuator(&g->view) || m->mean[0] != 0.0 || m->mean[1] != 0.0) {
        gyro_follow_force(g, m, u, NO_FORCE, &memory->q);
    } else {
        memory->q.mean[0] = 0.0;
        memory->q.mean[1] = 0.0;
    }
}

/* B N B*, with N the density of the noise force: of each of its two quadratures, that is twice the force's own two-sided density. */
static matrix noise_density(gyro_instance *g)
{
    gyro_view *view = &g->view;
    const matrix b = g->memory.slow.input;
    matrix sum = diagonal(number_of(0.0, 0.0));
    for (const int *effect = drawn_forces; *effect < GYRO_N_EFFECTS; effect++) {
        for (int draw = 0; draw < 2 && view->active[*effect]; draw++) {
            view->drawn[*effect][draw] = 1.0;
            hold_noise(view);
            view->drawn[*effect][draw] = 0.0;
            const pair column = {{{view->held[0], 0.0}, {view->held[1], 0.0}}};
            const pair moved = apply(b, column);
            for (int i = 0; i < 2; i++) {
                for (int j = 0; j < 2; j++) {
                    sum.e[i][j] = plus(sum.e[i][j], times(moved.e[i], conjugate(moved.e[j])));
                }
            }
        }
    }
    return matrix_scaled(sum, 2.0 * g->value[GYRO_SAMPLE_PERIOD]);
}

/* What white forces add to the amplitudes in the step behind [m]. The covariance is worked out anew when its ingredients have moved by a
   thousandth, which is what it is then wrong by. */
static pair thermal_motion(gyro_instance *g)
{
    static const double SHARE = 1e-3;
    gyro_memory *memory = &g->memory;
    const matrix density = noise_density(g);
    const matrix density_change = matrix_plus(density, matrix_scaled(memory->noise, -1.0));
    const matrix rate_change = matrix_plus(memory->slow.rate, matrix_scaled(memory->noise_rate, -1.0));
    if (memory->slow.step != memory->noise_step || largest(density_change) > SHARE * largest(density) ||
        largest(rate_change) * memory->slow.step > SHARE) {
        memory->noise = density;
        memory->noise_rate = memory->slow.rate;
        memory->noise_step = memory->slow.step;
        memory->gathered = gyro_gathered(&memory->slow, density);
    }
    /* A step that begins inside its interval of the grid draws numbers of its own, told by where it begins. */
    const int64_t interval = memory->clock.grid;
    const uint32_t where = 2u * (uint32_t)(memory->clock.settled.tick - gyro_tick_of(g->plan.cuts.grid, interval));
    double along[2], across[2];
    gyro_draw(g, drawn_forces[0], interval, where, along);
    gyro_draw(g, drawn_forces[0], interval, where + 1u, across);
    return apply(memory->gathered, (pair){{{along[0], across[0]}, {along[1], across[1]}}});
}

/* The carrier's phase at `at` [cycles], of which whole ones count for nothing. */
static double phase_at(const gyro_instance *g, double frequency, gyro_instant at)
{
    const double cycles = g->memory.phase + frequency * gyro_between(g->memory.phase_at, at);
    return cycles - gyro_floor(cycles);
}

/* Displacement and velocity at `settled` under the motion and force that begin there. A pair of amplitudes says more than the two numbers of
   an axis that go on where forces or parameters jump, x = Re{q e^(iφ)} and x' = Re{v e^(iφ)}; of those that say the same, the one of the new
   motion has v = S q + B f. */
static pair joined(const gyro_instance *g, pair q, pair q_dot, pair force)
{
    const gyro_slow *slow = &g->memory.slow;
    const pair own = pair_plus(apply(slow->rate, q), apply(slow->input, force));
    const pair gap = {{minus(q_dot.e[0], own.e[0]), minus(q_dot.e[1], own.e[1])}};
    if (gap.e[0].re != 0.0 || gap.e[0].im != 0.0 || gap.e[1].re != 0.0 || gap.e[1].im != 0.0) {
        const number phase = turn(TWO_PI * phase_at(g, g->value[GYRO_CARRIER_FREQUENCY], g->memory.clock.settled));
        const double x = times(gap.e[0], phase).re, y = times(gap.e[1], phase).re;
        const matrix *s = &slow->rate;
        const double scale = -1.0 / (s->e[0][0].im * s->e[1][1].im - s->e[0][1].im * s->e[1][0].im);
        /* Beside the real parts, which stay, by as much as closes the gap: -Im S (dx, dy) = (x, y). */
        const double dx = scale * (s->e[1][1].im * x - s->e[0][1].im * y), dy = scale * (s->e[0][0].im * y - s->e[1][0].im * x);
        const number beside = times(number_of(0.0, 1.0), conjugate(phase));
        q = pair_plus(q, (pair){{scaled(beside, dx), scaled(beside, dy)}});
    }
    return q;
}

/* The motion `step` [s] long under the straight forces and what the curved ones make of the carrier's part; gives the force that it holds [N]. */
static pair take_motion(gyro_instance *g, const gyro_harmonics *u, const gyro_motion *m, double step)
{
    gyro_memory *memory = &g->memory;
    const matrix stiffness = {{{plus(m->stiffness.e[0][0], memory->bent_stiffness.e[0]), m->stiffness.e[0][1]},
                               {m->stiffness.e[1][0], plus(m->stiffness.e[1][1], memory->bent_stiffness.e[1])}}};
    gyro_find_slow(&memory->slow, stiffness, m->damping, gyro_carrier(g), g->view.inverse_mass, step);
    return pair_plus(u->part[0], memory->bent_force);
}

/* The amplitudes at the carrier a step later, from those `before`, by the motion in memory. */
static void advance(gyro_instance *g, pair before, pair force)
{
    gyro_memory *memory = &g->memory;
    memory->q.part[0] = pair_plus(apply(memory->slow.decay, before), apply(memory->slow.gain, force));
    memory->q_dot = pair_plus(apply(memory->slow.rate, memory->q.part[0]), apply(memory->slow.input, force));
}

/* The longest part of `step` [s] through which a force may be held that is as steep as this [N/m]: it detunes the motion by as much as turns
   the amplitude by TURN. */
static double held_part(const gyro_instance *g, const double steepness[2], double step)
{
    /* rad. The midpoint rule holds a mode that is turned by less than 1; its error in a part is TURN³/24 of what the force does. */
    static const double TURN = 0.1;
    const double steeper = steepness[0] > steepness[1] ? steepness[0] : steepness[1];
    const double detuned = steeper * g->view.inverse_mass / (2.0 * gyro_carrier(g));
    const double turning = detuned < gyro_carrier(g) ? detuned : gyro_carrier(g);
    return turning * step > TURN ? TURN / turning : step;
}

/* The amplitudes a step later, from those `before`, under curved forces: by the midpoint rule, forces of half a part ahead, in parts where a
   force that joins the axes is held through each. */
static void move_curved(gyro_instance *g, pair before, const gyro_harmonics *u, const gyro_motion *m, double step)
{
    double steepness[2], rest = step;
    while (rest > 0.0) {
        take_curves(g, u, m, steepness);
        double part = any_crossed_force(&g->view) ? held_part(g, steepness, rest) : rest;
        advance(g, before, take_motion(g, u, m, 0.5 * part));
        take_curves(g, u, m, steepness);
        advance(g, before, take_motion(g, u, m, part));
        before = g->memory.q.part[0];
        rest = part < rest ? rest - part : 0.0;
    }
}

/* The amplitudes from `settled` to `to`, in which nothing jumps. Laws are those of the middle, then of the end. */
static void move_amplitudes(gyro_instance *g, gyro_instant to)
{
    gyro_view *view = &g->view;
    gyro_memory *memory = &g->memory;
    const double step = gyro_between(memory->clock.settled, to);
    const int curved = any_curved_force(view);
    pair before = memory->q.part[0];
    gyro_harmonics u;
    apply_laws_at(g, to, 0.5);
    gyro_actuate(g, &u);
    const gyro_motion m = gyro_straight_motion(g);
    if (!curved) {
        memory->bent_stiffness = NO_PAIR;
        memory->bent_force = NO_PAIR;
        follow_actuators(g, &u, &m);
    } else if (memory->jumped) {
        double steepness[2];
        take_curves(g, &u, &m, steepness);
    }
    memory->jumped = 0;
    const pair force = take_motion(g, &u, &m, step);
    if (memory->clock.settled.tick > 0) {
        /* What begins at the start is an amplitude of the motion there. What the curved forces make of it changes with the amplitude, not at
           an instant: it is that of the step before, or where they jumped, that of now. */
        before = joined(g, before, memory->q_dot, force);
    }
    if (curved) {
        move_curved(g, before, &u, &m, step);
    } else {
        advance(g, before, force);
    }
    if (any_drawn_force(view)) {
        const pair moved = thermal_motion(g);
        memory->q.part[0] = pair_plus(memory->q.part[0], moved);
        memory->q_dot = pair_plus(memory->q_dot, apply(memory->slow.rate, moved));
    }
    apply_laws_at(g, to, 1.0);
}

/* What effects remember at the end of an internal step changes with the numbers drawn there. */
static void renew(gyro_instance *g)
{
    gyro_view *view = &g->view;
    for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
        if (streams[effect] != 0u && view->active[effect]) {
            gyro_draw(g, effect, g->memory.clock.grid, 0u, view->drawn[effect]);
        }
    }
    view->since = g->plan.step;
    renew_memories(view);
    /* The noise of forces and samples draws for itself, and reckons with zero where it does not. */
    memset(view->drawn, 0, sizeof view->drawn);
}

void gyro_move(gyro_instance *g, gyro_instant to)
{
    move_amplitudes(g, to);
    memcpy(g->view.lagging, g->view.lagging_now, sizeof g->view.lagging);
    if (g->view.any_memory) {
        memcpy(g->view.remembered, g->view.remembered_now, sizeof g->view.remembered);
    }
    if ((gyro_settle(g, to) & GYRO_AT_SAMPLE) && g->view.any_renewed) {
        renew(g);
    }
    apply_laws_at(g, to, 0.0);
}

gyro_instant gyro_next_own_cut(const gyro_instance *g)
{
    (void)g;
    return (gyro_instant){GYRO_NEVER, 0.0};
}

gyro_status gyro_take_inputs(gyro_instance *g)
{
    gyro_view *view = &g->view;
    const gyro_clock *clock = &g->memory.clock;
    const double carrier = clock->held[GYRO_CARRIER_FREQUENCY];
    if (g->value[GYRO_CARRIER_FREQUENCY] != carrier) {
        g->memory.phase = phase_at(g, carrier, clock->settled);
        g->memory.phase_at = clock->settled;
    }
    for (int vr = 0; vr < GYRO_N_INPUTS; vr++) {
        view->p[vr] = g->value[vr];
        view->change[vr] = clock->now > 0 ? g->value[vr] - clock->held[vr] : 0.0;
        g->memory.jumped |= view->change[vr] != 0.0 && vr > GYRO_OMEGA_Z;
    }
    take_made(view, g->value);
    if (clock->now == 0) {
        /* What holds in the first step has held before. */
        start_lagging(view, g->value);
        gyro_begin_memories(g, g->value, NONE);
    }
    apply_laws_at(g, clock->settled, 0.0);
    if (view->any_impulse) {
        jolt(g);
    }
    return GYRO_OK;
}

/* With the noise of the point of the grid at `at`, or of the next one. */
static void put_out(gyro_instance *g, gyro_instant at)
{
    const gyro_harmonics *q = &g->memory.q;
    const int64_t point = g->memory.clock.grid;
    const gyro_instant latest = {gyro_tick_of(g->plan.cuts.grid, point), 0.0};
    gyro_sense(g, gyro_before(latest, at) ? point + 1 : point);
    g->value[GYRO_X_I] = q->part[0].e[0].re;
    g->value[GYRO_X_Q] = q->part[0].e[0].im;
    g->value[GYRO_Y_I] = q->part[0].e[1].re;
    g->value[GYRO_Y_Q] = q->part[0].e[1].im;
    g->value[GYRO_X_MEAN] = q->mean[0];
    g->value[GYRO_Y_MEAN] = q->mean[1];
    g->value[GYRO_TEMPERATURE_STRUCTURE] = g->view.p[GYRO_TEMPERATURE_STRUCTURE];
    g->value[GYRO_TEMPERATURE_CIRCUIT] = g->view.p[GYRO_TEMPERATURE_CIRCUIT];
}

void gyro_put_out(gyro_instance *g) { put_out(g, g->memory.clock.settled); }

void gyro_look_ahead(gyro_instance *g, gyro_instant to)
{
    const gyro_view view = g->view;
    const gyro_memory memory = g->memory;
    move_amplitudes(g, to);
    put_out(g, to);
    if (gyro_infinite_state(g) == NULL) {
        g->view = view;
        g->memory = memory;
    }
}

void gyro_hold_samples(gyro_instance *g, int hold) { (void)g, (void)hold; }

void gyro_latch(gyro_instance *g) { (void)g; }

void gyro_first_sample(gyro_instance *g)
{
    gyro_memory *memory = &g->memory;
    memory->q.part[0] = (pair){{{g->value[GYRO_X_START_I], g->value[GYRO_X_START_Q]}, {g->value[GYRO_Y_START_I], g->value[GYRO_Y_START_Q]}}};
    for (int axis = 0; axis < 2; axis++) {
        memory->q_dot.e[axis] = times(number_of(0.0, gyro_carrier(g)), memory->q.part[0].e[axis]);
    }
    start_lagging(&g->view, g->value);
    gyro_begin_memories(g, g->value, NONE);
    apply_laws_at(g, g->memory.clock.settled, 0.0);
    gyro_put_out(g);
}

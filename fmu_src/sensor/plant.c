/* The sensor between two instants that cut time: points of the grid of its noise, samples, changes of inputs. What enters the filter is held
   from each to the next; the temperature that it follows from is that at the begin. */

#include "plant.h"

#include <string.h>

#include "gyro_math.h"

/* NaN becomes `low`. */
static double limited(double value, double low, double high) { return value > low ? value < high ? value : high : low; }

/* Where a temperature lies between two knots, and the weights there of the four around it: the cubic that meets the values of the two and the
   slopes of their neighbours (Catmull and Rom), straight on beyond the ends of the table. */
typedef struct {
    int first; /* knot of weight[1] */
    double weight[4];
} gyro_place;

static gyro_place place_of(const gyro_instance *g, const double p[GYRO_N_VARIABLES])
{
    const double low = p[GYRO_TEMPERATURE_LOW];
    const double x = (limited(g->memory.temperature, low, p[GYRO_TEMPERATURE_HIGH]) - low) * g->plan.knots_a_kelvin;
    const int first = x < GYRO_KNOTS - 2 ? (int)x : GYRO_KNOTS - 2;
    const double f = x - first, r = 1.0 - f;
    return (gyro_place){first, {-0.5 * f * r * r, r * (1.0 + f * (1.0 - 1.5 * f)), f * (1.0 + r * (1.0 - 1.5 * r)), -0.5 * r * f * f}};
}

/* The value there of a table [GYRO_KNOTS]. */
static double value_at(gyro_place place, const double *knot)
{
    const int i = place.first;
    const double before = i > 0 ? knot[i - 1] : 2.0 * knot[0] - knot[1];
    const double after = i + 2 < GYRO_KNOTS ? knot[i + 2] : 2.0 * knot[GYRO_KNOTS - 1] - knot[GYRO_KNOTS - 2];
    return place.weight[0] * before + place.weight[1] * knot[i] + place.weight[2] * knot[i + 1] + place.weight[3] * after;
}

/* The rate [rad/s] that the sensor takes for the true one, before its bandwidth; `side` in -1 ... 1 is where the temperature came from. */
static double measured(const double p[GYRO_N_VARIABLES], gyro_place place, double dv, double side)
{
    const double rate = p[GYRO_OMEGA_Z] + p[GYRO_MISALIGNMENT_X] * p[GYRO_OMEGA_X] + p[GYRO_MISALIGNMENT_Y] * p[GYRO_OMEGA_Y];
    const double scale = p[GYRO_SCALE_FACTOR] + value_at(place, &p[GYRO_SCALE_FACTOR_TEMPERATURE_0]) + p[GYRO_SCALE_FACTOR_SUPPLY] * dv +
                         p[GYRO_SCALE_FACTOR_HYSTERESIS] * side;
    return (scale + (p[GYRO_NONLINEARITY_2] + p[GYRO_NONLINEARITY_3] * rate) * rate) * rate;
}

static double bias(const double p[GYRO_N_VARIABLES], gyro_place place, double dv, double side)
{
    return p[GYRO_BIAS] + value_at(place, &p[GYRO_BIAS_TEMPERATURE_0]) + p[GYRO_BIAS_SUPPLY] * dv + p[GYRO_THERMAL_HYSTERESIS] * side +
           p[GYRO_ACCELERATION_SENSITIVITY_X] * p[GYRO_A_X] + p[GYRO_ACCELERATION_SENSITIVITY_Y] * p[GYRO_A_Y] +
           p[GYRO_ACCELERATION_SENSITIVITY_Z] * p[GYRO_A_Z];
}

/* 1 far along on the way up, -1 on the way down: the mean of the play operators. */
static double side_of(const gyro_instance *g)
{
    double sum = 0.0;
    for (int i = 0; i < GYRO_PLAYS; i++) {
        sum += g->plan.push[i] * (g->memory.temperature - g->memory.play[i]);
    }
    return sum;
}

void gyro_find_input(gyro_instance *g, const double p[GYRO_N_VARIABLES])
{
    const gyro_place place = place_of(g, p);
    const double dv = p[GYRO_SUPPLY] - p[GYRO_SUPPLY_REF];
    const double side = side_of(g);
    double input = measured(p, place, dv, side) + bias(p, place, dv, side) + g->memory.turn_on;
    if (p[GYRO_SELF_TEST] != 0.0) {
        input += p[GYRO_SELF_TEST_RATE];
    }
    g->view.input = input;
}

void gyro_find_noise(gyro_instance *g) { g->view.noise = gyro_noise(&g->plan.drift, &g->memory.drift, g->memory.clock.grid); }

/* The structure has come to a temperature [K]; the play operators follow. */
static void heat(gyro_memory *memory, const double p[GYRO_N_VARIABLES], double temperature)
{
    memory->temperature = temperature;
    for (int i = 0; i < GYRO_PLAYS; i++) {
        const double width = p[GYRO_THERMAL_HYSTERESIS_WIDTH_1 + i];
        memory->play[i] = limited(memory->play[i], temperature - width, temperature + width);
    }
}

static const gyro_transition *transition_to(gyro_instance *g, gyro_instant to)
{
    return gyro_transition_of(&g->plan.filter, to.tick - g->memory.clock.settled.tick);
}

static double warmed(const gyro_instance *g, const gyro_transition *over)
{
    const double temperature = g->memory.temperature;
    return temperature + (g->value[GYRO_TEMPERATURE] - temperature) * over->warm;
}

static int is_ready(const gyro_instance *g, gyro_instant at) { return at.tick >= g->memory.ready; }

static void take_sample(gyro_instance *g)
{
    gyro_memory *memory = &g->memory;
    const double lsb = g->value[GYRO_LSB], most = g->value[GYRO_FULL_SCALE];
    memory->fresh = is_ready(g, memory->clock.settled);
    memory->sample = 0.0;
    if (memory->fresh) {
        const double rate = limited(gyro_filtered(&g->plan.filter, memory->state), -most, most);
        memory->sample = lsb > 0.0 ? limited(lsb * gyro_rint(rate / lsb), -most, most) : rate;
    }
}

void gyro_move(gyro_instance *g, gyro_instant to)
{
    gyro_memory *memory = &g->memory;
    const int64_t grid = memory->clock.grid;
    const double temperature = memory->temperature;
    if (gyro_before(memory->clock.settled, to)) {
        const gyro_transition *over = transition_to(g, to);
        gyro_move_filter(over, memory->state, g->view.input, g->view.noise);
        heat(memory, g->value, warmed(g, over));
    }
    const int at = gyro_settle(g, to);
    if (memory->clock.grid != grid) {
        gyro_next_drift(&g->plan.drift, &memory->drift, memory->clock.grid);
        gyro_find_noise(g);
    }
    if (at & GYRO_AT_SAMPLE) {
        take_sample(g);
    }
    if (memory->temperature != temperature) {
        gyro_find_input(g, g->value);
    }
}

gyro_instant gyro_next_own_cut(const gyro_instance *g)
{
    (void)g;
    return (gyro_instant){GYRO_NEVER, 0.0};
}

/* The supply switches the sensor on and off. */
static void switch_power(gyro_instance *g)
{
    gyro_memory *memory = &g->memory;
    const int on = g->value[GYRO_SUPPLY] >= g->value[GYRO_SUPPLY_LOW];
    if (!on) {
        memory->ready = GYRO_NEVER;
    } else if (memory->ready == GYRO_NEVER) {
        const double start_up = gyro_ticks(g->value[GYRO_START_UP_TIME]);
        memory->turn_ons += memory->clock.now > 0;
        memory->turn_on = g->value[GYRO_TURN_ON] * gyro_turn_on((uint32_t)g->value[GYRO_SEED], memory->turn_ons);
        memory->ready = memory->clock.settled.tick + (int64_t)gyro_floor(start_up + 0.5);
    }
}

/* The start: everything has long been as it is. */
static void begin(gyro_instance *g)
{
    gyro_memory *memory = &g->memory;
    const double temperature = g->value[GYRO_TEMPERATURE];
    for (int i = 0; i < GYRO_PLAYS; i++) {
        memory->play[i] = temperature;
    }
    memory->temperature = temperature;
    memory->ready = GYRO_NEVER;
    switch_power(g);
    gyro_find_input(g, g->value);
    gyro_rest_filter(memory->state, g->view.input);
}

gyro_status gyro_take_inputs(gyro_instance *g)
{
    if (g->memory.clock.now == 0) {
        /* What holds in the first step has held before. */
        begin(g);
    } else {
        switch_power(g);
        if (!(g->plan.filter.lag > 0.0)) {
            heat(&g->memory, g->value, g->value[GYRO_TEMPERATURE]);
        }
        gyro_find_input(g, g->value);
    }
    return GYRO_OK;
}

static void put_out(gyro_instance *g, gyro_instant at, const double state[GYRO_ORDER], double temperature)
{
    const gyro_memory *memory = &g->memory;
    const double since = (double)(at.tick - gyro_tick_of(g->plan.cuts.sample, memory->clock.sample));
    const int newly = since < 0.5 * ((double)g->plan.cuts.sample.whole + g->plan.cuts.sample.part);
    g->value[GYRO_RATE] = is_ready(g, at) ? gyro_filtered(&g->plan.filter, state) : 0.0;
    g->value[GYRO_RATE_SAMPLED] = memory->sample;
    g->value[GYRO_DATA_READY] = memory->fresh && newly ? 1.0 : 0.0;
    g->value[GYRO_TEMPERATURE_STRUCTURE] = temperature;
}

void gyro_put_out(gyro_instance *g) { put_out(g, g->memory.clock.settled, g->memory.state, g->memory.temperature); }

void gyro_look_ahead(gyro_instance *g, gyro_instant to)
{
    double state[GYRO_ORDER];
    const gyro_transition *over = transition_to(g, to);
    memcpy(state, g->memory.state, sizeof state);
    gyro_move_filter(over, state, g->view.input, g->view.noise);
    put_out(g, to, state, warmed(g, over));
}

void gyro_tune(gyro_instance *g) { (void)g; /* no parameter is tunable */ }

void gyro_hold_samples(gyro_instance *g, int hold) { (void)g, (void)hold; }

void gyro_latch(gyro_instance *g) { (void)g; }

void gyro_first_sample(gyro_instance *g)
{
    gyro_start_drift(&g->plan.drift, &g->memory.drift);
    gyro_find_noise(g);
    begin(g);
    take_sample(g);
    gyro_put_out(g);
}

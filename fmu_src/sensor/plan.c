/* What follows from the parameters of a sensor. */

#include <string.h>

#include "gyro_math.h"
#include "plant.h"

static const double TWO_PI = 6.283185307179586;

void gyro_drop(gyro_instance *g) { (void)g; }

gyro_status gyro_check_device(gyro_instance *g)
{
    const double low = g->value[GYRO_TEMPERATURE_LOW], high = g->value[GYRO_TEMPERATURE_HIGH];
    return low < high ? GYRO_OK : gyro_refuse(g, "temperature_low = %.9g K is not below temperature_high = %.9g K: give a range", low, high);
}

/* It has no effects that switch. */
void gyro_pass_events(gyro_instance *g) { g->plan.cuts.next_event = (gyro_instant){GYRO_NEVER, 0.0}; }

void gyro_find_events(gyro_instance *g) { gyro_pass_events(g); }

static void plan_filter(gyro_filter *filter, const double p[GYRO_N_VARIABLES])
{
    memset(filter, 0, sizeof *filter);
    filter->section[0] = (gyro_section){TWO_PI * p[GYRO_FILTER_FREQUENCY_1], p[GYRO_FILTER_DAMPING_1], p[GYRO_FILTER_LEAD_1]};
    filter->section[1] = (gyro_section){TWO_PI * p[GYRO_FILTER_FREQUENCY_2], p[GYRO_FILTER_DAMPING_2], p[GYRO_FILTER_LEAD_2]};
    filter->noise_lead = p[GYRO_NOISE_LEAD];
    filter->lag = p[GYRO_STRUCTURE_LAG];
}

const char *gyro_foreign_effect(const gyro_instance *g, uint32_t vr, double value)
{
    (void)g, (void)vr, (void)value;
    return NULL;
}

gyro_status gyro_prepare(gyro_instance *g)
{
    gyro_status status = gyro_check(g);
    if (status == GYRO_OK) {
        g->plan.cuts.grid = gyro_beat_of(g->value[GYRO_INTERNAL_STEP]);
        g->plan.cuts.sample = gyro_beat_of(g->value[GYRO_SAMPLE_PERIOD]);
        const char *why = gyro_impossible_clock(g);
        status = why != NULL ? gyro_refuse(g, "%s", why) : GYRO_OK;
    }
    if (status == GYRO_OK) {
        const double *p = g->value;
        plan_filter(&g->plan.filter, p);
        gyro_plan_drift(&g->plan.drift, (uint32_t)p[GYRO_SEED], p[GYRO_ANGLE_RANDOM_WALK], p[GYRO_BIAS_INSTABILITY], p[GYRO_RATE_RANDOM_WALK],
                        p[GYRO_INTERNAL_STEP]);
        g->plan.knots_a_kelvin = (GYRO_KNOTS - 1) / (p[GYRO_TEMPERATURE_HIGH] - p[GYRO_TEMPERATURE_LOW]);
        for (int i = 0; i < GYRO_PLAYS; i++) {
            g->plan.push[i] = 1.0 / (GYRO_PLAYS * p[GYRO_THERMAL_HYSTERESIS_WIDTH_1 + i]);
        }
        gyro_plan_cuts(g);
        /* Inputs may have been set that do not act yet. */
        gyro_find_input(g, g->memory.clock.held);
        gyro_find_noise(g);
    }
    return status;
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
    const char *why = NULL;
    double none = memory->temperature - memory->temperature + (memory->turn_on - memory->turn_on) + (memory->sample - memory->sample) +
                  (memory->drift.walk - memory->drift.walk);
    for (int i = 0; i < GYRO_ORDER; i++) {
        none += memory->state[i] - memory->state[i];
    }
    for (int i = 0; i < GYRO_PLAYS; i++) {
        none += memory->play[i] - memory->play[i];
    }
    for (int i = 0; i < GYRO_FLICKERS; i++) {
        none += memory->drift.flicker[i] - memory->drift.flicker[i];
    }
    if (none != 0.0 && !memory->clock.diverged) {
        why = "a number that it remembers is not finite";
    } else if (memory->turn_ons < 0 || memory->ready < 0 || (memory->fresh != 0 && memory->fresh != 1)) {
        why = "its turn-ons are none";
    }
    return why;
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
    parts[2] = (gyro_part){NULL, 0};
}

const char *gyro_infinite_state(const gyro_instance *g)
{
    const char *name = NULL;
    for (int i = 0; i < GYRO_ORDER && name == NULL; i++) {
        name = gyro_finite(g->memory.state[i]) ? NULL : "the filtered rate";
    }
    return name;
}

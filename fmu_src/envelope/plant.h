/* What an instance of the envelope form holds. Shared by core.c (life of an instance), plan.c (what follows from the parameters), plant.c
   (the step), sense.c (the voltages) and snapshot.c. */

#ifndef GYRO_PLANT_H
#define GYRO_PLANT_H

#include "cycle.h"
#include "generated/envelope.h"
#include "instance.h"
#include "slow.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Follows from the parameters and stays during a run. */
typedef struct {
    double step;                           /* internal step, s */
    int64_t event_tick[GYRO_N_EFFECTS];    /* internal step in which each effect's event falls; INT64_MAX: none */
    double event_fraction[GYRO_N_EFFECTS]; /* where in that step, [0, 1) */
    double noise_scale;                    /* of a normal number of each quadrature, √(2 sample_period/internal_step) */
    unsigned char any_event;
} gyro_plan;

/* Changes with time; with the values and what lags it is all that a snapshot holds. Amplitudes as (x, y). */
typedef struct {
    double start_time;   /* s */
    int64_t started;     /* 1 after gyro_start */
    int64_t tick;        /* internal steps since the start */
    int64_t calls;       /* calls of gyro_advance */
    double next_time;    /* end of the latest step as the importer adds it up, s */
    double held[GYRO_N_INPUTS]; /* inputs of the latest step, SI */
    gyro_harmonics q;    /* displacement, m */
    pair q_dot;          /* velocity at the carrier, m/s */
    gyro_slow slow;      /* motion of the latest step */
    matrix noise;        /* density of the noise force that `gathered` is for, as B N B* , m²/s */
    matrix noise_rate;   /* likewise S, 1/s */
    double noise_step;   /* likewise the step, s */
    matrix gathered;     /* root of the covariance that it makes in a step, m */
} gyro_memory;

/* Parts of a snapshot: values, memory, lagging quantities, and nothing beside the instance. */
enum { GYRO_N_PARTS = 4 };

struct gyro_instance {
    double value[GYRO_N_VARIABLES]; /* as set and as last put out, SI, by value reference */
    gyro_memory memory;
    gyro_plan plan;
    gyro_view view;
    char message[GYRO_MESSAGE_SIZE];
};

/* Rate of the carrier's phase, rad/s. */
double gyro_carrier(const gyro_instance *g);

/* Two standard normal numbers of an effect for the present tick; `index` tells one pair from another. */
void gyro_draw(const gyro_instance *g, int effect, uint32_t index, double normal[2]);

/* The force on the mass [N] after delay and actuators: at the carrier and, where a curve makes them, mean and harmonics. */
void gyro_actuate(gyro_instance *g, gyro_harmonics *u);

/* Puts out the voltages at the end of a step, from the motion in memory. */
void gyro_sense(gyro_instance *g);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

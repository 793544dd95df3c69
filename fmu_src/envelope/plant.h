/* What an instance of the envelope form holds. Shared by core.c (life of an instance), clock.c (time), plan.c (what follows from the parameters), plant.c
   (the step), sense.c (the voltages) and snapshot.c. */

#ifndef GYRO_PLANT_H
#define GYRO_PLANT_H

#include "cycle.h"
#include "generated/envelope.h"
#include "effect_memories.h"
#include "events.h"
#include "instance.h"
#include "slow.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Follows from the parameters and stays during a run, but for the next instants of the cuts. */
typedef struct {
    gyro_cuts cuts;     /* `sample` is the grid, at whose points the noise of the voltages is drawn */
    gyro_events events;
    double step;        /* internal step, s */
    double noise_scale; /* of a normal number of each quadrature, √(2 sample_period/internal_step) */
} gyro_plan;

/* Changes with time; with the values and what lags it is all that a snapshot holds. Amplitudes as (x, y). */
typedef struct {
    gyro_clock clock;
    gyro_harmonics q;    /* displacement, m */
    pair q_dot;          /* velocity at the carrier, m/s */
    pair bent_stiffness; /* what the curved forces of the latest step add to the stiffness of each axis at the carrier, 1/s² */
    pair bent_force;     /* likewise a force, N */
    int64_t jumped;      /* 1: since then an input or a parameter that curved forces may depend on has jumped */
    double phase;        /* of the carrier at `phase_at`, cycles */
    gyro_instant phase_at; /* the latest instant at which its frequency changed */
    gyro_slow slow;      /* motion of the latest step */
    matrix noise;        /* density of the noise force that `gathered` is for, as B N B* , m²/s */
    matrix noise_rate;   /* likewise S, 1/s */
    double noise_step;   /* likewise the step, s */
    matrix gathered;     /* root of the covariance that it makes in a step, m */
} gyro_memory;

/* Parts of a snapshot: values, memory, lagging quantities, what effects remember, and nothing beside the instance. */
enum { GYRO_N_PARTS = 5 };

struct gyro_instance {
    double value[GYRO_N_VARIABLES]; /* as set and as last put out, SI, by value reference */
    gyro_memory memory;
    gyro_plan plan;
    gyro_view view;
    char message[GYRO_MESSAGE_SIZE];
};

/* Rate of the carrier's phase, rad/s. */
double gyro_carrier(const gyro_instance *g);

/* Two standard normal numbers of an effect for a point of the grid; `index` tells one pair from another. */
void gyro_draw(const gyro_instance *g, int effect, int64_t point, uint32_t index, double normal[2]);

/* The force on the mass [N] after delay and actuators: at the carrier and, where a curve makes them, mean and harmonics. */
void gyro_actuate(gyro_instance *g, gyro_harmonics *u);

/* Puts out the voltages from the motion in memory, with the noise of a point of the grid. */
void gyro_sense(gyro_instance *g, int64_t point);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

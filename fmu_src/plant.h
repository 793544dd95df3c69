/* What an instance holds. Shared by core.c (life of an instance), plan.c (what follows from the parameters), plant.c (the step) and
   snapshot.c. */

#ifndef GYRO_PLANT_H
#define GYRO_PLANT_H

#include "generated/effects.h"
#include "instance.h"
#include "pink.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Follows from the parameters and stays during a run. */
typedef struct {
    double step;                           /* internal step, s */
    int64_t sample_ticks;                  /* internal steps a sample */
    int64_t delay_ticks;                   /* whole internal steps of the force delay */
    double delay_fraction;                 /* the rest of it, in internal steps, [0, 1) */
    int64_t event_tick[GYRO_N_EFFECTS];    /* internal step in which each effect's event falls; INT64_MAX: none */
    double event_fraction[GYRO_N_EFFECTS]; /* where in that step, [0, 1) */
    gyro_pink_plan pink;                   /* where any_draw */
    unsigned char any_event;
    unsigned char any_delay;
    unsigned char any_lag;
    unsigned char any_draw;
} gyro_plan;

/* Changes with time. With the values, the states, lagging quantities and random numbers of the view, and the delay line, it is all that a snapshot holds. */
typedef struct {
    double start_time;       /* s */
    int64_t started;         /* 1 after gyro_start */
    int64_t tick;            /* internal steps since the start */
    int64_t sample;          /* index of the latest sample */
    int64_t ticks_to_sample; /* internal steps until the next one */
    int64_t calls;           /* calls of gyro_advance */
    double next_time;        /* end of the latest step as the importer adds it up, s */
    double held[GYRO_N_INPUTS]; /* inputs of the latest step, SI; where any_impulse */
    gyro_pink_memory pink[GYRO_N_PINK];
    double lagged[2];        /* voltage after the amplifier's lag, V */
} gyro_memory;

/* Parts of a snapshot: values, memory, states, noise, lagging quantities, delay line. */
enum { GYRO_N_PARTS = 6 };

struct gyro_instance {
    double value[GYRO_N_VARIABLES]; /* as set and as last put out, SI, by value reference */
    gyro_memory memory;
    gyro_plan plan;
    gyro_view view;
    double (*delay_line)[2]; /* commanded forces of past internal steps, N, shape (delay_length, 2); NULL without a delay */
    size_t delay_length;
    char message[GYRO_MESSAGE_SIZE];
};

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

/* What an instance holds. Shared by core.c (life of an instance), clock.c (time), plan.c (what follows from the parameters), plant.c (the
   motion) and snapshot.c. */

#ifndef GYRO_PLANT_H
#define GYRO_PLANT_H

#include "bouc_wen_table.h"
#include "coupled.h"
#include "generated/effects.h"
#include "effect_memories.h"
#include "events.h"
#include "instance.h"
#include "lag.h"
#include "pink.h"
#include "propagator.h"
#include "series.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Lengths of the steps between cuts of a grid: a number of ticks, and one more where its beat is no whole number of them. */
enum { GYRO_LENGTHS = 2 };

/* Follows from the parameters and stays during a run, but for the next instants of the cuts. */
typedef struct {
    gyro_cuts cuts;
    gyro_events events;
    gyro_instant delay;  /* of the force, as if it came at the start */
    gyro_pink_plan pink; /* where any_draw */
    gyro_propagator propagator[GYRO_LENGTHS]; /* of the steps between cuts of the grid, where steady */
    gyro_coupled coupled[GYRO_LENGTHS];       /* of the same, where even, or but for forces that bend the motion in places */
    gyro_series_plan series; /* of the forces that bend the motion */
    gyro_followers followers; /* where they are all that do, and do it by values */
    gyro_bouc_wen_table *table; /* of them; NULL: there is none */
    gyro_lag lag;        /* weights for the latest step and time constants; where any_lag */
    unsigned char between; /* a force acts that bends the motion in places alone, and none elsewhere */
    unsigned char any_delay;
    unsigned char any_lag;
    unsigned char any_draw;
} gyro_plan;

/* Changes with time. With the values, the states, lagging quantities and random numbers of the view, and the late forces, it is all that a
   snapshot holds. */
typedef struct {
    gyro_clock clock;
    int64_t n_late;   /* late forces */
    double acting[2]; /* the command that acts now, after the delay, N */
    gyro_pink_memory pink[GYRO_N_PINK];
    double lagged[2]; /* voltage after the amplifier's lag, V */
    double sample[2]; /* the latest, V */
    int64_t hold;     /* 1: it is put out by gyro_latch only */
} gyro_memory;

/* A command on its way through the delay. */
typedef struct {
    int64_t due; /* tick in which it acts, the delay's part of a tick after its beginning */
    double u[2]; /* N */
} gyro_late_force;

/* Parts of a snapshot: values, memory, states, noise, lagging quantities, what effects remember, late forces. */
enum { GYRO_N_PARTS = 7 };

struct gyro_instance {
    double value[GYRO_N_VARIABLES]; /* as set and as last put out, SI, by value reference */
    gyro_memory memory;
    gyro_plan plan;
    gyro_view view;
    gyro_late_force *late; /* room for late_room commands, those on their way at late_first and after, in the order in which they act */
    int64_t late_first;
    int64_t late_room;
    char message[GYRO_MESSAGE_SIZE];
};

/* Brings what holds at the time of the view, with the variables `value` as set: laws, then the noise force, which depends on them. */
void gyro_refresh(gyro_view *view, const double value[GYRO_N_VARIABLES]);

/* The view at the communication point, inputs being those that act, and the voltages behind the lag; leaves no trace. */
void gyro_peek(gyro_instance *g, gyro_view *view, double lagged[2]);

/* Puts out what a view of the present instant shows. */
void gyro_put_out_of(gyro_instance *g, const gyro_view *view);

/* Takes the sample at `settled`, from the view as it is; its noise holds from there on. */
void gyro_sample_here(gyro_instance *g);

/* The late force that is due acts from now on. */
void gyro_bring_force(gyro_instance *g);

/* The voltage behind the amplifier's lag is the one before it. */
void gyro_start_lag(gyro_instance *g);

/* What effects remember at the time of the view, the force being that which acts, stands from now on. */
void gyro_remember(gyro_instance *g);

/* Finds which forces bend the motion, room for their series, and whether values of them do. */
void gyro_plan_series(gyro_instance *g);

/* Draws the numbers of one effect for the latest sample. */
void gyro_draw(gyro_instance *g, int effect);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

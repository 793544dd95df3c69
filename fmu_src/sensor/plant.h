/* What an instance of the sensor holds. Shared by core.c (life of an instance), clock.c (time), plan.c (what follows from the parameters), plant.c
   (the step) and snapshot.c. */

#ifndef GYRO_PLANT_H
#define GYRO_PLANT_H

#include "drift.h"
#include "filter.h"
#include "instance.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

enum { GYRO_PLAYS = 3, GYRO_KNOTS = GYRO_SCALE_FACTOR_SUPPLY - GYRO_SCALE_FACTOR_TEMPERATURE_0 };

/* Follows from the parameters and stays during a run, but for the next instants of the cuts and what only spares computing. */
typedef struct {
    gyro_cuts cuts;
    gyro_filter filter;
    gyro_drift_plan drift;
    double knots_a_kelvin;          /* of the tables over temperature */
    double push[GYRO_PLAYS];        /* of each play operator, 1/K */
} gyro_plan;

/* Changes with time; with the values it is all that a snapshot holds. */
typedef struct {
    gyro_clock clock;
    double state[GYRO_ORDER]; /* of the filter, rad/s */
    double temperature;       /* of the structure, K */
    double play[GYRO_PLAYS];  /* temperature behind each play operator, K */
    double turn_on;           /* bias that the latest turn-on drew, rad/s */
    double sample;            /* the latest, rad/s */
    gyro_drift drift;         /* at the latest point of the grid */
    int64_t turn_ons;         /* after the first */
    int64_t ready;            /* tick of the first valid output after the latest turn-on; GYRO_NEVER: the sensor is off */
    int64_t fresh;            /* 1: the latest sample is valid */
} gyro_memory;

/* What holds from `settled` on, rad/s. */
typedef struct {
    double input; /* of the filter, without noise */
    double noise; /* from the latest point of the grid on */
} gyro_view;

/* Parts of a snapshot: values, memory, and nothing beside the instance. */
enum { GYRO_N_PARTS = 3 };

struct gyro_instance {
    double value[GYRO_N_VARIABLES]; /* as set and as last put out, SI, by value reference */
    gyro_memory memory;
    gyro_plan plan;
    gyro_view view;
    char message[GYRO_MESSAGE_SIZE];
};

/* Finds the parts of the view from what is in memory: the input, with the variables `value` as they act, and the noise. */
void gyro_find_input(gyro_instance *g, const double value[GYRO_N_VARIABLES]);
void gyro_find_noise(gyro_instance *g);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

/* What a diagnosis calls beside the functions of FMI 3.0: columns of a run by the variation of its motion. */

#ifndef GYRO_VARIATION_H
#define GYRO_VARIATION_H

#include <stdint.h>

#if defined(_WIN32)
#define GYRO_EXPORTED __declspec(dllexport)
#elif defined(__GNUC__)
#define GYRO_EXPORTED __attribute__((visibility("default")))
#else
#define GYRO_EXPORTED
#endif

/* A run of `steps` steps, `stride` a sample. What stands below `step` is found by gyro_follow, for which there is room. */
typedef struct {
    int64_t steps;
    int64_t stride;
    int64_t n_inputs;
    const uint32_t *inputs; /* value references, shape (n_inputs) */
    const double *values;   /* held over each step, shape (steps, n_inputs), SI */
    const double *command;  /* of which a step holds the mean, at samples, shape (steps / stride + 1, 2), N; NULL: it is held from sample to sample */
    double start;           /* s */
    double step;            /* s */
    double *state;          /* x, x', y, y' at the ends of steps, shape (steps + 1, 4), SI */
    double *voltage;        /* sampled there, shape (steps + 1, 2), V */
    double *acceleration;   /* there, under the force of `command`, or that which acted before, shape (steps + 1, 2), m/s^2; NULL: not asked for */
    double *motion;         /* the states at two nodes within each step, shape (steps, 2, 4), SI */
    double *rate;           /* of x' and y' there, shape (steps, 2, 2), m/s^2 */
    double *passage;        /* of a difference over each step: after by before, shape (steps, 4, 4), SI */
    void *base;             /* the view of the run, with room for gyro_traveller_size() bytes */
    double *weight;         /* what rates add to a difference over a step: by node, state and axis, shape (2, 4, 2), s^2 and s */
} gyro_run;

/* Runs an initialised instance of FMI 3.0 whose sample period and internal step are `step`. Gives 0 where it fails, or where something acts that
   carries more than the motion from step to step. */
GYRO_EXPORTED int gyro_follow(void *instance, const gyro_run *run);

/* Bytes of what goes along a run with the parameters of another instance. */
GYRO_EXPORTED int64_t gyro_traveller_size(void);

/* Makes a traveller of another initialised instance. Gives 0 where something acts as above, but for forces with states of their own. */
GYRO_EXPORTED int gyro_depart(void *instance, const gyro_run *run, void *made);

/* What a column is of: voltage [V], speeds [m/s] or accelerations [m/s^2]. */
enum { GYRO_OF_VOLTAGE, GYRO_OF_SPEEDS, GYRO_OF_ACCELERATIONS };

/* What the parameters of n travellers add to a run, at samples: columns of shape (steps / stride + 1, 2). It uses them up. */
GYRO_EXPORTED void gyro_vary(const gyro_run *run, int64_t n, void *const travellers[], int of, double *const columns[]);

/* The accelerations [m/s^2] at present of an initialised instance of FMI 3.0, under the force of `command` [N], shape (2); NULL: under that which
   acts. Gives 0. */
GYRO_EXPORTED int32_t gyro_acceleration(void *instance, const double *command, double found[2]);

#endif

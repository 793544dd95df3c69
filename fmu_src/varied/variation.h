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

/* A run of `steps` steps, `stride` a sample. gyro_measure says how much room the rest takes, gyro_follow finds it. States are those of the
   model, as they are numbered in it; of one that does not move the value is 0. */
typedef struct {
    int64_t steps;
    int64_t stride;
    int64_t n_inputs;
    const uint32_t *inputs; /* value references, shape (n_inputs) */
    const double *values;   /* held over each step, shape (steps, n_inputs), SI */
    const double *command;  /* of which a step holds the mean, at samples, shape (steps / stride + 1, 2), N; NULL: it is held from sample to sample */
    double start;           /* s */
    double step;            /* s */
    int64_t states;         /* all of the model */
    int64_t moving;         /* of these, where the parameters are those of the run */
    int64_t room;           /* of a column of these: a few numbers more, which are 0 */
    int64_t passages;       /* 1: the passage over each step is the same; else steps */
    int64_t size;           /* of what goes along a run, bytes */
    double *state;          /* at the ends of steps, shape (steps + 1, states), SI */
    double *voltage;        /* sampled there, shape (steps + 1, 2), V */
    double *acceleration;   /* there, under the force of `command`, or that which acted before, shape (steps + 1, 2), m/s^2; NULL: not asked for */
    double *slope;          /* of these by the states that move, at samples, or by passages == 1 at any, shape (samples or 1, moving, 2), SI */
    double *within;         /* the states at two nodes within each step, shape (steps, 2, states), SI */
    double *rate;           /* of these there, likewise, SI/s */
    double *passage;        /* of a difference over each step: before by after, shape (passages, moving, room), SI */
    void *base;             /* the view of the run at its start, `size` bytes */
    double *weight;         /* what rates add to a difference over a step: by node, rate and state, shape (2, moving, room), s in the units of the states */
} gyro_run;

/* Says for an initialised instance of FMI 3.0, whose sample period and internal step are `step`, how much room its run takes. Gives 0 where
   something acts that carries more than the states from step to step, or acts between them. */
GYRO_EXPORTED int gyro_measure(void *instance, gyro_run *run);

/* Runs that instance. Gives 0 where it fails. */
GYRO_EXPORTED int gyro_follow(void *instance, const gyro_run *run);

/* Makes what goes along a run of another initialised instance, a traveller. Gives 0 where something acts as above, or a state of the run does not
   move. */
GYRO_EXPORTED int gyro_depart(void *instance, const gyro_run *run, void *made);

/* What a column is of: voltage [V], speeds [m/s] or accelerations [m/s^2]. */
enum { GYRO_OF_VOLTAGE, GYRO_OF_SPEEDS, GYRO_OF_ACCELERATIONS };

/* What the parameters of n travellers add to a run, at samples: columns of shape (steps / stride + 1, 2). It uses them up. */
GYRO_EXPORTED void gyro_vary(const gyro_run *run, int64_t n, void *const travellers[], int of, double *const columns[]);

/* The accelerations [m/s^2] at present of an initialised instance of FMI 3.0, under the force of `command` [N], shape (2); NULL: under that which
   acts. Gives 0. */
GYRO_EXPORTED int32_t gyro_acceleration(void *instance, const double *command, double found[2]);

#endif

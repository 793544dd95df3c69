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

/* A run of `steps` steps, `stride` a sample. gyro_measure says how much room the rest takes, gyro_follow finds the motion and gyro_linearise what
   lies along it. That is known by pieces: most are whole steps, or their parts before and after a late force comes, and where a force bends the
   motion in a place, parts of these. States are those of the model, as they are numbered in it; of one that does not move the value is 0. */
typedef struct {
    int64_t steps;
    int64_t stride;
    int64_t axes; /* 2, or 1: y rests, and no force couples x with it */
    int64_t n_inputs;
    const uint32_t *inputs; /* value references, shape (n_inputs) */
    const double *values;   /* held over each step, shape (steps, n_inputs), SI */
    const double *command;  /* of which a step holds the mean, at samples, shape (steps / stride + 1, 2), N; NULL: it is held from sample to sample */
    double start;           /* s */
    double step;            /* s */
    double late;            /* the command acts so many steps later; the first has acted before */
    int64_t states;         /* all of the model */
    int64_t moving;         /* of these, where the parameters are those of the run */
    int64_t room;           /* of a column of these: a few numbers more, which are 0 */
    int64_t even;           /* 1: nothing bends the motion */
    int64_t shared;         /* 1: the passage over each whole step is the same */
    int64_t kinds;          /* of pieces that pass differences on alike: 1, whole steps; or 3, and their parts before and after a late force comes */
    int64_t parts;          /* other parts, for which there is room; 0: there can be none */
    int64_t size;           /* of what goes along a run, bytes */
    double *state;          /* at the ends of steps, shape (steps + 1, states), SI */
    double *voltage;        /* sampled there, shape (steps + 1, 2), V */
    double *acceleration;   /* there, under the force of `command`, or that which acted before, shape (steps + 1, 2), m/s^2; NULL: not asked for */
    double *slope;          /* of these by the states that move, at samples, or where nothing bends at any, shape (samples or 1, moving, 2), SI */
    int64_t *until;         /* pieces until each sample, shape (steps / stride + 1) */
    int64_t *lies;          /* the step that a piece lies in, shape (pieces): a step each, of 3 kinds two, and `parts` */
    int64_t *part;          /* its kind, or from `kinds` on which other part it is; likewise */
    double *length;         /* of a piece, likewise, steps */
    double *place;          /* of two nodes in each piece, shape (pieces, 2), in steps from where that begins which it lies in */
    double *within;         /* the states at nodes, shape (pieces, 2, states), SI */
    double *rate;           /* of these there, likewise, SI/s */
    double *passage;        /* of a difference over each piece, or `shared` by `part`: before by after, shape (pieces or kinds + parts, moving, room),
                               SI */
    void *base;             /* the view of the run at its start, `size` bytes */
    double *weight;         /* what rates add to a difference over a piece, by `part`, node, rate and state, shape (kinds + parts, 2, moving, room), s in the
                               units of the states */
} gyro_run;

/* Says for an initialised instance of FMI 3.0, whose sample period and internal step are `step`, how much room its run takes. Gives 0 where
   something acts that carries more than the states from step to step, or acts between them. */
GYRO_EXPORTED int gyro_measure(void *instance, gyro_run *run);

/* Runs that instance: states and voltage. Gives 0 where it fails, or where y moves and the run has one axis. */
GYRO_EXPORTED int gyro_follow(void *instance, const gyro_run *run);

/* All else along the run of that instance. Gives 0 where it has more parts than there is room for. */
GYRO_EXPORTED int gyro_linearise(void *instance, const gyro_run *run);

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

/* What fmi2.c and fmi3.c share: life cycle and checks of arguments (fmi_common.c), log (fmi_log.c), saved state (fmi_saved.c).

   Every function takes the name of the FMI function that was called (`call`), so that a message names it. A refused call (FMI_ERROR)
   changes nothing, and the instance stays usable; only a step that diverges has moved it. */

#ifndef GYRO_FMI_COMMON_H
#define GYRO_FMI_COMMON_H

#include "core.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* The same numbers in FMI 2 and FMI 3. */
typedef enum { FMI_OK = 0, FMI_DISCARD = 2 /* of a step that ended early */, FMI_ERROR = 3 } fmi_status;

/* Where an instance is in its life. Bits, so that a set of states is one number. */
enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    STEPPING = 4,
    TERMINATED = 8,
    INTERMEDIATE = 16, /* in the importer's callback within a step: it may only look */
    EVENT = 32,
    CONTINUOUS = 64, /* of model exchange */
    ANY_STATE = INSTANTIATED | INITIALIZATION | STEPPING | TERMINATED | EVENT | CONTINUOUS,
    RUNNING = STEPPING | EVENT | CONTINUOUS
};

/* The life cycle in one table: the states in which a call is allowed. */
enum {
    CAN_SETUP = INSTANTIATED,
    CAN_ENTER_INITIALIZATION = INSTANTIATED,
    CAN_EXIT_INITIALIZATION = INITIALIZATION,
    CAN_SET_PARAMETER = INSTANTIATED | INITIALIZATION,
    CAN_TUNE = INSTANTIATED | INITIALIZATION | STEPPING | EVENT,
    CAN_SET_INPUT = INSTANTIATED | INITIALIZATION | RUNNING,
    CAN_GET_PARAMETER = ANY_STATE | INTERMEDIATE,
    CAN_GET_INPUT = ANY_STATE | INTERMEDIATE,
    CAN_GET_OUTPUT = INITIALIZATION | RUNNING | TERMINATED | INTERMEDIATE,
    CAN_DERIVE = INITIALIZATION | RUNNING | TERMINATED,
    CAN_UPDATE = EVENT,
    CAN_SET_TIME = EVENT | CONTINUOUS,
    CAN_SET_STATES = CONTINUOUS,
    CAN_STEP = STEPPING,
    CAN_GET_STATUS = STEPPING | TERMINATED,
    CAN_TERMINATE = RUNNING,
    CAN_RESET = ANY_STATE,
    CAN_SAVE = ANY_STATE,
    CAN_RESTORE = ANY_STATE,
    CAN_SET_LOGGING = ANY_STATE
};

/* Categories of the log, bits. Errors are reported unless the importer switches off just that category. */
enum { LOG_ERRORS = 1, LOG_EVENTS = 2 };

/* What an instance was made for. */
typedef enum { CO_SIMULATION = 0, MODEL_EXCHANGE = 1, CO_SIMULATION_WITH_EVENTS = 2 } fmi_purpose;

typedef struct fmi_instance fmi_instance;

typedef void (*fmi_callback)(void); /* the importer's log function, whatever its standard's signature */
typedef void (*fmi_emit)(const fmi_instance *f, fmi_status status, const char *category, const char *text);

/* Calls the importer's update function, within a step; the time [s] at which the step shall end, infinity for its own end. */
typedef double (*fmi_watch)(fmi_instance *f);

struct fmi_instance {
    gyro_instance *core;
    unsigned state;         /* one of the life-cycle bits */
    fmi_purpose purpose;
    fmi_status last_step;   /* of the latest step */
    double start_time;      /* s */
    double stop_time;       /* s, infinite when undefined */
    double latest_time;     /* s, stop_time and the rounding of times: no step may end later */
    unsigned logging;       /* LOG_ bits that are on */
    fmi_emit emit;          /* hands a text to `callback` the standard's way */
    fmi_callback callback;  /* may be NULL */
    void *environment;      /* the importer's, for both callbacks */
    fmi_watch watch;        /* hands an intermediate point to `update` the standard's way; NULL: nobody looks */
    fmi_callback update;    /* the importer's function for it */
    int may_end_early;      /* 1: the importer takes a step that ends early */
    int sampled;            /* 1: the latest step came to a sample */
    int ticking;            /* 1: a sample has been taken whose event is not over: output clocks are active in event mode */
    int has_starts;         /* 1: the FMU brings start values of its own */
    double start[GYRO_N_VARIABLES]; /* which are these, SI */
    char name[];            /* the importer's name of the instance */
};

/* What an importer asks for when it makes an instance. */
typedef struct {
    const char *call;
    const char *name;
    const char *token;      /* must be gyro_token, or that with the hash of the start values that the FMU brings */
    const char *resources;  /* where those lie: the folder resources/ as a path or URI; may be NULL */
    const char *refusal;    /* why this kind of instance does not exist; NULL: it does */
    int logging_on;
    fmi_purpose purpose;
    fmi_emit emit;
    fmi_callback callback;
    void *environment;
    fmi_watch watch;
    fmi_callback update;
    int may_end_early;
} fmi_request;

/* From fmi_starts.c: refuses a token that is not this library's, and reads the start values that it announces. */
fmi_status fmi_check_token(fmi_instance *f, const fmi_request *request);

/* A new instance; NULL, with a message in the log, when the request is refused. */
fmi_instance *fmi_new(const fmi_request *request);
void fmi_free(fmi_instance *f);

/* Logs "call: why" (a printf format) as an error; FMI_ERROR always. `f` may be NULL. */
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
fmi_status fmi_fail(const fmi_instance *f, const char *call, const char *why, ...);

/* Logs "call: event at t = ..." when events are asked for. */
void fmi_report(const fmi_instance *f, const char *call, const char *event);

/* Present time, s; the start time before the core has started. */
double fmi_time(const fmi_instance *f);

/* FMI_ERROR when the instance is NULL or its state is not among `allowed`. */
fmi_status fmi_allow(const fmi_instance *f, const char *call, unsigned allowed);

/* Log categories on or off, by n names; n = 0: all on, or all but errors off. */
fmi_status fmi_set_logging(fmi_instance *f, const char *call, int on, size_t n, const char *const categories[]);

/* Times in s; stop_time counts only when stop_defined. */
fmi_status fmi_set_times(fmi_instance *f, const char *call, double start_time, int stop_defined, double stop_time);
fmi_status fmi_enter_initialization(fmi_instance *f, const char *call);
fmi_status fmi_exit_initialization(fmi_instance *f, const char *call);
/* Makes the outputs those of what has been set, where that has not been done. */
fmi_status fmi_refresh(fmi_instance *f, const char *call);
void fmi_find_latest_time(fmi_instance *f); /* from start_time and stop_time */
fmi_status fmi_terminate(fmi_instance *f, const char *call);
fmi_status fmi_reset(fmi_instance *f, const char *call);

/* vr: n value references; values: n_values of double for GYRO_REAL, of int32_t for GYRO_INTEGER, in SI units. All or none are set. */
fmi_status fmi_set(fmi_instance *f, const char *call, gyro_type type, const uint32_t vr[], size_t n, const void *values, size_t n_values);
fmi_status fmi_get(fmi_instance *f, const char *call, gyro_type type, const uint32_t vr[], size_t n, void *values, size_t n_values);

/* For the types that no variable has: FMI_OK for n = 0, else an error that says what the first variable is. */
fmi_status fmi_no_such_type(const fmi_instance *f, const char *call, const uint32_t vr[], size_t n);

/* Modes of model exchange, and of co-simulation with events. */
fmi_status fmi_enter_event_mode(fmi_instance *f, const char *call);
fmi_status fmi_leave_event_mode(fmi_instance *f, const char *call, unsigned mode); /* CONTINUOUS or STEPPING */

/* What is due in event mode is done; *jumped: 1 where continuous states have; *next: time of the next event, s. */
fmi_status fmi_update(fmi_instance *f, const char *call, int *jumped, double *next);

/* Output clocks: value[i] is 1 where the clock vr[i] is active. */
fmi_status fmi_get_clocks(fmi_instance *f, const char *call, const uint32_t vr[], size_t n, _Bool value[]);

/* FMI_ERROR where the instance is not of model exchange, or not in an allowed state. */
fmi_status fmi_allow_exchange(const fmi_instance *f, const char *call, unsigned allowed);

/* Of model exchange: time [s], and arrays of n = GYRO_N_CONTINUOUS in SI. */
fmi_status fmi_set_time(fmi_instance *f, const char *call, double time);
fmi_status fmi_set_states(fmi_instance *f, const char *call, const double states[], size_t n);
fmi_status fmi_get_states(fmi_instance *f, const char *call, double states[], size_t n);
fmi_status fmi_get_rates(fmi_instance *f, const char *call, double rates[], size_t n);
fmi_status fmi_get_nominals(fmi_instance *f, const char *call, double nominals[], size_t n);
fmi_status fmi_no_indicators(fmi_instance *f, const char *call, size_t n);
fmi_status fmi_completed_step(fmi_instance *f, const char *call);

/* The value of the variable `vr`, GYRO_FIRST_LOCAL or more. */
double fmi_local(fmi_instance *f, uint32_t vr);

/* Derivatives of unknowns (rates, continuous outputs) by knowns (inputs, states) along a seed: forward, seed by known, or adjoint. */
typedef struct {
    const uint32_t *unknowns;
    size_t n_unknowns;
    const uint32_t *knowns;
    size_t n_knowns;
    const double *seed;
    size_t n_seed;
    double *sensitivity;
    size_t n_sensitivity;
} fmi_derivative;
fmi_status fmi_derive(fmi_instance *f, const char *call, const fmi_derivative *of);
fmi_status fmi_derive_adjoint(fmi_instance *f, const char *call, const fmi_derivative *of);

/* From time `from` on by `step`, s; FMI_DISCARD where it ends early, at fmi_time. */
fmi_status fmi_step(fmi_instance *f, const char *call, double from, double step);

/* Saved states are blocks of their own, good for any instance of this model. fmi_save: *saved NULL: a new block, else it is used again;
   fmi_deserialize: always a new block, whatever *saved is before.
   As bytes they begin with magic, length and checksum, and hold no pointer. */
fmi_status fmi_save(fmi_instance *f, const char *call, void **saved);
fmi_status fmi_restore(fmi_instance *f, const char *call, const void *saved);
fmi_status fmi_free_saved(const fmi_instance *f, const char *call, void **saved);
fmi_status fmi_saved_size(const fmi_instance *f, const char *call, const void *saved, size_t *size);
fmi_status fmi_serialize(const fmi_instance *f, const char *call, const void *saved, unsigned char bytes[], size_t size);
fmi_status fmi_deserialize(const fmi_instance *f, const char *call, const unsigned char bytes[], size_t size, void **saved);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

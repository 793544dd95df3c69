/* What core.c, clock.c and snapshot.c share with the plant inside an instance. Each FMU has a plant.h of its own, which defines
   `struct gyro_instance` with `value`, `message`, `view`, a `memory` with a `clock` and a `plan` with `cuts`. */

#ifndef GYRO_INSTANCE_H
#define GYRO_INSTANCE_H

#include "core.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Time is counted in ticks of 1 ps since the start: far below any step, and a double holds them exactly for 2.5 hours. */
#define GYRO_TICKS_A_SECOND 1e12

/* The last tick that a run may reach, 104 days; what is added to it below still fits an int64. */
#define GYRO_LAST_TICK INT64_C(9000000000000000000)

/* A time that comes from a parameter and falls where it likes: an event, a delayed change of the force. */
typedef struct {
    int64_t tick; /* since the start; GYRO_NEVER: it does not come */
    double part;  /* beyond the tick, [0, 1) ticks */
} gyro_instant;

#define GYRO_NEVER INT64_MAX

/* Multiples of a period: the k-th lies at the tick nearest to k (whole + part), so that no rounding adds up. */
typedef struct {
    int64_t whole; /* ticks */
    double part;   /* ticks, [0, 1) */
} gyro_beat;

/* Changes with time. */
typedef struct {
    double start_time;          /* s */
    int64_t started;            /* 1 after gyro_start */
    int64_t now;                /* the communication point, in ticks since the start */
    double rest;                /* by what the sum of the steps is beyond `now`, ticks */
    gyro_instant settled;       /* up to where the motion is final, at most `now`: nothing that an importer does later can cut it */
    int64_t grid;               /* points of the integration grid up to `settled`, the start not counted */
    int64_t sample;             /* samples up to `settled`, likewise: the index of the latest */
    int64_t diverged;           /* 1 once a state is not finite */
    double next_time;           /* end of the latest step as the importer adds it up, s */
    int64_t tuned;              /* 1: a parameter was set that may not act yet */
    double held[GYRO_N_VARIABLES]; /* inputs and parameters that have acted since the latest change, SI; of outputs nothing */
} gyro_clock;

/* The instants at which the integration is cut; follows from the parameters and the clock. */
typedef struct {
    gyro_beat grid;      /* multiples of internal_step */
    gyro_beat sample;    /* multiples of sample_period, or what the plant draws its noise at */
    int64_t next_grid;   /* tick of the next of each */
    int64_t next_sample;
    gyro_instant next_event;
    double time;         /* of the communication point, s */
    double latest_step;  /* of an importer [s], and the same in ticks: most steps are like the one before */
    double latest_ticks;
} gyro_cuts;

/* From core.c. */

/* Records why a call is refused, printf style; gives GYRO_ERROR. */
gyro_status gyro_refuse(gyro_instance *g, const char *format, ...);

/* Refuses parameters out of their bounds, or of no device. */
gyro_status gyro_check(gyro_instance *g);

/* The tick `from` + `ticks`; a sample instant nearby is meant: within a tick, to which two ways of counting a period that is no whole
   number of ticks may round, or a millionth of the sample period, for an importer whose times have lost their last digits. */
int64_t gyro_nearest_tick(const gyro_instance *g, int64_t from, double ticks);

/* The values before the latest change and the present ones change places, up to the value reference `end`. */
void gyro_swap_values(gyro_instance *g, int end);

/* Takes inputs and tunable parameters as they are, where they are new: an equal value is no change, and cuts nothing. */
gyro_status gyro_take_values(gyro_instance *g);

/* From clock.c: */

/* A time or period [s] in ticks; a whole number where it is one to the rounding of a double. */
double gyro_ticks(double seconds);

/* The instant that many ticks after the start, or at the end of what is counted. */
gyro_instant gyro_instant_of(double ticks);

static inline int gyro_before(gyro_instant a, gyro_instant b) { return a.tick < b.tick || (a.tick == b.tick && a.part < b.part); }

/* From one instant to another [s]. A quotient, since 1e-12 is no double: 10 000 000 ticks are the double nearest to 1e-5 s. */
static inline double gyro_between(gyro_instant from, gyro_instant to)
{
    return ((double)(to.tick - from.tick) + (to.part - from.part)) / GYRO_TICKS_A_SECOND;
}

/* Brings the clock to a communication point: a tick and what the importer's steps are beyond it [ticks]. */
void gyro_come_to(gyro_instance *g, int64_t tick, double rest);

/* The time [s] of an instant, by which laws go. */
double gyro_time_of(const gyro_instance *g, gyro_instant at);

gyro_beat gyro_beat_of(double period);

/* The tick of the k-th beat, k >= 0. */
int64_t gyro_tick_of(gyro_beat beat, int64_t k);

/* How many beats there are up to a tick, that of the start not counted. */
int64_t gyro_beats_until(gyro_beat beat, int64_t tick);

/* Finds events and next instants from the parameters (in the view), the beats of the plan and the clock. */
void gyro_plan_cuts(gyro_instance *g);

/* The next instant after `settled` that is on the grid, a sample or an event. */
gyro_instant gyro_next_cut(const gyro_instance *g);

/* What `settled` has come to. */
enum { GYRO_AT_SAMPLE = 1, GYRO_AT_EVENT = 2 };

/* Moves `settled` to `to`, at most the next cut, with counts and next instants; gives GYRO_AT_ bits. */
int gyro_settle(gyro_instance *g, gyro_instant to);

/* Why a clock that was read from bytes can be none; NULL where it can. The beats of the plan must be known. */
const char *gyro_impossible_clock(const gyro_instance *g);

/* From the plant. */

/* Refuses parameters that are within their bounds and no device. */
gyro_status gyro_check_device(gyro_instance *g);

/* Finds the events from the parameters, then passes them: brings the next event, and what switches, to `settled`. */
void gyro_find_events(gyro_instance *g);
void gyro_pass_events(gyro_instance *g);

/* Builds the plan and the rest of the view from values and memory; refuses parameters that don't fit one another. Allocates nothing. */
gyro_status gyro_prepare(gyro_instance *g);

/* Bytes of what the instance holds beside itself by its memory, and room for them. */
size_t gyro_room(const gyro_instance *g);
gyro_status gyro_make_room(gyro_instance *g);

/* Why a memory that was read from bytes can be none of this plant; NULL where it can. */
const char *gyro_impossible_memory(const gyro_instance *g);

/* Why what the instance holds beside itself, read from bytes, can be none; NULL where it can. */
const char *gyro_impossible_room(const gyro_instance *g);

/* Sets the initial state, takes sample 0, latches the outputs. */
void gyro_first_sample(gyro_instance *g);

/* The values of the tunable parameters act from now on, which `settled` has reached; gyro_take_inputs comes next. An effect that begins to act
   begins as at the start; noise numbers are those of the latest sample. */
void gyro_tune(gyro_instance *g);

/* The values of the inputs act from now on, which `settled` has reached; `held` are those before. GYRO_ERROR when memory is short, and
   then nothing has changed. */
gyro_status gyro_take_inputs(gyro_instance *g);

/* The next instant after `settled` at which the plant itself is cut. */
gyro_instant gyro_next_own_cut(const gyro_instance *g);

/* Moves the state from `settled` to `to`, in which nothing jumps, settles there and does what is due there. */
void gyro_move(gyro_instance *g, gyro_instant to);

/* Puts out the motion at `settled`. */
void gyro_put_out(gyro_instance *g);

/* Puts out the motion at `to`, between `settled` and the next cut, and leaves no trace of having been there; only a state that
   is not finite stays. */
void gyro_look_ahead(gyro_instance *g, gyro_instant to);

/* The name of a state that is not finite; NULL where all are. */
const char *gyro_infinite_state(const gyro_instance *g);

/* Frees what the instance holds beside itself. */
void gyro_drop(gyro_instance *g);

typedef struct {
    void *data;
    size_t size; /* bytes */
} gyro_part;

/* What a snapshot holds, in order, shape (GYRO_N_PARTS). The last part is what gyro_make_room makes; the sizes of the others are fixed. */
void gyro_list_parts(gyro_instance *g, gyro_part parts[]);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif

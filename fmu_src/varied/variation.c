/* The variation of a motion: what other parameters add to a run, to first order in what they add to its states.

   With the states s of the run that move, their rates f and those f* of the other parameters, the difference d obeys

       d' = J d + f*(s) - f(s),   J = df/ds,

   so that no other motion need be found: a piece, a step or a part of one, is s, f and J at two nodes of Gauss. J passes d on by the exponential of
   Magnus' series with two terms; the difference of the rates is the line through the nodes, whose exponential integral is tabulated for the mean of J
   over whole steps, or in parts of steps follows by Gauss' quadrature. All are of fourth order (A. Iserles, H. Z. Munthe-Kaas, S. P. Norsett, A. Zanna,
   Lie-group methods, Acta Numerica 9, 2000, sections 4 and 5). Voltages follow from s + d as those of the FMU do. */

#include "pair.h"
#include "traveller.h"

/* Pieces that all columns go before the next, so that what is found at their nodes stays near the processor. */
enum { TOGETHER = 128 };

/* A part of a run along which a traveller is taken; at nodes but where it says otherwise. */
typedef struct {
    double force[TOGETHER * NODES][2], left[TOGETHER * NODES][2]; /* N; then what they add to the rates of the speeds, m/s^2 */
    double rate[TOGETHER * NODES][GYRO_N_STATES];                 /* of states that effects add, SI/s; then what is added to those of the run */
    double rate_left[TOGETHER * NODES][GYRO_N_STATES];            /* likewise, of the run */
    double state[TOGETHER * NODES][GYRO_N_STATES];                /* of the run, with states that move beside, SI */
    double difference[TOGETHER][GYRO_N_STATES];                   /* after each piece, by the states that move, SI */
    double own_after[TOGETHER][GYRO_N_STATES];                    /* states that move beside those of the run, there, SI */
    double sample_state[TOGETHER][GYRO_N_STATES];                 /* of the run at samples, with states that move beside, SI */
    double sample_rate[TOGETHER][GYRO_N_STATES];                  /* of the run there, of the speeds alone, m/s^2 */
    int64_t sample_lies[TOGETHER];                                /* the step that ends at each sample */
    double sample_place[TOGETHER];                                /* of it there */
} part_of_run;

/* What own states pass on over a piece of h [s], to its nodes and its end. */
static void find_own_passings(const driven *own, double h, passing to[NODES], passing *whole)
{
    for (int node = 0; node < NODES; node++) {
        find_passing(own->among.n, &own->slope, h, PLACE[node], &to[node]);
    }
    find_passing(own->among.n, &own->slope, h, 1.0, whole);
}

/* In the view at the start. */
static void begin_own(traveller *at, const gyro_run *run)
{
    driven *own = &at->own;
    const int n = own->among.n, *place = own->among.place;
    double rest[GYRO_N_STATES], rate[GYRO_N_STATES];
    for (int i = 0; i < n; i++) {
        own->state[i] = at->view.s[place[i]];
    }
    look_from(at, run, 0, 0.0, run->state);
    state_rate(&at->view, rest);
    for (int j = 0; j < n; j++) {
        double *state = &at->view.s[place[j]];
        *state = 1.0;
        state_rate(&at->view, rate);
        *state = 0.0;
        for (int i = 0; i < n; i++) {
            own->slope.of[i][j] = rate[place[i]] - rest[place[i]];
        }
    }
    for (int kind = 0; kind < run->kinds; kind++) {
        find_own_passings(own, run->step * length_of_kind(run, kind), own->to[kind], &own->whole[kind]);
    }
}

/* Own states after a part of a piece, by their rates at its nodes; put where they stand among all. */
static void pass_own(const driven *own, const passing *over, double (*const rate)[GYRO_N_STATES], double all[GYRO_N_STATES])
{
    const int n = own->among.n, *place = own->among.place;
    for (int i = 0; i < n; i++) {
        double sum = 0.0;
        for (int j = 0; j < n; j++) {
            sum += over->passage.of[i][j] * own->state[j];
            for (int node = 0; node < NODES; node++) {
                sum += over->weight[node].of[i][j] * rate[node][place[j]];
            }
        }
        all[place[i]] = sum;
    }
}

/* Pieces of a run from the first on, before the last. */
typedef struct {
    const gyro_run *run;
    int64_t first, last;
} pieces_of_run;

/* What the forces and the mass of a traveller add to the rates of the speeds at nodes, and what its forces add to those of other states. */
static void find_forcing(traveller *at, gyro_view *base, const gyro_nodes *nodes, part_of_run *part)
{
    memset(part->force, 0, (size_t)nodes->n * sizeof *part->force);
    memset(part->left, 0, (size_t)nodes->n * sizeof *part->left);
    if (at->n_forced > 0 || at->own.among.n > 0) {
        memset(part->rate, 0, (size_t)nodes->n * sizeof *part->rate);
        memset(part->rate_left, 0, (size_t)nodes->n * sizeof *part->rate_left);
    }
    for (int i = 0; i < at->n_added; i++) {
        add_force(&at->view, nodes, at->added[i], part->force, part->rate);
    }
    for (int i = 0; i < at->n_left; i++) {
        add_force(base, nodes, at->left[i], part->left, part->rate_left);
    }
    for (int64_t i = 0; i < nodes->n && at->maps; i++) {
        if (i % nodes->each == 0) {
            bring_all(&at->view, nodes, i);
            bring_all(base, nodes, i);
        }
        for (int axis = 0; axis < 2; axis++) {
            part->force[i][axis] += at->view.u[axis] - base->u[axis];
        }
    }
    for (int64_t i = 0; i < nodes->n; i++) {
        for (int axis = 0; axis < 2; axis++) {
            const double added = (part->force[i][axis] - part->left[i][axis]) * at->view.inverse_mass;
            part->force[i][axis] = added + at->lighter * nodes->rate[i][axis == 0 ? GYRO_STATE_X_DOT : GYRO_STATE_Y_DOT];
        }
        for (int k = 0; k < at->n_forced; k++) {
            const int place = at->moving.place[at->forced[k]];
            part->rate[i][place] -= part->rate_left[i][place];
        }
    }
}

/* Likewise where laws act. */
static void find_lawful_forcing(traveller *at, const gyro_nodes *nodes, part_of_run *part)
{
    for (int64_t i = 0; i < nodes->n; i++) {
        const int64_t step = step_of(nodes, i);
        const double *base = nodes->rate[i];
        if (i % nodes->each == 0) {
            come_to(at, nodes->run, step, nodes->place[i]);
        }
        look_from(at, nodes->run, step, nodes->place[i], nodes->state[i]);
        press(&at->view, command_of(nodes, i));
        state_rate(&at->view, part->rate[i]);
        part->force[i][0] = part->rate[i][GYRO_STATE_X_DOT] - base[GYRO_STATE_X_DOT];
        part->force[i][1] = part->rate[i][GYRO_STATE_Y_DOT] - base[GYRO_STATE_Y_DOT];
        for (int k = 0; k < at->n_forced; k++) {
            const int place = at->moving.place[at->forced[k]];
            part->rate[i][place] -= base[place];
        }
    }
}

static void find_forces(traveller *at, gyro_view *base, const gyro_nodes *nodes, part_of_run *part)
{
    if (at->lawful) {
        find_lawful_forcing(at, nodes, part);
    } else {
        find_forcing(at, base, nodes, part);
    }
}

/* Own states at the nodes of a part of a run, from what drives them there, and at its end, which stay. */
static void drive_own(traveller *at, gyro_view *base, const pieces_of_run *of, gyro_nodes *nodes, part_of_run *part)
{
    driven *own = &at->own;
    find_forces(at, base, nodes, part);
    memcpy(part->state, nodes->state, (size_t)nodes->n * sizeof *part->state);
    memset(part->own_after, 0, sizeof part->own_after);
    for (int64_t i = 0; i < nodes->n; i += NODES) {
        const int64_t piece = of->first + i / NODES;
        double *after = part->own_after[i / NODES];
        passing to_nodes[NODES], to_end;
        const int64_t kind = of->run->part[piece];
        const passing *to = to_nodes, *whole = &to_end;
        if (kind < of->run->kinds) {
            to = own->to[kind];
            whole = &own->whole[kind];
        } else {
            find_own_passings(own, of->run->length[piece] * of->run->step, to_nodes, &to_end);
        }
        for (int node = 0; node < NODES; node++) {
            pass_own(own, &to[node], part->rate + i, part->state[i + node]);
        }
        pass_own(own, whole, part->rate + i, after);
        for (int j = 0; j < own->among.n; j++) {
            own->state[j] = after[own->among.place[j]];
        }
    }
    nodes->state = (const double (*)[GYRO_N_STATES])part->state;
}

/* Adds a column of 2 n numbers so many times. */
static inline void add_column(int n, double times, const double *column, gyro_pair *to)
{
    for (int i = 0; i < n; i++) {
        to[i] = pair_sum(to[i], pair_scaled(times, pair_of(column[2 * i], column[2 * i + 1])));
    }
}

/* The difference after each of some pieces; room: that of a column, which the compiler is to know. */
static inline void pass_on(int room, traveller *at, const pieces_of_run *of, part_of_run *part)
{
    const gyro_run *run = of->run;
    const int n = at->moving.n, half = room / 2;
    double d[ROOM];
    memcpy(d, at->difference, sizeof d);
    for (int64_t piece = of->first; piece < of->last; piece++) {
        const double *p = run->passage + (run->shared ? run->part[piece] : piece) * n * room;
        const double *weight = run->weight + run->part[piece] * NODES * n * room;
        gyro_pair after[ROOM / 2];
        for (int i = 0; i < half; i++) {
            after[i] = both(0.0);
        }
        for (int j = 0; j < n; j++) {
            add_column(half, d[j], p + j * room, after);
        }
        for (int node = 0; node < NODES; node++) {
            const int64_t i = (piece - of->first) * NODES + node;
            const double *w = weight + node * n * room;
            add_column(half, part->force[i][0], w + GYRO_STATE_X_DOT * room, after);
            if (run->axes > 1) {
                add_column(half, part->force[i][1], w + GYRO_STATE_Y_DOT * room, after);
            }
            for (int k = 0; k < at->n_forced; k++) {
                const int j = at->forced[k];
                add_column(half, part->rate[i][at->moving.place[j]], w + j * room, after);
            }
        }
        for (int i = 0; i < half; i++) {
            d[2 * i] = lane_of(after[i], 0);
            d[2 * i + 1] = lane_of(after[i], 1);
        }
        memcpy(part->difference[piece - of->first], d, (size_t)n * sizeof *d);
    }
    memcpy(at->difference, d, sizeof d);
}

/* Rooms that a model of so many states may ask for. */
enum { EIGHT = ROOM < 8 ? ROOM : 8, TWELVE = ROOM < 12 ? ROOM : 12, SIXTEEN = ROOM < 16 ? ROOM : 16 };

static void pass_on_by_room(traveller *at, const pieces_of_run *of, part_of_run *part)
{
    const int64_t room = of->run->room;
    if (room == 4) {
        pass_on(4, at, of, part);
    } else if (room == EIGHT) {
        pass_on(EIGHT, at, of, part);
    } else if (room == TWELVE) {
        pass_on(TWELVE, at, of, part);
    } else if (room == SIXTEEN) {
        pass_on(SIXTEEN, at, of, part);
    } else {
        pass_on((int)room, at, of, part);
    }
}

/* Takes a traveller along some pieces. */
static void go_along(traveller *at, gyro_view *base, const pieces_of_run *of, part_of_run *part)
{
    const gyro_run *run = of->run;
    gyro_nodes nodes = {
        .run = run,
        .each = NODES,
        .lies = run->lies + of->first,
        .place = run->place + of->first * NODES,
        .n = (of->last - of->first) * NODES,
        .state = (const double (*)[GYRO_N_STATES])run->within + of->first * NODES,
        .rate = (const double (*)[GYRO_N_STATES])run->rate + of->first * NODES,
    };
    if (at->own.among.n > 0) {
        drive_own(at, base, of, &nodes, part);
    }
    find_forces(at, base, &nodes, part);
    pass_on_by_room(at, of, part);
}

/* Samples of a run: n from the first on, of which a part of it that began after so many pieces knows the differences. */
typedef struct {
    int64_t first;
    int64_t n;
    int64_t begin;
    part_of_run *part;
} samples_of_run;

static inline int64_t step_of_sample(const gyro_run *run, const samples_of_run *of, int64_t i) { return (of->first + i) * run->stride; }
static inline int64_t place_of_sample(const gyro_run *run, const samples_of_run *of, int64_t i) { return run->until[of->first + i] - of->begin - 1; }

/* The states of the run at a sample, and those that move beside. */
static void find_states(const traveller *at, const gyro_run *run, const samples_of_run *of, int64_t i, double state[GYRO_N_STATES])
{
    const double *own = of->part->own_after[place_of_sample(run, of, i)];
    memcpy(state, run->state + step_of_sample(run, of, i) * GYRO_N_STATES, GYRO_N_STATES * sizeof *state);
    for (int k = 0; k < at->own.among.n; k++) {
        const int place = at->own.among.place[k];
        state[place] = own[place];
    }
}

static void take_voltage(traveller *at, const gyro_run *run, const samples_of_run *of, int64_t i, double out[2])
{
    /* The inputs are those of the step before. */
    const int64_t step = step_of_sample(run, of, i), before = step > 0 ? step - 1 : 0;
    const double *base = run->voltage + 2 * step, *difference = of->part->difference[place_of_sample(run, of, i)];
    double state[GYRO_N_STATES];
    find_states(at, run, of, i, state);
    for (int k = 0; k < at->moving.n; k++) {
        state[at->moving.place[k]] += difference[k];
    }
    double voltage[2];
    find_voltage(at, run, before, (double)(step - before), state, voltage);
    out[0] = voltage[0] - base[0];
    out[1] = voltage[1] - base[1];
}

/* To first order; what forces the part of the run is overwritten. */
static void take_accelerations(traveller *at, gyro_view *base, const gyro_run *run, const samples_of_run *of, double (*out)[2])
{
    part_of_run *part = of->part;
    for (int64_t i = 0; i < of->n; i++) {
        const int64_t step = step_of_sample(run, of, i);
        const double *acceleration = run->acceleration + 2 * step;
        part->sample_lies[i] = step > 0 ? step - 1 : 0;
        part->sample_place[i] = step > 0 ? 1.0 : 0.0;
        find_states(at, run, of, i, part->sample_state[i]);
        memset(part->sample_rate[i], 0, sizeof part->sample_rate[i]);
        part->sample_rate[i][GYRO_STATE_X_DOT] = acceleration[0];
        part->sample_rate[i][GYRO_STATE_Y_DOT] = acceleration[1];
    }
    const gyro_nodes there = {
        .run = run,
        .each = 1,
        .lies = part->sample_lies,
        .place = part->sample_place,
        .n = of->n,
        .state = (const double (*)[GYRO_N_STATES])part->sample_state,
        .rate = (const double (*)[GYRO_N_STATES])part->sample_rate,
        .command = run->command ? run->command + 2 * of->first : NULL,
    };
    find_forces(at, base, &there, part);
    for (int64_t i = 0; i < of->n; i++) {
        const double *slope = run->slope + (run->even ? 0 : of->first + i) * 2 * run->moving;
        const double *difference = part->difference[place_of_sample(run, of, i)];
        gyro_pair sum = pair_of(part->force[i][0], part->force[i][1]);
        for (int k = 0; k < at->moving.n; k++) {
            sum = pair_sum(sum, pair_scaled(difference[k], pair_of(slope[2 * k], slope[2 * k + 1])));
        }
        out[i][0] = lane_of(sum, 0);
        out[i][1] = lane_of(sum, 1);
    }
}

/* A part of a column, at samples. */
static void take_differences(traveller *at, gyro_view *base, const gyro_run *run, const samples_of_run *of, int order, double (*out)[2])
{
    if (order == GYRO_OF_ACCELERATIONS) {
        take_accelerations(at, base, run, of, out);
    } else {
        for (int64_t i = 0; i < of->n; i++) {
            const double *difference = of->part->difference[place_of_sample(run, of, i)];
            if (order == GYRO_OF_VOLTAGE) {
                take_voltage(at, run, of, i, out[i]);
            } else {
                out[i][0] = difference[GYRO_STATE_X_DOT];
                out[i][1] = run->axes > 1 ? difference[GYRO_STATE_Y_DOT] : 0.0;
            }
        }
    }
}

/* Whether something changes the command on its way to the mass. */
static int is_mapped(const gyro_view *view)
{
    int mapped = 0;
    for (int i = 0; i < GYRO_N_ON_FORCE; i++) {
        mapped |= view->active[gyro_on_force[i]];
    }
    return mapped;
}

/* Finds which forces are others than those of the run, where both are at its start. */
static void compare_forces(traveller *at, const gyro_view *base)
{
    const gyro_view *view = &at->view;
    unsigned char other[GYRO_N_EFFECTS] = {0};
    for (int i = 0; i < GYRO_N_READS; i++) {
        const int effect = gyro_reads[i][0], vr = gyro_reads[i][1], command = vr == GYRO_U_X || vr == GYRO_U_Y;
        if (view->p[vr] != base->p[vr] || (command && at->maps)) {
            other[effect] = 1;
        }
    }
    at->n_added = at->n_left = 0;
    for (int i = 0; i < GYRO_N_FORCES; i++) {
        const int effect = gyro_forces[i];
        if (other[effect] || view->active[effect] != base->active[effect]) {
            at->added[at->n_added] = at->left[at->n_left] = effect;
            at->n_added += view->active[effect];
            at->n_left += base->active[effect];
        }
    }
}

/* Which states of the run, of those that effects add, have other rates: all where laws act, else those of forces that are not the same. */
static void find_forced(traveller *at, const gyro_run *run)
{
    at->n_forced = 0;
    for (int k = motion_of(run); k < at->moving.n; k++) {
        int other = at->lawful;
        for (int i = 0; i < at->n_added && !other; i++) {
            other = at->added[i] == gyro_owners[at->moving.place[k] - MOTION];
        }
        if (other) {
            at->forced[at->n_forced++] = k;
        }
    }
}

int gyro_depart(void *instance, const gyro_run *run, void *made)
{
    const gyro_instance *g = ((fmi_instance *)instance)->core;
    const gyro_view *base = &((const traveller *)run->base)->view;
    const int followed = is_run(run) && is_followed(g) && late_of(g, run) == run->late && states_of(base, &g->view).n == 0;
    if (followed) {
        traveller *at = made;
        set_off(g, at);
        at->lighter = at->view.inverse_mass / base->inverse_mass - 1.0;
        at->lawful = at->view.any_law || base->any_law;
        at->maps = is_mapped(&at->view) || is_mapped(base);
        at->moving = moving_of(base, run);
        at->own.among = states_of(&at->view, base);
        come_to(at, run, 0, 0.0);
        compare_forces(at, base);
        find_forced(at, run);
        for (int k = 0; k < at->moving.n; k++) {
            at->difference[k] = at->view.s[at->moving.place[k]] - run->state[at->moving.place[k]];
        }
        if (at->own.among.n > 0) {
            begin_own(at, run);
        }
    }
    return followed;
}

void gyro_vary(const gyro_run *run, int64_t n, void *const travellers[], int of, double *const columns[])
{
    gyro_view base = ((const traveller *)run->base)->view;
    part_of_run part;
    for (int64_t i = 0; i < n; i++) {
        traveller *at = travellers[i];
        const samples_of_run start = {0, 1, -1, &part};
        memcpy(part.difference[0], at->difference, sizeof part.difference[0]);
        for (int k = 0; k < at->own.among.n; k++) {
            part.own_after[0][at->own.among.place[k]] = at->own.state[k];
        }
        take_differences(at, &base, run, &start, of, (double (*)[2])columns[i]);
    }
    /* All along a part of the run before any goes on, so that it stays near the processor. */
    const int64_t n_samples = run->steps / run->stride + 1, n_pieces = run->until[n_samples - 1];
    int64_t sample = 1;
    for (int64_t first = 0; first < n_pieces; first += TOGETHER) {
        const pieces_of_run pieces = {run, first, first + TOGETHER < n_pieces ? first + TOGETHER : n_pieces};
        samples_of_run samples = {sample, 0, first, &part};
        while (samples.first + samples.n < n_samples && run->until[samples.first + samples.n] <= pieces.last) {
            samples.n++;
        }
        for (int64_t i = 0; i < n; i++) {
            go_along(travellers[i], &base, &pieces, &part);
            take_differences(travellers[i], &base, run, &samples, of, (double (*)[2])(columns[i] + 2 * sample));
        }
        sample += samples.n;
    }
}

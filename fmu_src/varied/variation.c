/* The variation of a motion: what other parameters add to a run, to first order in what they add to its states.

   With the motion s of the run, its rates f and those f* of the other parameters, the difference d obeys

       d' = J d + f*(s) - f(s),   J = df/ds,

   so that no other motion need be found: a step is s, f and J at two nodes of Gauss. J passes d on by the exponential of Magnus' series with two
   terms; the difference of the rates is the line through the nodes, whose exponential integral is tabulated for the mean of J. Both are of fourth
   order (A. Iserles, H. Z. Munthe-Kaas, S. P. Norsett, A. Zanna, Lie-group methods, Acta Numerica 9, 2000, sections 4 and 5). Voltages follow from
   s + d as those of the FMU do. */

#include "variation.h"

#include <string.h>

#include "fmi_common.h"
#include "generated/tangent.h"
#include "hermite.h"
#include "linear.h"
#include "plant.h"

enum { MOTION = GYRO_STATE_Y_DOT + 1, OWN = GYRO_N_STATES - MOTION, NODES = 2, MOST = OWN > MOTION ? OWN : MOTION };

/* Parts of a step at which the nodes lie, 1/2 -+ sqrt(3)/6. */
static const double PLACE[NODES] = {0.21132486540518713, 0.7886751345948129};

/* The line that is 1 at a node and 0 at the other: at the start of a step, and how it rises over it. */
static const double LINE[NODES][2] = {{1.3660254037844386, -1.7320508075688772}, {-0.3660254037844386, 1.7320508075688772}};

/* Times h^2 the commutator's weight, sqrt(3)/12. */
static const double TURNED = 0.14433756729740643;

/* Size of the first term that a passage leaves out: over a million steps all of them make 1e-5. */
static const double PASSAGE_LEAVES = 1e-11;

/* Terms of a series whose size is not known: enough for a mode at ten times the rate of the steps. */
enum { TERMS = 200 };

/* Steps that all columns go before the next: 300 bytes each. */
enum { TOGETHER = 512 };

typedef struct {
    double of[MOST][MOST];
} matrix;

static inline matrix matrix_product(int n, const matrix *a, const matrix *b)
{
    matrix c = {{{0.0}}};
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            double sum = 0.0;
            for (int k = 0; k < n; k++) {
                sum += a->of[i][k] * b->of[k][j];
            }
            c.of[i][j] = sum;
        }
    }
    return c;
}

static inline void add_scaled(int n, double factor, const matrix *a, matrix *to)
{
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            to->of[i][j] += factor * a->of[i][j];
        }
    }
}

static inline matrix matrix_of(int n, double diagonal)
{
    matrix made = {{{0.0}}};
    for (int i = 0; i < n; i++) {
        made.of[i][i] = diagonal;
    }
    return made;
}

/* exp(a) by so many terms; a [units of n states]. */
static inline matrix matrix_exponential(int n, const matrix *a, int terms)
{
    matrix power = matrix_of(n, 1.0), sum = power;
    for (int k = 1; k <= terms; k++) {
        const matrix next = matrix_product(n, &power, a);
        power = matrix_of(n, 0.0);
        add_scaled(n, 1.0 / k, &next, &power);
        add_scaled(n, 1.0, &power, &sum);
    }
    return sum;
}

/* What states that move by a d + g(t) pass on over a part of a step, and what g at the step's nodes adds. */
typedef struct {
    matrix passage;
    matrix weight[NODES]; /* s */
} passing;

/* For a `part` of a step h [s]; a [1/s in the units of n states]. */
static passing passing_of(int n, const matrix *a, double h, double part)
{
    const double end = part * h;
    matrix scaled = matrix_of(n, 0.0);
    add_scaled(n, end, a, &scaled);
    passing made;
    made.passage = matrix_exponential(n, &scaled, TERMS);
    for (int node = 0; node < NODES; node++) {
        made.weight[node] = matrix_of(n, 0.0);
    }
    for (int j = 0; j < 2; j++) {
        /* The integral of exp(a (end - t)) (t/h)^j is the sum of a^r end^(r + 1) part^j/(r + 1)...(r + j + 1). */
        matrix power = matrix_of(n, j == 0 ? end : 0.5 * end * part), sum = matrix_of(n, 0.0);
        for (int r = 0; r < TERMS; r++) {
            add_scaled(n, 1.0, &power, &sum);
            const matrix next = matrix_product(n, &power, &scaled);
            power = matrix_of(n, 0.0);
            add_scaled(n, 1.0 / (r + j + 2), &next, &power);
        }
        for (int node = 0; node < NODES; node++) {
            add_scaled(n, LINE[node][j], &sum, &made.weight[node]);
        }
    }
    return made;
}

/* The states that effects add, of which a small force on the motion comes: linear, driven by the motion of the run. */
typedef struct {
    passing to[NODES]; /* the nodes of a step */
    passing whole;
    double state[MOST];
} driven;

/* A view of an instance that is taken along a run. */
typedef struct {
    gyro_view view;
    double value[GYRO_N_VARIABLES]; /* as set, SI */
    double event[GYRO_N_EFFECTS];   /* when each effect switches, s */
    double difference[MOTION];      /* of its motion and that of the run, SI */
    driven own;                     /* where a force with states acts */
} traveller;

/* Whether the sizes of a run can be those of one, and its inputs are inputs. */
static int is_run(const gyro_run *run)
{
    int good = run->steps >= 0 && run->stride >= 1 && run->n_inputs >= 0 && run->n_inputs <= GYRO_N_INPUTS;
    for (int64_t i = 0; good && i < run->n_inputs; i++) {
        good = run->inputs[i] < GYRO_N_INPUTS;
    }
    return good;
}

/* 0 where something acts that carries more than the states from step to step, or acts between them. */
static int is_followed(const gyro_instance *g)
{
    int lagging = 0;
    for (int i = 0; i < GYRO_N_LAGGING; i++) {
        lagging |= g->view.active[follow_effects[i]];
    }
    return !(g->plan.any_delay || g->plan.any_lag || g->view.any_memory || g->view.any_impulse || g->view.any_rate || lagging);
}

static void set_off(const gyro_instance *g, traveller *at)
{
    at->view = g->view;
    memcpy(at->value, g->value, sizeof at->value);
    for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
        at->event[effect] = INFINITY;
    }
    event_times(&at->view, at->event);
}

/* The force in the view, as its parameters are. */
static void bring_command(traveller *at)
{
    at->view.u[0] = at->value[GYRO_U_X];
    at->view.u[1] = at->value[GYRO_U_Y];
    actuate(&at->view);
}

/* Inputs and events of a step; an event within it counts from its nearer end. */
static void come_to(traveller *at, const gyro_run *run, int64_t step)
{
    gyro_view *view = &at->view;
    const double *values = run->values + step * run->n_inputs, middle = run->start + ((double)step + 0.5) * run->step;
    for (int64_t i = 0; i < run->n_inputs; i++) {
        at->value[run->inputs[i]] = values[i];
        view->p[run->inputs[i]] = values[i];
    }
    if (view->any_law) {
        for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
            view->after[effect] = middle >= at->event[effect] ? 1.0 : 0.0;
        }
    } else {
        take_made(view, at->value);
        bring_command(at);
    }
}

/* The view at a part of a step, in a state of the motion. */
static void look_from(traveller *at, const gyro_run *run, int64_t step, double part, const double state[MOTION])
{
    gyro_view *view = &at->view;
    memcpy(view->s, state, MOTION * sizeof *state);
    if (view->any_law) {
        view->t = run->start + ((double)step + part) * run->step;
        view->since = part * run->step;
        apply_laws(view, at->value);
        bring_command(at);
    } else if (view->any_map) {
        /* The voltage may go with time. */
        view->t = run->start + ((double)step + part) * run->step;
    }
}

/* The rates of both speeds at a part of a step. */
static void find_rates(traveller *at, const gyro_run *run, int64_t step, double part, const double state[MOTION], double found[2])
{
    double rate[GYRO_N_STATES];
    look_from(at, run, step, part, state);
    state_rate(&at->view, rate);
    found[0] = rate[GYRO_STATE_X_DOT];
    found[1] = rate[GYRO_STATE_Y_DOT];
}

/* The motion at the nodes of a step from its ends, shape (2, 4): displacements by quintics, speeds by cubics. rate shape (2, 2): of the speeds, by
   end and axis. */
static void find_motion(const gyro_run *run, int64_t step, double rate[2][2])
{
    const double *a = run->state + step * MOTION, *b = a + MOTION, h = run->step;
    double *motion = run->motion + step * NODES * MOTION;
    for (int node = 0; node < NODES; node++) {
        for (int axis = 0; axis < 2; axis++) {
            const int x = 2 * axis, v = x + 1;
            const gyro_jet from = {a[x], a[v], rate[0][axis]}, to = {b[x], b[v], rate[1][axis]};
            motion[node * MOTION + x] = quintic(from, to, h, PLACE[node]);
            motion[node * MOTION + v] = cubic(a[v], rate[0][axis], b[v], rate[1][axis], h, PLACE[node]);
        }
    }
}

/* How the rates of the motion go with its states, in the view as it is. */
static void find_slope(const gyro_view *view, matrix *slope)
{
    double rate[GYRO_N_STATES];
    gyro_tangent along;
    memset(&along, 0, sizeof along);
    for (int j = 0; j < MOTION; j++) {
        along.s[j] = 1.0;
        tangent_rate(view, &along, rate);
        along.s[j] = 0.0;
        for (int i = 0; i < MOTION; i++) {
            slope->of[i][j] = rate[i];
        }
    }
}

/* The exponent by which a step h [s] passes differences on, and its exponential. */
static matrix exponent(const matrix slope[NODES], double h)
{
    matrix sum = matrix_of(MOTION, 0.0);
    add_scaled(MOTION, 0.5 * h, &slope[0], &sum);
    add_scaled(MOTION, 0.5 * h, &slope[1], &sum);
    const matrix forth = matrix_product(MOTION, &slope[0], &slope[1]), back = matrix_product(MOTION, &slope[1], &slope[0]);
    add_scaled(MOTION, -TURNED * h * h, &forth, &sum);
    add_scaled(MOTION, TURNED * h * h, &back, &sum);
    return sum;
}

static matrix passage_of(const matrix *exponents, double h)
{
    double slopes[2][4];
    for (int axis = 0; axis < 2; axis++) {
        for (int j = 0; j < 4; j++) {
            slopes[axis][j] = exponents->of[2 * axis + 1][j] / h;
        }
    }
    const double size = h * bound_of(slopes, 1.0);
    int terms = 1;
    for (double left = 0.5 * size * size; left > PASSAGE_LEAVES && terms < TERMS; left *= size / (terms + 1)) {
        terms++;
    }
    return matrix_exponential(MOTION, exponents, terms);
}

/* Whether a step has the slopes of the one before, wherever the motion is: nothing bends it and no input but the force is new. */
static int is_alike(const gyro_view *view, const gyro_run *run, int64_t step)
{
    int alike = step > 0 && !view->any_curved && !view->any_law;
    const double *now = run->values + step * run->n_inputs;
    for (int64_t i = 0; i < run->n_inputs && alike; i++) {
        const uint32_t vr = run->inputs[i];
        alike = vr == GYRO_U_X || vr == GYRO_U_Y || now[i] == now[i - run->n_inputs];
    }
    return alike;
}

/* Rates, slopes and passages of a run whose states are known. */
static void linearise(const gyro_instance *g, const gyro_run *run)
{
    traveller at;
    matrix mean = matrix_of(MOTION, 0.0), exponents = mean, passage = mean;
    set_off(g, &at);
    for (int64_t step = 0; step < run->steps; step++) {
        const double *start = run->state + step * MOTION, *motion = run->motion + step * NODES * MOTION;
        const int alike = is_alike(&at.view, run, step);
        double rate[2][2];
        matrix slope[NODES];
        come_to(&at, run, step);
        find_rates(&at, run, step, 0.0, start, rate[0]);
        find_rates(&at, run, step, 1.0, start + MOTION, rate[1]);
        find_motion(run, step, rate);
        for (int node = 0; node < NODES; node++) {
            find_rates(&at, run, step, PLACE[node], motion + node * MOTION, run->rate + (step * NODES + node) * 2);
            if (!alike) {
                find_slope(&at.view, &slope[node]);
            }
        }
        if (!alike) {
            exponents = exponent(slope, run->step);
            passage = passage_of(&exponents, run->step);
        }
        add_scaled(MOTION, 1.0 / (run->step * (double)run->steps), &exponents, &mean);
        for (int i = 0; i < MOTION; i++) {
            memcpy(run->passage + (step * MOTION + i) * MOTION, passage.of[i], MOTION * sizeof(double));
        }
    }
    const passing whole = passing_of(MOTION, &mean, run->step, 1.0);
    for (int node = 0; node < NODES; node++) {
        for (int i = 0; i < MOTION; i++) {
            run->weight[(node * MOTION + i) * 2] = whole.weight[node].of[i][GYRO_STATE_X_DOT];
            run->weight[(node * MOTION + i) * 2 + 1] = whole.weight[node].of[i][GYRO_STATE_Y_DOT];
        }
    }
}

int gyro_follow(void *instance, const gyro_run *run)
{
    fmi_instance *f = instance;
    gyro_instance *g = f->core;
    const size_t n = (size_t)run->n_inputs;
    int followed = is_run(run) && is_followed(g) && !g->view.any_state;
    if (followed) {
        memcpy(run->state, g->view.s, MOTION * sizeof(double));
        memcpy(run->voltage, g->memory.sample, sizeof g->memory.sample);
    }
    for (int64_t step = 0; step < run->steps && followed; step++) {
        const double *values = run->values + step * run->n_inputs, from = run->start + (double)step * run->step;
        followed = fmi_set(f, "gyro_follow", GYRO_REAL, run->inputs, n, values, n) == FMI_OK && fmi_step(f, "gyro_follow", from, run->step) == FMI_OK;
        memcpy(run->state + (step + 1) * MOTION, g->view.s, MOTION * sizeof(double));
        memcpy(run->voltage + 2 * (step + 1), g->memory.sample, sizeof g->memory.sample);
    }
    if (followed) {
        linearise(g, run);
    }
    return followed;
}

static void set_own(gyro_view *view, const double own[])
{
    for (int i = 0; i < OWN; i++) {
        view->s[MOTION + i] = own[i];
    }
}

static void begin_own(traveller *at, const gyro_run *run)
{
    driven *own = &at->own;
    double rest[GYRO_N_STATES], rate[GYRO_N_STATES], one[MOST] = {0.0};
    matrix slope = matrix_of(OWN, 0.0);
    come_to(at, run, 0);
    look_from(at, run, 0, 0.0, run->state);
    set_own(&at->view, one);
    state_rate(&at->view, rest);
    for (int j = 0; j < OWN; j++) {
        one[j] = 1.0;
        set_own(&at->view, one);
        one[j] = 0.0;
        state_rate(&at->view, rate);
        for (int i = 0; i < OWN; i++) {
            slope.of[i][j] = rate[MOTION + i] - rest[MOTION + i];
        }
    }
    for (int node = 0; node < NODES; node++) {
        own->to[node] = passing_of(OWN, &slope, run->step, PLACE[node]);
    }
    own->whole = passing_of(OWN, &slope, run->step, 1.0);
    memset(own->state, 0, sizeof own->state);
}

static void pass_own(const passing *over, const double before[], double forcing[NODES][MOST], double after[])
{
    for (int i = 0; i < OWN; i++) {
        double sum = 0.0;
        for (int j = 0; j < OWN; j++) {
            sum += over->passage.of[i][j] * before[j];
            for (int node = 0; node < NODES; node++) {
                sum += over->weight[node].of[i][j] * forcing[node][j];
            }
        }
        after[i] = sum;
    }
}

/* Own states at the nodes of a step, from what drives them there, and at its end, which stay. */
static void drive_own(traveller *at, const gyro_run *run, int64_t step, double found[NODES][MOST])
{
    driven *own = &at->own;
    static const double none[MOST] = {0.0};
    double rate[GYRO_N_STATES], forcing[NODES][MOST], end[MOST] = {0.0};
    for (int node = 0; node < NODES; node++) {
        look_from(at, run, step, PLACE[node], run->motion + (step * NODES + node) * MOTION);
        set_own(&at->view, none);
        state_rate(&at->view, rate);
        for (int i = 0; i < OWN; i++) {
            forcing[node][i] = rate[MOTION + i];
        }
    }
    for (int node = 0; node < NODES; node++) {
        pass_own(&own->to[node], own->state, forcing, found[node]);
    }
    pass_own(&own->whole, own->state, forcing, end);
    memcpy(own->state, end, sizeof end);
}

/* What a step makes of the difference. */
static void vary_step(traveller *at, const gyro_run *run, int64_t step)
{
    const double *passage = run->passage + step * MOTION * MOTION, *difference = at->difference;
    const int driven_too = at->view.any_state;
    double states[NODES][MOST], rate[GYRO_N_STATES], after[MOTION];
    come_to(at, run, step);
    if (driven_too) {
        drive_own(at, run, step, states);
    }
    for (int i = 0; i < MOTION; i++) {
        after[i] = passage[4 * i] * difference[0] + passage[4 * i + 1] * difference[1] + passage[4 * i + 2] * difference[2] +
                   passage[4 * i + 3] * difference[3];
    }
    for (int node = 0; node < NODES; node++) {
        const double *base = run->rate + (step * NODES + node) * 2, *weight = run->weight + node * MOTION * 2;
        look_from(at, run, step, PLACE[node], run->motion + (step * NODES + node) * MOTION);
        if (driven_too) {
            set_own(&at->view, states[node]);
        }
        state_rate(&at->view, rate);
        const double x = rate[GYRO_STATE_X_DOT] - base[0], y = rate[GYRO_STATE_Y_DOT] - base[1];
        for (int i = 0; i < MOTION; i++) {
            after[i] += weight[2 * i] * x + weight[2 * i + 1] * y;
        }
    }
    memcpy(at->difference, after, sizeof after);
}

/* A sample's part of the column, after `step` steps of which the view has the inputs of the last. */
static void take_difference(traveller *at, const gyro_run *run, int64_t step, int speeds, double out[2])
{
    if (speeds) {
        out[0] = at->difference[GYRO_STATE_X_DOT];
        out[1] = at->difference[GYRO_STATE_Y_DOT];
    } else {
        gyro_view *view = &at->view;
        const double *base = run->voltage + 2 * step;
        double state[MOTION];
        for (int i = 0; i < MOTION; i++) {
            state[i] = run->state[step * MOTION + i] + at->difference[i];
        }
        look_from(at, run, step - 1, 1.0, state);
        pick_off(view);
        amplify(view);
        convert(view);
        out[0] = view->v[0] - base[0];
        out[1] = view->v[1] - base[1];
    }
}

int64_t gyro_traveller_size(void) { return (int64_t)sizeof(traveller); }

int gyro_depart(void *instance, const gyro_run *run, void *made)
{
    const gyro_instance *g = ((fmi_instance *)instance)->core;
    const int followed = is_run(run) && is_followed(g);
    if (followed) {
        traveller *at = made;
        set_off(g, at);
        for (int i = 0; i < MOTION; i++) {
            at->difference[i] = at->view.s[i] - run->state[i];
        }
        if (at->view.any_state) {
            begin_own(at, run);
        }
        come_to(at, run, 0);
    }
    return followed;
}

void gyro_vary(const gyro_run *run, int64_t n, void *const travellers[], int speeds, double *const columns[])
{
    for (int64_t i = 0; i < n; i++) {
        take_difference(travellers[i], run, 0, speeds, columns[i]);
    }
    /* All along a part of the run before any goes on, so that it stays near the processor. */
    for (int64_t first = 0; first < run->steps; first += TOGETHER) {
        const int64_t last = first + TOGETHER < run->steps ? first + TOGETHER : run->steps;
        for (int64_t i = 0; i < n; i++) {
            for (int64_t step = first; step < last; step++) {
                vary_step(travellers[i], run, step);
                if ((step + 1) % run->stride == 0) {
                    take_difference(travellers[i], run, step + 1, speeds, columns[i] + 2 * ((step + 1) / run->stride));
                }
            }
        }
    }
}

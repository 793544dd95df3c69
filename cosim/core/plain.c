/* An observer that knows springs, dampers and a held force only, on a device of which the loop knows more: what is known beyond them is taken out of
   force and voltage before the observer sees them, and its innovations are watched from outside. */

#include "loop.h"

#include "known_model.h"

#define KEPT 16384    /* commands; a power of two */
#define NEWTON 6      /* steps in which the pickoff's curve is inverted */
#define REFORM 200    /* samples between two looks at the estimated constants */

typedef struct {
    observer_function inner;
    void *inner_memory;
    known k;
    motion m, held;     /* as it is, and with the mean force held over the whole period */
    double u[KEPT][2];
    double past[2][2];  /* voltages behind the lag, one and two samples ago [V] */
    double pace;        /* share of one sample in the running means */
    double chi2, white[2], last[2];
    int64_t count;
} plain;

static const double *command(const plain *o, int64_t sample) { return o->u[(sample > 0 ? sample : 0) & (KEPT - 1)]; }

/* The force at the mass over the last period: its mean, and what its change within the period moved the mass by beside that [m]. */
static void mean_force(const plain *o, const double *s, double mean[2], double aside[2])
{
    double before[2], after[2];
    const double share = o->m.delay_rest / o->m.period, inverse_mass = o->k.p[INVERSE_MASS];
    known_actuate(&o->k, s, command(o, o->count - 2 - o->m.delay_samples), 0.0, before);
    known_actuate(&o->k, s, command(o, o->count - 1 - o->m.delay_samples), 0.0, after);
    for (int i = 0; i < 2; i++) {
        mean[i] = share * before[i] + (1.0 - share) * after[i];
        aside[i] = -0.5 * inverse_mass * o->m.period * o->m.period * share * (1.0 - share) * after[i];
    }
}

/* The voltage that springs and dampers alone would give: the sample without what the amplifier and the pickoff's curve do to it. */
static void undo_sensing(plain *o, const double v[2], const double force[2], const double aside[2], double *s, double out[2])
{
    const double none[2] = {0.0, 0.0};
    double l[2] = {v[0], v[1]}, e[2], by_s[2 * NS], nominal[2 * NS], rest[NS] = {0};
    known_amplify(&o->k, s, v, 0.0, e);
    for (int a = 0; a < 2; a++) {
        l[a] = 2.0 * v[a] - e[a]; /* what the amplifier adds does not depend on the signal */
        const double slope = o->count > 2 ? (3.0 * l[a] - 4.0 * o->past[0][a] + o->past[1][a]) / (2.0 * o->m.period) : 0.0;
        o->past[1][a] = o->past[0][a];
        o->past[0][a] = l[a];
        l[a] += o->m.lag * slope;
    }
    for (int i = 0; i < NEWTON; i++) {
        known_pick_off(&o->k, s, force, 0.0, e);
        known_pick_off_by_state(&o->k, s, force, 0.0, by_s);
        const double det = by_s[0] * by_s[NS + 2] - by_s[2] * by_s[NS];
        e[0] = l[0] - e[0];
        e[1] = l[1] - e[1];
        s[0] += (by_s[NS + 2] * e[0] - by_s[2] * e[1]) / det;
        s[2] += (by_s[0] * e[1] - by_s[NS] * e[0]) / det;
    }
    known_pick_off_by_state(&o->k, rest, none, 0.0, nominal);
    out[0] = nominal[0] * (s[0] - aside[0]);
    out[1] = nominal[NS + 2] * (s[2] - aside[1]);
}

/* The innovation that the last estimate implies for this sample, over its variance. */
static void watch(plain *o, const double force[2], const double v[2], const double *estimate, const double *deviation)
{
    const double none[2] = {0.0, 0.0};
    double C[2 * NS], noise[2], rest[NS] = {0}, s[NS];
    passage way;
    known_pick_off_by_state(&o->k, rest, none, 0.0, C);
    known_noise(&o->k, estimate, none, 0.0, noise);
    memset(s, 0, sizeof s);
    memcpy(s, estimate, 4 * sizeof *s);
    motion_move(&o->held.pieces[1], &o->k, estimate[4] - o->held.omega_z, estimate[4], force, s, &way);
    double total = 0.0;
    for (int a = 0; a < 2; a++) {
        const double gain = C[NS * a + 2 * a], e = v[a] - gain * way.end[2 * a];
        const double spread = gain * (deviation[2 * a] + o->m.period * deviation[2 * a + 1]);
        const double r = e / sqrt(noise[a] + spread * spread);
        total += 0.5 * r * r;
        o->white[a] += o->pace * (r * o->last[a] - o->white[a]);
        o->last[a] = r;
    }
    o->chi2 += o->pace * (total - o->chi2);
}

size_t plain_size(void) { return sizeof(plain); }

void plain_start(void *memory, void *inner, void *inner_memory, const double *known_values, double period)
{
    plain *o = memory;
    memset(o, 0, sizeof *o);
    memcpy(&o->inner, &inner, sizeof inner);
    o->inner_memory = inner_memory;
    memcpy(o->k.c, known_values, NC * sizeof *known_values);
    o->m.period = period;
    o->pace = smaller(1.0, period / 0.005);
    o->chi2 = 1e6;
}

void plain_step(void *memory, const double u[2], const double v[2], const double in[IN], double *estimate, double *deviation)
{
    plain *o = memory;
    const double none[2] = {0.0, 0.0};
    double force[2] = {0.0, 0.0}, aside[2] = {0.0, 0.0}, seen[2], s[NS] = {0};
    memcpy(o->k.in, in, sizeof o->k.in);
    o->k.t = (double)o->count * o->m.period;
    if (o->count > 0) {
        memcpy(o->u[(o->count - 1) & (KEPT - 1)], u, 2 * sizeof *u);
    }
    if (o->count % REFORM == 1) {
        known_coordinates(&o->k, estimate + ESTIMATE_KXX, none, 0.0, o->k.p);
        motion_form(&o->m, &o->k, estimate[4], o->m.period);
        motion_form_held(&o->held, &o->k, estimate[4], o->m.period);
    }
    memcpy(s, estimate, 4 * sizeof *s);
    if (o->count > 0) {
        mean_force(o, s, force, aside);
    }
    undo_sensing(o, v, force, aside, s, seen);
    if (o->count > 1) {
        watch(o, force, seen, estimate, deviation);
    }
    o->inner(o->inner_memory, force, seen, in, estimate, deviation);
    o->count++;
}

void plain_found(const void *memory, double *chi2, double white[2])
{
    const plain *o = memory;
    *chi2 = o->chi2;
    memcpy(white, o->white, sizeof o->white);
}

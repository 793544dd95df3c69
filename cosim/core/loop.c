#include "loop.h"

#include "drift.h"
#include "known_model.h"
#include "stray.h"
#include "unseen.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
#define FIT_TRUSTED 20.0 /* mean squared innovation of a start whose constants may be used */
#define HEALTH_SIZE 13
#define DRIFT_SIZE 4
#define FMI_WORST_USABLE 1 /* OK or warning */

/* An observer of the model that the loop knows. */
static void write_estimate(const filter *f, double *estimate, double *deviation)
{
    memcpy(estimate, f->now.z, 5 * sizeof *estimate);
    estimate[4] = f->now.z[OMEGA];
    for (int i = 4; i < NS; i++) {
        estimate[ESTIMATE_SIZE - NS + i] = f->now.z[i];
    }
    if (!f->fresh && f->sample > 0) {
        return;
    }
    double values[NP], slopes[NP * NP];
    known_values(&f->k, f->now.z, f->now.z, 0.0, values);
    known_values_by_parameter(&f->k, f->now.z, f->now.z, 0.0, slopes);
    for (int i = 0; i < NP; i++) {
        double variance = 0.0;
        for (int j = 0; j < NP; j++) {
            double sum = 0.0;
            for (int q = 0; q <= j; q++) {
                sum += slopes[i * NP + q] * f->W_now[q][j];
            }
            variance += sum * sum;
        }
        estimate[ESTIMATE_KXX + i] = values[i];
        /* A start that does not fit yet knows nothing, whatever its rows say. */
        deviation[ESTIMATE_KXX + i] = f->growing && !(f->fit < FIT_TRUSTED) ? HUGE_VAL : sqrt(variance);
    }
    for (int i = 0; i < NS + 1; i++) {
        double total = f->now.P[i][i];
        for (int j = 0; j < NP; j++) {
            double sum = 0.0;
            for (int q = 0; q <= j; q++) {
                sum += f->now.Y[i][q] * f->W_now[q][j];
            }
            total += sum * sum;
        }
        const int place = i < 4 ? i : i == OMEGA ? 4 : ESTIMATE_SIZE - NS + i;
        deviation[place] = sqrt(total);
    }
}

EXPORT void core_filter_step(void *memory, const double u[2], const double v[2], const double in[IN], double *estimate, double *deviation)
{
    filter *f = memory;
    filter_step(f, u, v, in);
    write_estimate(f, estimate, deviation);
}

EXPORT void core_foucault_step(void *memory, double t, const double *estimate, const double *deviation, const double in[IN], double *control)
{
    foucault *c = memory;
    foucault_output out;
    (void)t;
    foucault_step(c, estimate, deviation, in, &out);
    memcpy(control, out.u, sizeof out.u);
    memcpy(control + 2, out.forced, sizeof out.forced);
    control[6] = out.omega_squared;
    control[7] = out.turned;
    memcpy(control + 8, out.near, sizeof out.near);
    control[12] = out.lacking;
    control[13] = out.own_rate;
    control[14] = out.behind;
}

EXPORT size_t core_filter_size(void) { return sizeof(filter); }
EXPORT size_t core_foucault_size(void) { return sizeof(foucault); }
EXPORT size_t core_plain_size(void) { return plain_size(); }
EXPORT void core_plain_start(void *memory, void *inner, void *inner_memory, const double *known_values, double period)
{
    plain_start(memory, inner, inner_memory, known_values, period);
}
EXPORT void core_plain_step(void *memory, const double u[2], const double v[2], const double in[IN], double *estimate, double *deviation)
{
    plain_step(memory, u, v, in, estimate, deviation);
}
EXPORT void core_plain_found(const void *memory, double *chi2, double white[2]) { plain_found(memory, chi2, white); }
EXPORT size_t core_loop_size(void) { return sizeof(loop); }

EXPORT void core_filter_start(void *memory, const double *settings, const double *known_values, const double *z, const double *dz, const double *p,
                              const double *W, const double *lowest, double period)
{
    filter_settings s;
    memcpy(&s, settings, sizeof s);
    filter_start(memory, &s, known_values, z, dz, p, W, lowest, period);
}

EXPORT void core_foucault_start(void *memory, const double *settings, const double *known_values, double period)
{
    foucault_settings s;
    memcpy(&s, settings, sizeof s);
    foucault_start(memory, &s, known_values, period);
}

/* What a filter has found: p [NP], W [NP * NP] row by row, and its health: chi2, neighbours of either axis, time of the last restart [s], restarts
   lately, walk of the rate, share of the innovation's variance that p explains, fastest forgetting, product of neighbours that pink noise makes,
   mean squared innovation that the last whole start left, infinite where it ended beside its fit or is not over, variance of what the pattern has
   strayed by, innovation [V], rms. */
EXPORT void core_filter_found(const void *memory, double *p, double *W, double *health)
{
    const filter *f = memory;
    memcpy(p, f->k.p, sizeof f->k.p);
    memcpy(W, f->W_now, sizeof f->W_now);
    double forget = 0.0;
    for (int i = 0; i < NP; i++) {
        forget = larger(forget, f->forget[i]);
    }
    const double values[HEALTH_SIZE] = {f->chi2, f->white[0], f->white[1], f->restarted_at, f->restarts, f->walk, f->share, forget, f->pink[0], f->pink[1],
                                        f->left, f->strayed, sqrt(larger(f->chi2, 0.0) / (0.5 * (f->inverse[0] + f->inverse[1])))};
    memcpy(health, values, sizeof values);
}

static void write_drift(drift_sizes found, double sizes[DRIFT_SIZE])
{
    const double values[DRIFT_SIZE] = {found.turning, found.turning_now, found.bending, 0.0};
    memcpy(sizes, values, sizeof values);
}

/* Standard deviations of the pattern, which stands at phi [rad], that come of what is not known of p: sizes [DRIFT_SIZE], the turning at the worst
   angle and at phi [rad/s], the bending [rad], and of the turning at the worst angle that part which comes of what no sample shows [rad/s]. */
EXPORT void core_filter_drift(const void *memory, double stiffness, double phi, double sizes[DRIFT_SIZE])
{
    const filter *f = memory;
    double W[NP][NP];
    memcpy(W, f->W_now, sizeof W);
    write_drift(drift_deviation(&f->k, W, stiffness, phi), sizes);
    if (f->unseen_count > 0) {
        unseen_columns(f, W);
        sizes[3] = drift_deviation(&f->k, W, stiffness, phi).turning;
    }
}

/* The same for estimates [ESTIMATE_SIZE] with independent deviations, of a device with `known_values`. */
EXPORT void core_estimate_drift(const double *known_values, const double *estimate, const double *deviation, const double *in, double stiffness,
                                double phi, double sizes[DRIFT_SIZE])
{
    known k, near;
    double W[NP][NP], moved[NP];
    const double none[2] = {0.0, 0.0};
    memset(&k, 0, sizeof k);
    memcpy(k.c, known_values, NC * sizeof *known_values);
    memcpy(k.in, in, sizeof k.in);
    known_coordinates(&k, estimate + ESTIMATE_KXX, none, 0.0, k.p);
    near = k;
    memcpy(moved, estimate + ESTIMATE_KXX, sizeof moved);
    for (int j = 0; j < NP; j++) {
        moved[j] += deviation[ESTIMATE_KXX + j];
        known_coordinates(&k, moved, none, 0.0, near.p);
        moved[j] = estimate[ESTIMATE_KXX + j];
        for (int i = 0; i < NP; i++) {
            W[i][j] = near.p[i] - k.p[i];
        }
    }
    write_drift(drift_deviation(&k, W, stiffness, phi), sizes);
}

/* What the device as it is turns by where the loop takes it for `taken` (values [NP], SI): rate [3] and bend [3] as in drift.h. */
EXPORT void core_drift_of(const double *known_values, const double *values, const double *taken, const double *in, double stiffness, double *rate,
                          double *bend)
{
    known k, other;
    const double none[2] = {0.0, 0.0};
    memset(&k, 0, sizeof k);
    memcpy(k.c, known_values, NC * sizeof *known_values);
    memcpy(k.in, in, sizeof k.in);
    other = k;
    known_coordinates(&k, values, none, 0.0, k.p);
    known_coordinates(&other, taken, none, 0.0, other.p);
    drift_of(&k, &other, stiffness, rate, bend);
}

/* The slopes by which z answers to p [NZ * NP], and the covariance of z for given p [NZ * NZ]. */
EXPORT void core_filter_slopes(const void *memory, double *Y, double *P)
{
    const filter *f = memory;
    for (int i = 0; i < NZ; i++) {
        memcpy(Y + i * NP, f->now.Y[i], NP * sizeof *Y);
        memcpy(P + i * NZ, f->now.P[i], NZ * sizeof *P);
    }
}

EXPORT void core_filter_told(void *memory, int64_t count, const double *u, const double *z_true, const double *in)
{
    filter *f = memory;
    for (int64_t k = 0; k < count; k++) {
        filter_step_told(f, u + 2 * k, z_true + (NS + 1) * k, in + IN * k);
    }
}

EXPORT void core_loop_start(loop *l, void *instance, void *set, void *step, void *get, const uint32_t *inputs, const uint32_t *outputs,
                            void *observer, void *observer_memory, void *controller, void *controller_memory, const double *known_values,
                            double period, const double *lag)
{
    memset(l, 0, sizeof *l);
    l->plant.instance = instance;
    memcpy(&l->plant.set, &set, sizeof set);
    memcpy(&l->plant.step, &step, sizeof step);
    memcpy(&l->plant.get, &get, sizeof get);
    memcpy(l->plant.inputs, inputs, sizeof l->plant.inputs);
    memcpy(l->plant.outputs, outputs, sizeof l->plant.outputs);
    memcpy(&l->observer, &observer, sizeof observer);
    memcpy(&l->controller, &controller, sizeof controller);
    l->observer_memory = observer_memory;
    l->controller_memory = controller_memory;
    l->period = period;
    memcpy(l->lag, lag, sizeof l->lag);
    edge_start(&l->edge, known_values, period);
    (void)l->plant.get(instance, l->plant.outputs, PLANT_OUTPUTS, l->output, PLANT_OUTPUTS);
}

static int exchange(plant *p, const double *input, double *output, double t, double period)
{
    _Bool flags[3];
    double reached;
    int status = p->set(p->instance, p->inputs, PLANT_INPUTS, input, PLANT_INPUTS);
    if (status <= FMI_WORST_USABLE) {
        status = p->step(p->instance, t, period, 0, flags, flags + 1, flags + 2, &reached);
    }
    if (status <= FMI_WORST_USABLE) {
        status = p->get(p->instance, p->outputs, PLANT_OUTPUTS, output, PLANT_OUTPUTS);
    }
    return status;
}

/* Writes numbers into a row of a table that stands column after column, `apart` from one to the next. Returns where the next number goes. */
static double *put_row(double *to, int64_t apart, const double *values, int count)
{
    for (int i = 0; i < count; i++) {
        to[i * apart] = values[i];
    }
    return to + count * apart;
}

EXPORT void core_loop_deviation(const loop *l, double *deviation) { memcpy(deviation, l->deviation, sizeof l->deviation); }

/* Runs the samples first .. first + count - 1; `held` [count * 5] are the inputs besides the force. What is recorded goes to `rows`, column after column
   that begin `apart` numbers from each other: estimates, what the controller gives, outputs of the plant. Returns the number of samples after which the
   plant went on: less than `count` where it could not. */
EXPORT int64_t core_loop_run(loop *l, int64_t first, int64_t count, const double *held, double *rows, int64_t apart)
{
    int64_t done = 0;
    int status = 0;
    while (done < count && status <= FMI_WORST_USABLE) {
        /* From the count, not by addition: rounding would add up. */
        const double t = (double)(first + done) * l->period;
        /* What the loop measures at t_k is what was held until then. */
        const double *measured = first + done > 0 ? l->input + 3 : held + 1;
        double in[IN];
        memcpy(in, measured, 4 * sizeof *in);
        for (int i = 0; i < 2; i++) {
            const double share = l->lag[i] > 0.0 && first + done > 0 ? -expm1(-l->period / l->lag[i]) : 1.0;
            l->made[i] += share * (in[0] - l->made[i]);
            in[4 + i] = l->made[i];
        }
        double control[CONTROL_SIZE], *row = rows + done;
        l->observer(l->observer_memory, l->input, l->output, in, l->estimate, l->deviation);
        l->controller(l->controller_memory, t, l->estimate, l->deviation, in, control);
        filter *own = l->observer == core_filter_step ? l->observer_memory : NULL;
        if (own != NULL && l->controller == core_foucault_step) {
            stray_by_force(own, l->controller_memory, control + 2);
        }
        edge_follow(&l->edge, l->estimate, in, control + 2, control + 8, control[6], control[7], own);
        control[7] += l->edge.turned;
        row = put_row(row, apart, l->estimate, ESTIMATE_SIZE);
        row = put_row(row, apart, control, CONTROL_SIZE);
        (void)put_row(row, apart, l->output, PLANT_OUTPUTS);
        memcpy(l->input, control, 2 * sizeof *control);
        memcpy(l->input + 2, held + 5 * done, 5 * sizeof *held);
        status = exchange(&l->plant, l->input, l->output, t, l->period);
        done += status <= FMI_WORST_USABLE;
    }
    return done;
}

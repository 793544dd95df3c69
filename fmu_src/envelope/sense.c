/* Both ends of the chain in the envelope form: the command on its way to the mass, the displacement on its way to the sample.

   A straight map takes the parts along cos φ and -sin φ each for itself; a curved one is followed around the cycle. Delay and lag are the
   phase and gain that they have at the carrier; that they need a little time to settle is left out. */

#include "noise.h"
#include "plant.h"

void gyro_draw(const gyro_instance *g, int effect, int64_t point, uint32_t index, double normal[2])
{
    gyro_normal_pair((uint32_t)g->value[GYRO_SEED], streams[effect], (uint64_t)point, index, normal);
}

void gyro_actuate(gyro_instance *g, gyro_harmonics *u)
{
    gyro_view *view = &g->view;
    const double *value = g->value;
    const double delay = force_delay(view);
    pair command = {{{value[GYRO_U_X_I], value[GYRO_U_X_Q]}, {value[GYRO_U_Y_I], value[GYRO_U_Y_Q]}}};
    if (delay > 0.0) {
        const number late = turn(-gyro_carrier(g) * delay);
        command = (pair){{times(command.e[0], late), times(command.e[1], late)}};
    }
    *u = (gyro_harmonics){{0.0, 0.0}, {command}};
    if (any_curved_actuator(view)) {
        gyro_cycle force = gyro_around(u);
        for (int k = 0; k < GYRO_PHASES; k++) {
            view->u[0] = force.at[k][0];
            view->u[1] = force.at[k][1];
            actuate(view);
            force.at[k][0] = view->u[0];
            force.at[k][1] = view->u[1];
        }
        *u = gyro_spectrum(&force);
    } else {
        for (int quadrature = 0; quadrature < 2; quadrature++) {
            view->u[0] = *part_of(&command.e[0], quadrature);
            view->u[1] = *part_of(&command.e[1], quadrature);
            actuate(view);
            *part_of(&u->part[0].e[0], quadrature) = view->u[0];
            *part_of(&u->part[0].e[1], quadrature) = view->u[1];
        }
    }
}

/* The voltage at the carrier before the amplifier's lag [V]. */
static pair pickoff_voltage(gyro_instance *g)
{
    gyro_view *view = &g->view;
    gyro_harmonics *q = &g->memory.q;
    gyro_harmonics u;
    pair v;
    gyro_actuate(g, &u);
    if (any_curved_pickoff(view)) {
        const gyro_cycle at = gyro_around(q), force = gyro_around(&u);
        gyro_cycle voltage;
        for (int k = 0; k < GYRO_PHASES; k++) {
            for (int axis = 0; axis < 2; axis++) {
                view->s[axis == 0 ? GYRO_STATE_X : GYRO_STATE_Y] = at.at[k][axis];
                view->u[axis] = force.at[k][axis];
            }
            pick_off(view);
            voltage.at[k][0] = view->v[0];
            voltage.at[k][1] = view->v[1];
        }
        v = gyro_spectrum(&voltage).part[0];
    } else {
        for (int quadrature = 0; quadrature < 2; quadrature++) {
            for (int axis = 0; axis < 2; axis++) {
                view->s[axis == 0 ? GYRO_STATE_X : GYRO_STATE_Y] = *part_of(&q->part[0].e[axis], quadrature);
                view->u[axis] = *part_of(&u.part[0].e[axis], quadrature);
            }
            pick_off(view);
            *part_of(&v.e[0], quadrature) = view->v[0];
            *part_of(&v.e[1], quadrature) = view->v[1];
        }
    }
    return v;
}

/* What the amplifier's offset and the converter's limit leave of a sine. */
static pair limited(gyro_instance *g, pair v)
{
    gyro_view *view = &g->view;
    const gyro_harmonics sine = {{0.0, 0.0}, {v}};
    gyro_cycle voltage = gyro_around(&sine);
    for (int k = 0; k < GYRO_PHASES; k++) {
        view->v[0] = voltage.at[k][0];
        view->v[1] = voltage.at[k][1];
        limit(view);
        voltage.at[k][0] = view->v[0];
        voltage.at[k][1] = view->v[1];
    }
    return gyro_spectrum(&voltage).part[0];
}

/* The numbers of one effect for one quadrature around the carrier, as a mean over a step h. White numbers at sample_period T have the
   density 2 T in each quadrature around any harmonic, so that the mean has the variance 2 T/h, and half of that around frequency 0; pink
   ones have 1/f. */
static void draw_slow(gyro_instance *g, int effect, int64_t point, uint32_t index, double numbers[2])
{
    const double scale = pink_places[effect] < 0 ? g->plan.noise_scale : 1.0 / sqrt(g->value[GYRO_CARRIER_FREQUENCY] * g->plan.step);
    gyro_draw(g, effect, point, index, numbers);
    numbers[0] *= scale;
    numbers[1] *= scale;
}

/* Noise that does not depend on the signal passes each quadrature for itself. */
static void add_white(gyro_instance *g, int64_t point, int quadrature, pair *v)
{
    gyro_view *view = &g->view;
    for (const int *effect = drawn_samples; *effect < GYRO_N_EFFECTS; effect++) {
        if (view->active[*effect]) {
            draw_slow(g, *effect, point, (uint32_t)quadrature, view->drawn[*effect]);
        }
    }
    view->v[0] = *part_of(&v->e[0], quadrature);
    view->v[1] = *part_of(&v->e[1], quadrature);
    add_noise(view);
    *part_of(&v->e[0], quadrature) = view->v[0];
    *part_of(&v->e[1], quadrature) = view->v[1];
}

/* Noise that the signal's rate multiplies is mixed to the carrier from frequency 0 and from twice the carrier: the numbers are made up
   around the cycle from those slow parts. */
static void add_mixed(gyro_instance *g, int64_t point, pair *v)
{
    gyro_view *view = &g->view;
    const number iw = number_of(0.0, gyro_carrier(g));
    const gyro_harmonics sine = {{0.0, 0.0}, {*v}}, rate = {{0.0, 0.0}, {{{times(iw, v->e[0]), times(iw, v->e[1])}}}};
    gyro_cycle voltage = gyro_around(&sine);
    const gyro_cycle speed = gyro_around(&rate);
    gyro_cycle numbers[GYRO_N_EFFECTS];
    for (const int *effect = drawn_samples; *effect < GYRO_N_EFFECTS; effect++) {
        gyro_harmonics slow = {{0.0, 0.0}, {{{{0.0, 0.0}, {0.0, 0.0}}}}};
        double mean[2];
        draw_slow(g, *effect, point, 4, mean);
        for (int axis = 0; axis < 2; axis++) {
            slow.mean[axis] = sqrt(0.5) * mean[axis];
        }
        for (uint32_t index = 0; index < 4; index++) {
            double part[2];
            draw_slow(g, *effect, point, index, part);
            for (int axis = 0; axis < 2; axis++) {
                *part_of(&slow.part[index / 2].e[axis], (int)index % 2) = part[axis];
            }
        }
        numbers[*effect] = gyro_around(&slow);
    }
    for (int k = 0; k < GYRO_PHASES; k++) {
        for (int axis = 0; axis < 2; axis++) {
            view->v[axis] = voltage.at[k][axis];
            view->v_rate[axis] = speed.at[k][axis];
            for (const int *effect = drawn_samples; *effect < GYRO_N_EFFECTS; effect++) {
                view->drawn[*effect][axis] = numbers[*effect].at[k][axis];
            }
        }
        add_noise(view);
        voltage.at[k][0] = view->v[0];
        voltage.at[k][1] = view->v[1];
    }
    *v = gyro_spectrum(&voltage).part[0];
}

/* Rounding of a signal that crosses many steps is white noise: that of any large voltage serves as its draw. */
static void add_rounding(gyro_instance *g, int64_t point, int quadrature, pair *v)
{
    static const double LARGE = 1e3; /* V: 1e3 to 1e10 steps of a converter, with as many of the next digits left */
    gyro_view *view = &g->view;
    double voltage[2];
    gyro_draw(g, rounding_effects[0], point, (uint32_t)quadrature, voltage);
    for (int axis = 0; axis < 2; axis++) {
        voltage[axis] *= LARGE;
        view->v[axis] = voltage[axis];
    }
    round_off(view);
    for (int axis = 0; axis < 2; axis++) {
        *part_of(&v->e[axis], quadrature) += g->plan.noise_scale * (view->v[axis] - voltage[axis]);
    }
}

void gyro_sense(gyro_instance *g, int64_t point)
{
    gyro_view *view = &g->view;
    const double lag = gyro_carrier(g) * larger(lag_time_constant(view), 0.0);
    pair v = pickoff_voltage(g);
    if (lag > 0.0) {
        for (int axis = 0; axis < 2; axis++) {
            v.e[axis] = over(v.e[axis], number_of(1.0, lag));
        }
    }
    if (any_curved_output(view)) {
        v = limited(g, v);
    }
    if (view->any_rate) {
        add_mixed(g, point, &v);
    }
    for (int quadrature = 0; quadrature < 2; quadrature++) {
        if (any_drawn_sample(view) && !view->any_rate) {
            add_white(g, point, quadrature, &v);
        }
        if (any_rounded_sample(view)) {
            add_rounding(g, point, quadrature, &v);
        }
    }
    g->value[GYRO_V_X_I] = v.e[0].re;
    g->value[GYRO_V_X_Q] = v.e[0].im;
    g->value[GYRO_V_Y_I] = v.e[1].re;
    g->value[GYRO_V_Y_Q] = v.e[1].im;
}

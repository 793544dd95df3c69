#include "foucault.h"

#include "drift.h"
#include "known_model.h"

#define CROSS 0.1 /* a cross term may be zero: it counts as no smaller than this part of its geometric mean */
#define WAIT 16  /* samples between two looks at an unknown device */
#define LOST 5.0 /* times `trust`: uncertainty of the mass at which the device counts as lost */
#define ONSET 2e-2 /* in which the second pair of tones comes up again [s]: at once it would turn the pattern by as much as its own motion, within 5 ms on a
                      straight line by 2 degrees */
#define ROOM 1.5 /* times the energy that is held: above, the second pair waits for the energy loop */
#define AFRESH 64 /* samples after which the tones' phases are worked out anew: turned on until then, they err by 1e-14 */
#define NEWTON 3  /* steps in which the actuators are inverted; their curve is weak */

static phase phase_of(double angle) { return (phase){sin(angle), cos(angle)}; }

/* `a` further on by `b`. */
static phase turned_by(phase a, phase b) { return (phase){a.sine * b.cosine + a.cosine * b.sine, a.cosine * b.cosine - a.sine * b.sine}; }

/* Of tone i [N]: what it deflects does not depend on the oscillator's stiffness. */
static double tone_amplitude(const foucault *c, int i)
{
    const double told = i < 2 ? c->settings.tone_amplitude : c->settings.tone2_amplitude;
    return told * c->stiffness / c->settings.k;
}

/* Places the tones for a loop at `frequency` [Hz]: where they are told, else at their ratios to it. */
static void place_tones(foucault *c, double frequency)
{
    const foucault_settings *s = &c->settings;
    const double told[TONES] = {s->tone_x, s->tone_y, s->tone2_x, s->tone2_y};
    const double ratio[TONES] = {s->tone_x_ratio, s->tone_y_ratio, s->tone2_x_ratio, s->tone2_y_ratio};
    for (int i = 0; i < TONES; i++) {
        c->frequency[i] = told[i] > 0.0 ? told[i] : ratio[i] * frequency;
    }
}

/* Where the tones stand at the present sample, at t [s]. */
static void turn_tones(foucault *c, double t)
{
    const int afresh = c->count % AFRESH == 0 || c->tones_at != c->count - 1;
    for (int i = 0; i < TONES; i++) {
        const double w = 2.0 * PI * c->frequency[i];
        c->tone_step[i] = afresh ? phase_of(w * c->period) : c->tone_step[i];
        c->tone[i] = afresh ? phase_of(w * t) : turned_by(c->tone[i], c->tone_step[i]);
    }
    c->tones_at = c->count;
}

/* The change of constant i that `share` of it stands for. An error of dxy turns the pattern by dxy/(2 m) at most, one of dxx or dyy by half of
   that: at a high Q a share of the damping would ask for more than the record can tell, and than the angle needs. */
static double tolerance(const foucault_settings *s, const double *constants, int i, double share)
{
    double size = fabs(constants[i]);
    if (i == 2 || i == 5) {
        size = larger(size, CROSS * sqrt(fabs(constants[i - 2] * constants[i - 1])));
    }
    double allowed = share * size;
    if (3 <= i && i <= 5) {
        allowed = larger(allowed, (i == 5 ? 2.0 : 4.0) * fabs(constants[6]) * s->turn_limit);
    }
    return allowed;
}

/* Whether a constant has left the one in use by `jump` of it and 3 standard deviations. */
static int has_jumped(const foucault *c, const double *estimate, const double *deviation)
{
    int jumped = 0;
    for (int i = 0; i < 7; i++) {
        const double change = fabs(estimate[ESTIMATE_KXX + i] - c->in_use[i]);
        jumped |= change > larger(tolerance(&c->settings, c->in_use, i, c->settings.jump), 3.0 * deviation[ESTIMATE_KXX + i]);
    }
    return jumped;
}

/* Whether stiffness and mass are known well enough to be cancelled: within `trust` of them, cross stiffness of the mean. */
static int is_known(const foucault *c, const double *estimate, const double *deviation)
{
    const double *value = estimate + ESTIMATE_KXX, *sigma = deviation + ESTIMATE_KXX;
    const double mean = sqrt(fabs(value[0] * value[1]));
    const double trust = c->settings.trust;
    return value[6] > 0.0 && sigma[6] <= trust * value[6] && sigma[0] <= trust * fabs(value[0]) && sigma[1] <= trust * fabs(value[1]) &&
           sigma[2] <= trust * mean;
}

static void corner(const double *a, double *out)
{
    for (int i = 0; i < 4; i++) {
        memcpy(out + 4 * i, a + NS * i, 4 * sizeof *out);
    }
}

/* Whether the constants are others than those that the control signal was formed with. */
static int has_moved(const foucault *c, const double *estimate)
{
    return memcmp(c->formed_with, estimate + ESTIMATE_KXX, sizeof c->formed_with) != 0;
}

/* How fast the pattern is turned at its worst angle by gains that are older than the constants by which the motion is read [rad/s]. */
static void look_behind(foucault *c, const double *estimate)
{
    const double *constants = estimate + ESTIMATE_KXX, none[2] = {0.0, 0.0};
    known now = c->k, then = c->k;
    double rate[3];
    memcpy(c->compared, constants, sizeof c->compared);
    known_coordinates(&c->k, constants, none, 0.0, now.p);
    known_coordinates(&c->k, c->formed_with, none, 0.0, then.p);
    drift_of_force(&now, &then, c->stiffness, rate);
    c->behind = fabs(rate[0]) + hypot(rate[1], rate[2]);
}

/* Forms the control signal from the current estimates. */
static void form(foucault *c, const double *estimate)
{
    const foucault_settings *s = &c->settings;
    const double mass = estimate[ESTIMATE_M], *constants = estimate + ESTIMATE_KXX;
    const double rest[NS] = {0}, none[2] = {0.0, 0.0};
    c->followed_at = has_moved(c, estimate) ? c->count : c->followed_at;
    memcpy(c->in_use, constants, sizeof c->in_use);
    memcpy(c->formed_with, constants, sizeof c->formed_with);
    memcpy(c->formed_in, c->k.in, sizeof c->formed_in);
    c->formed_at = c->count;
    memcpy(c->compared, constants, sizeof c->compared);
    c->behind = 0.0;
    known_coordinates(&c->k, constants, none, 0.0, c->k.p);
    if (!c->formed && s->found_stiffness != 0.0 && constants[0] + constants[1] > 0.0) {
        /* With a nominal stiffness that is half off, delay and lag are told several times less well (docs/theory/loop.md). Once, since another k is
           another frequency. */
        c->stiffness = 0.5 * s->found_stiffness * (constants[0] + constants[1]);
    }
    const double omega_squared = c->stiffness / mass;
    const int compensate = s->hold_compensation != 0.0;
    double a[16], b[8], wide_b[NS * 2], late[2];
    known_rate_by_state(&c->k, rest, none, 0.0, c->a);
    known_rate_by_force(&c->k, rest, none, 0.0, wide_b);
    corner(c->a, a);
    memcpy(b, wide_b, sizeof b);
    /* Stiffness and damping as they act, parameter laws included. */
    double rate[8];
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 4; j++) {
            rate[4 * i + j] = -mass * a[4 * (2 * i + 1) + j] - (j == 2 * i ? c->stiffness : 0.0);
        }
    }
    /* The gain without a rate of turn and its slope: the rate changes faster than the signal is formed. */
    const double probe = 1e-3 * sqrt(omega_squared);
    double turning[NS * NS], turning_a[16];
    held_loop with_rate, with_own_rate;
    known_rate_by_state(&c->k, rest, none, probe, turning);
    corner(turning, turning_a);
    /* The pattern shall turn as the device itself turns it. */
    c->coupling = rate_coupling(c->a, turning, probe);
    hold_form(&with_rate, turning_a, b, rate, omega_squared, c->coupling * probe, c->period, compensate);
    hold_form(&c->loop, a, b, rate, omega_squared, 0.0, c->period, compensate);
    double turned_rate[8];
    memcpy(turned_rate, rate, sizeof turned_rate);
    turned_rate[3] += 2.0 * mass * probe; /* a Coriolis force of the controller's own: x' and y' on the other axis */
    turned_rate[5] -= 2.0 * mass * probe;
    hold_form(&with_own_rate, a, b, turned_rate, omega_squared, probe, c->period, compensate);
    for (int i = 0; i < 8; i++) {
        c->by_own_rate[i] = (with_own_rate.gain[i] - c->loop.gain[i]) / probe;
        c->by_omega[i] = (with_rate.gain[i] - c->loop.gain[i]) / probe;
    }
    known_late(&c->k, rest, none, 0.0, late);
    c->delay = HAS_DELAY ? smaller(larger(late[0], 0.0), 0.5 * PAST * c->period) : 0.0;
    c->delay_samples = (int64_t)(c->delay / c->period);
    motion_form_piece(&c->rest, &c->k, 0.0, c->delay - (double)c->delay_samples * c->period);
    motion_form_piece(&c->step, &c->k, 0.0, c->period);
    motion_form_piece(&c->half, &c->k, 0.0, 0.5 * c->period);
    c->omega = sqrt(omega_squared);
    const double angle = 0.5 * c->period * c->omega;
    c->boost = compensate ? angle / sin(angle) : 1.0;
    c->turn = phase_of(c->omega * c->period);
    if (!c->formed) {
        /* Once: a tone that moved with each estimate would be no tone. */
        place_tones(c, c->omega / (2.0 * PI));
    }
    /* A sample lies so long after a command has begun to act. */
    double phi[16], gamma[8];
    const double lead = compensate ? 0.5 * c->period : 0.0;
    transition_over(a, b, 4, c->period - c->rest.duration, phi, gamma);
    hold_straighten(&c->loop, phi, gamma, c->omega, c->rest.duration, c->straight);
    for (int i = 0; i < TONES; i++) {
        const double amplitude = tone_amplitude(c, i);
        hold_respond(&c->loop, c->frequency[i], i % 2, amplitude, c->period, lead, c->phasor[i]);
        hold_respond_within(&c->loop, phi, gamma, c->frequency[i], i % 2, amplitude, lead, c->phasor[i], c->phasor_now[i]);
        const double w = 2.0 * PI * c->frequency[i];
        c->late[i] = phase_of(-w * (double)(c->delay_samples + 1) * c->period);
        c->ahead[i] = phase_of(w * lead);
    }
    c->formed = 1;
}

/* Moves the state `s` [NS] through a piece under the force f [N]. */
static void move(const foucault *c, const piece *part, double omega_z, const double f[2], double *s)
{
    passage way;
    motion_move(part, &c->k, omega_z, omega_z, f, s, &way);
    memcpy(s, way.end, sizeof way.end);
}

static void force_of(const foucault *c, int64_t sample, const double *s, double f[2])
{
    known_actuate(&c->k, s, c->u[(sample > 0 ? sample : 0) & (PAST - 1)], 0.0, f);
}

/* The force that cancels what springs, dampers and the rate of turn don't say at `s` [NS] [N]. */
static void cancel_rest(const foucault *c, const double *s, double omega_z, double mass, double f[2])
{
    const double none[2] = {0.0, 0.0};
    double bend[NS];
    known_bend(&c->k, s, none, omega_z, bend);
    for (int i = 0; i < 2; i++) {
        const int row = 2 * i + 1;
        for (int j = 4; j < NS; j++) {
            bend[row] += c->a[NS * row + j] * s[j];
        }
        f[i] = -mass * bend[row];
    }
}

/* The command that makes the force `wanted` [N]. */
static void invert(const foucault *c, const double *s, const double wanted[2], double u[2])
{
    memcpy(u, wanted, 2 * sizeof *u);
    for (int i = 0; i < (LINEAR_ACTUATOR ? 1 : NEWTON); i++) {
        double f[2], J[4];
        known_actuate(&c->k, s, u, 0.0, f);
        known_actuate_by_command(&c->k, s, u, 0.0, J);
        const double det = J[0] * J[3] - J[1] * J[2], e[2] = {wanted[0] - f[0], wanted[1] - f[1]};
        u[0] += (J[3] * e[0] - J[1] * e[1]) / det;
        u[1] += (J[0] * e[1] - J[2] * e[0]) / det;
    }
}

/* Rate of the electronic turn that exchanges the modes. The pattern rests, turns by a right angle, rests, turns back, rests, turns the other way,
   rests, turns back: what is wrong of the turn cancels, and so does, over resting and turning, a bias that goes with twice the pattern's angle. */
static double reversal_rate(const foucault *c)
{
    if (c->reversal_every == 0 || c->count % c->reversal_every < c->reversal_every - c->reversal_takes) {
        return 0.0;
    }
    /* Over a sine's square: a rate that begins at once would kick the pattern by rate/(2 w), and again where it ends. */
    const int64_t turn = c->count / c->reversal_every % 4, begun = c->count % c->reversal_every - (c->reversal_every - c->reversal_takes);
    const double share = ((double)begun + 0.5) / (double)c->reversal_takes, rising = sin(PI * share);
    const double rate = PI / ((double)c->reversal_takes * c->period) * rising * rising;
    return turn == 0 || turn == 3 ? rate : -rate;
}

/* Nothing of the device is cancelled until it is found again. The second pair of tones, near the loop's own frequency, rests meanwhile: it may
   meet a mode of the device, and drive it to where the pickoff shows nothing more. */
static void lose(foucault *c)
{
    c->near_share = c->formed ? 0.0 : c->near_share;
    c->smoothed = 0.0;
    c->formed = 0;
}

/* The tones alone: until the device is known nothing of it is cancelled. */
static void wait_with_tones(foucault *c, double t, foucault_output *out)
{
    memset(out, 0, sizeof *out);
    for (int i = 0; i < TONES; i++) {
        out->u[i % 2] += (i < 2 ? 1.0 : c->near_share) * tone_amplitude(c, i) * sin(2.0 * PI * c->frequency[i] * t);
    }
    const double omega = 2.0 * PI * c->settings.first_frequency;
    out->omega_squared = omega * omega;
    memcpy(c->u[c->count & (PAST - 1)], out->u, sizeof out->u);
    c->count++;
}

void foucault_step(foucault *c, const double *estimate, const double *deviation, const double in[IN], foucault_output *out)
{
    const foucault_settings *set = &c->settings;
    const double t = (double)c->count * c->period;
    int64_t every = (int64_t)(set->update_period / c->period + 0.5);
    every = every > 0 ? every : 1;
    const int64_t soon = every / 10 > 0 ? every / 10 : 1;
    memcpy(c->k.in, in, sizeof c->k.in);
    c->k.t = t;
    /* At once where the constants change: feedback on an older delay than the one that the state was found with turns the pattern. So inputs that
       change all the time have a clock of their own. */
    const int old = c->count - c->followed_at >= every || (c->count % soon == 0 && has_jumped(c, estimate, deviation));
    const int other = memcmp(c->formed_in, in, sizeof c->formed_in) != 0 && c->count - c->formed_at >= every;
    const int due = c->formed ? (has_moved(c, estimate) && old) || other : c->count % WAIT == 0;
    if (due && is_known(c, estimate, deviation)) {
        form(c, estimate);
    } else if (due && !(deviation[ESTIMATE_M] < LOST * set->trust * estimate[ESTIMATE_M])) {
        lose(c);
    }
    if (!c->formed) {
        wait_with_tones(c, t, out);
        return;
    }
    if (memcmp(c->compared, estimate + ESTIMATE_KXX, sizeof c->compared) != 0) {
        look_behind(c, estimate);
    }
    const double mass = c->in_use[6], omega_z = estimate[4], omega_squared = c->stiffness / mass;

    /* The state when this command begins to act: first the force that acts now, then those under way. */
    double s[NS], f[2];
    memcpy(s, estimate, 4 * sizeof *s);
    memcpy(s + 4, estimate + ESTIMATE_SIZE - (NS - 4), (NS - 4) * sizeof *s);
    if (c->delay > 0.0) {
        force_of(c, c->count - 1 - c->delay_samples, s, f);
        move(c, &c->rest, omega_z, f, s);
        for (int64_t k = c->count - c->delay_samples; k < c->count; k++) {
            force_of(c, k, s, f);
            move(c, &c->step, omega_z, f, s);
        }
    }

    /* The tones now, for the angle, and when the command acts. */
    double forced[4] = {0.0, 0.0, 0.0, 0.0}, near[4] = {0.0, 0.0, 0.0, 0.0}, ahead[4] = {0.0, 0.0, 0.0, 0.0}, added[2] = {0.0, 0.0};
    const double half = set->hold_compensation != 0.0 ? 0.5 * c->period : 0.0;
    const double wanted_energy = omega_squared * set->amplitude * set->amplitude;
    if (c->near_share > 0.0 || set->energy_loop == 0.0 || (c->smoothed > 0.0 && c->energy < ROOM * wanted_energy)) {
        c->near_share = smaller(c->near_share + c->period / ONSET, 1.0);
    }
    const double near_share = c->near_share * c->near_share * (3.0 - 2.0 * c->near_share);
    turn_tones(c, t);
    for (int i = 0; i < TONES; i++) {
        const double share = i < 2 ? 1.0 : near_share, amplitude = share * tone_amplitude(c, i);
        if (amplitude == 0.0) {
            continue;
        }
        /* The command keeps its phase whatever the delay is taken for: a tone that moved with each estimate would shake the pattern. */
        const phase now = c->tone[i], late = turned_by(now, c->late[i]);
        for (int j = 0; j < 4; j++) {
            const double response = share * (c->phasor_now[i][2 * j] * late.sine + c->phasor_now[i][2 * j + 1] * late.cosine);
            forced[j] += response;
            near[j] += i < 2 ? 0.0 : response;
            ahead[j] += share * (c->phasor[i][2 * j] * now.sine + c->phasor[i][2 * j + 1] * now.cosine);
        }
        /* The tones are taken at mid-hold, so that the held staircase has their true phase. */
        added[i % 2] += amplitude * turned_by(now, c->ahead[i]).sine;
    }
    if (set->coriolis_compensation != 0.0) {
        added[0] -= 2.0 * mass * c->coupling * omega_z * ahead[3];
        added[1] += 2.0 * mass * c->coupling * omega_z * ahead[1];
    }

    double feedback[2] = {0.0, 0.0};
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 4; j++) {
            feedback[i] += (c->loop.gain[4 * i + j] + omega_z * c->by_omega[4 * i + j]) * s[j];
        }
    }
    const double x = s[0] - ahead[0], x_dot = s[1] - ahead[1], y = s[2] - ahead[2], y_dot = s[3] - ahead[3];
    /* Energy and angular momentum of the pattern, smoothed: at the samples they ripple at twice the oscillation, and a ripple times the motion
       would turn the pattern. */
    const double energy = omega_squared * (x * x + y * y) + x_dot * x_dot + y_dot * y_dot;
    const double momentum = x * y_dot - y * x_dot;
    const double share = c->smoothed > 0.0 ? smaller(c->period / set->loop_smoothing, 1.0) : 1.0;
    c->smoothed = 1.0;
    c->energy += share * (energy - c->energy);
    c->momentum += share * (momentum - c->momentum);
    if (set->energy_loop != 0.0) {
        const double push = set->energy_rate * mass * smaller(larger(1.0 - c->energy / wanted_energy, -1.0), 1.0);
        feedback[0] += push * x_dot;
        feedback[1] += push * y_dot;
    }
    if (set->quadrature_loop != 0.0 && c->energy > 0.0) {
        /* A force across the position, in phase with it: it takes the angular momentum away and, on a straight orbit, turns nothing. */
        const double across = 2.0 * mass * set->quadrature_rate * omega_squared * c->momentum / c->energy;
        /* At mid-hold: half a hold late, omega T/2 of the force would act across the velocity and turn the pattern. */
        feedback[0] += across * (y + half * y_dot);
        feedback[1] -= across * (x + half * x_dot);
    }
    const double own_rate = set->carousel_rate + reversal_rate(c);
    if (own_rate != 0.0) {
        /* As a rate of turn would, but no tone. */
        const double free[4] = {x, x_dot, y, y_dot};
        for (int i = 0; i < 2; i++) {
            for (int j = 0; j < 4; j++) {
                feedback[i] += own_rate * c->by_own_rate[4 * i + j] * free[j];
            }
        }
        c->turned -= own_rate * c->period;
    }
    if (BENT || NS > 4) {
        double middle[NS], beyond[2];
        memcpy(middle, s, sizeof middle);
        move(c, &c->half, omega_z, feedback, middle);
        cancel_rest(c, middle, omega_z, mass, beyond);
        feedback[0] += c->boost * beyond[0];
        feedback[1] += c->boost * beyond[1];
    }

    /* Wrong first estimates must not drive the device away. */
    const double limit = set->force_limit * set->k * set->amplitude, size = sqrt(feedback[0] * feedback[0] + feedback[1] * feedback[1]);
    out->lacking = larger(size - limit, 0.0);
    if (size > limit) {
        feedback[0] *= limit / size;
        feedback[1] *= limit / size;
    }
    const double wanted[2] = {feedback[0] + c->loop.mix[0] * added[0] + c->loop.mix[1] * added[1],
                              feedback[1] + c->loop.mix[2] * added[0] + c->loop.mix[3] * added[1]};
    invert(c, s, wanted, out->u);
    const double command = sqrt(out->u[0] * out->u[0] + out->u[1] * out->u[1]);
    out->lacking += larger(command - 1.5 * limit, 0.0);
    if (command > 1.5 * limit) {
        out->u[0] *= 1.5 * limit / command;
        out->u[1] *= 1.5 * limit / command;
    }
    if (!isfinite(out->u[0]) || !isfinite(out->u[1])) {
        /* An estimate that is no number: the device is left alone until there is one. */
        out->u[0] = out->u[1] = 0.0;
        lose(c);
    }
    memcpy(c->u[c->count & (PAST - 1)], out->u, sizeof out->u);
    for (int i = 0; i < 4; i++) {
        double straight = 0.0;
        for (int j = 0; j < 4; j++) {
            straight += c->straight[4 * i + j] * (estimate[j] - forced[j]);
        }
        out->forced[i] = isfinite(straight) ? estimate[i] - straight : forced[i];
    }
    memcpy(out->near, near, sizeof near);
    out->omega_squared = omega_squared;
    out->turned = c->turned;
    out->own_rate = own_rate;
    out->behind = c->behind;
    c->count++;
}

void foucault_start(foucault *c, const foucault_settings *settings, const double *known_values, double period)
{
    memset(c, 0, sizeof *c);
    c->settings = *settings;
    memcpy(c->k.c, known_values, NC * sizeof *known_values);
    c->period = period;
    if (settings->reversal_period > 0.0) {
        c->reversal_every = (int64_t)(settings->reversal_period / period + 0.5);
        c->reversal_takes = (int64_t)(0.5 * PI / (settings->reversal_rate * period) + 0.5);
        c->reversal_takes = c->reversal_takes < 1 ? 1 : c->reversal_takes;
        c->reversal_every = c->reversal_every < c->reversal_takes ? c->reversal_takes : c->reversal_every;
    }
    c->near_share = 1.0;
    c->stiffness = settings->k;
    place_tones(c, settings->first_frequency);
}

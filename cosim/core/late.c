#include "late.h"

#include "block.h"
#include "known_model.h"

#define BESIDE 0.03 /* periods beside whole ones at which a delay may be on the wrong side, and how far below them it is looked for */
#define ABOVE 0.002 /* periods above whole ones at which it is looked for there: a delay that is just whole is as good as there */

/* Where other lags are looked at: deviations of the design from the lag that it expects. */
static const double ELSEWHERE[LATE_LAGS] = {-1.7, 0.0, 2.0};

/* The constant that a row of derivatives follows most, in deviations of the design; -1: none. */
static int most_of(const filter *f, const double row[NP])
{
    int most = -1;
    for (int i = 0; i < NP; i++) {
        const double size = fabs(row[i]) * f->prior[i];
        most = size > (most < 0 ? 0.0 : fabs(row[most]) * f->prior[most]) ? i : most;
    }
    return most;
}

/* Periods by which a delay is beyond a whole number of them, 1 or more; HUGE_VAL where it is not beside one. */
static double beyond_whole(double delay, double period)
{
    const double periods = delay / period, whole = floor(periods + 0.5), beyond = periods - whole;
    return whole >= 1.0 && fabs(beyond) <= BESIDE ? beyond : HUGE_VAL;
}

/* How much more the delay would be on the other side of whole periods; zero where it is not beside them. A command that a processor sends on at the next
   sample is late by just whole periods, which counts as above. */
static double across_whole_periods(double delay, double period)
{
    const double beyond = beyond_whole(delay, period);
    return beyond == HUGE_VAL ? 0.0 : beyond < 0.0 ? (ABOVE - beyond) * period : -(beyond + BESIDE) * period;
}

/* Delay and lag [s], and for each the constant that it follows most and its slope by it; -1: none. */
typedef struct {
    double delay, lag;
    int delay_at, lag_at;
    double delay_by, lag_by;
} lateness;

static lateness lateness_of(const filter *f, const known *k)
{
    const double none[2] = {0.0, 0.0}, *z = f->now.z;
    double late[2], by_p[2 * NP];
    known_late(k, z, none, z[OMEGA], late);
    known_late_by_parameter(k, z, none, z[OMEGA], by_p);
    const int delay = most_of(f, by_p), lag = most_of(f, by_p + NP);
    return (lateness){late[0], late[1], delay, lag, delay < 0 ? 0.0 : by_p[delay], lag < 0 ? 0.0 : by_p[NP + lag]};
}

/* The change of eta by a delay that is `more` [s] and a lag that is `less`. */
static void change_to(const filter *f, const lateness *at, double more, double less, double step[NP])
{
    double change[NP] = {0.0};
    change[at->delay_at] = more / at->delay_by;
    if (at->lag_at >= 0) {
        change[at->lag_at] = -less / at->lag_by;
    }
    block_scale(f, change, step);
}

int late_other_side(const filter *f, double step[NP])
{
    const lateness now = lateness_of(f, &f->k);
    const double more = now.delay_at < 0 ? 0.0 : across_whole_periods(now.delay, f->m.period);
    if (more != 0.0) {
        change_to(f, &now, more, smaller(more, now.lag), step);
    }
    return more != 0.0;
}

void late_keep_side(filter *f, const known *at)
{
    const lateness now = lateness_of(f, at);
    memcpy(f->lowest, f->first_lowest, sizeof f->lowest);
    const double beyond = now.delay_at < 0 ? HUGE_VAL : beyond_whole(now.delay, f->m.period);
    if (beyond != HUGE_VAL && beyond >= 0.0 && now.delay_by > 0.0) {
        /* By a rounding more, so that it is above. */
        const double whole = at->p[now.delay_at] - (beyond - 1e-9) * f->m.period / now.delay_by;
        f->lowest[now.delay_at] = larger(whole, f->lowest[now.delay_at]);
    }
}

/* Whether there are a delay and a lag to share what is late; the lag [s] that the design expects, and its deviation. */
static int is_shared(const filter *f, const lateness *now, double *expected, double *deviation)
{
    if (now->delay_at < 0 || now->lag_at < 0) {
        return 0;
    }
    known design = f->k;
    memcpy(design.p, f->first_p, sizeof design.p);
    *expected = lateness_of(f, &design).lag;
    *deviation = fabs(now->lag_by) * f->prior[now->lag_at];
    return 1;
}

int late_other_lag(const filter *f, int which, double step[NP])
{
    const lateness now = lateness_of(f, &f->k);
    double expected, deviation;
    if (!is_shared(f, &now, &expected, &deviation)) {
        return 0;
    }
    const double less = now.lag - larger(expected + ELSEWHERE[which] * deviation, 0.0);
    if (fabs(less) < APART * deviation || now.delay + less < 0.0) {
        return 0;
    }
    change_to(f, &now, less, less, step);
    return 1;
}

int late_whole_periods(const filter *f, int which, double step[NP])
{
    const lateness now = lateness_of(f, &f->k);
    double expected, deviation;
    if (!is_shared(f, &now, &expected, &deviation)) {
        return 0;
    }
    const double period = f->m.period, whole = floor((now.delay + now.lag) / period + BESIDE) - (double)which;
    const double more = (whole + ABOVE) * period - now.delay, less = smaller(more, now.lag);
    if (whole < 1.0 || fabs(more) < BESIDE * period || now.lag - less > expected + ELSEWHERE[LATE_LAGS - 1] * deviation) {
        return 0;
    }
    change_to(f, &now, more, less, step);
    return 1;
}

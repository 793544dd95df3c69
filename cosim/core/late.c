#include "late.h"

#include "block.h"
#include "known_model.h"

#define BESIDE 0.03 /* periods beside whole ones at which a delay may be on the wrong side, and how far on the other one it is looked for */

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

/* How much more the delay would be on the other side of whole periods; zero where it is not beside them. */
static double across_whole_periods(double delay, double period)
{
    const double periods = delay / period, whole = floor(periods + 0.5), beside = periods - whole;
    return whole >= 1.0 && fabs(beside) <= BESIDE ? -(beside + copysign(BESIDE, beside)) * period : 0.0;
}

int late_other_side(const filter *f, double step[NP])
{
    const double none[2] = {0.0, 0.0}, *z = f->now.z;
    double late[2], by_p[2 * NP], change[NP] = {0.0};
    known_late(&f->k, z, none, z[OMEGA], late);
    known_late_by_parameter(&f->k, z, none, z[OMEGA], by_p);
    const int delay = most_of(f, by_p), lag = most_of(f, by_p + NP);
    const double more = delay < 0 ? 0.0 : across_whole_periods(late[0], f->m.period);
    if (more != 0.0) {
        change[delay] = more / by_p[delay];
        if (lag >= 0) {
            change[lag] = -smaller(more, late[1]) / by_p[NP + lag];
        }
        block_scale(f, change, step);
    }
    return more != 0.0;
}

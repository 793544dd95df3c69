#include "pattern.h"

#include <math.h>

advance pattern_advance(double turn, double w, double duration)
{
    const double complex frame = cexp(-I * turn * duration), swing = cexp(I * w * duration);
    const advance a = {turn, w, frame * swing, frame * conj(swing)};
    return a;
}

orbit pattern_of(double complex up, double complex down, double turn, double w)
{
    const orbit o = {up + down, I * (w - turn) * up - I * (w + turn) * down};
    return o;
}

orbit pattern_moved(orbit o, const advance *a)
{
    const double complex up = 0.5 * (o.z + (o.v + I * a->turn * o.z) / (I * a->w)), down = o.z - up;
    return pattern_of(up * a->up, down * a->down, a->turn, a->w);
}

double pattern_orientation(orbit o, double turn, double w)
{
    const double complex v = (o.v + I * turn * o.z) / w;
    const double cross = 2.0 * (creal(o.z) * cimag(o.z) + creal(v) * cimag(v));
    return 0.5 * atan2(cross, creal(o.z * conj(o.z)) + 2.0 * creal(v) * creal(v) - 2.0 * cimag(o.z) * cimag(o.z) - creal(v * conj(v)));
}

double pattern_deviation(orbit a, orbit b, double w)
{
    const double from[4] = {creal(a.z), cimag(a.z), creal(a.v) / w, cimag(a.v) / w};
    const double along[2][4] = {{from[0], from[1], from[2], from[3]}, {from[2], from[3], -from[0], -from[1]}};
    double d[4] = {creal(b.z) - from[0], cimag(b.z) - from[1], creal(b.v) / w - from[2], cimag(b.v) / w - from[3]}, size = 0.0, total = 0.0;
    for (int i = 0; i < 4; i++) {
        size += from[i] * from[i];
    }
    for (int n = 0; n < 2; n++) {
        double share = 0.0;
        for (int i = 0; i < 4; i++) {
            share += d[i] * along[n][i] / size;
        }
        for (int i = 0; i < 4; i++) {
            d[i] -= share * along[n][i];
        }
    }
    for (int i = 0; i < 4; i++) {
        total += d[i] * d[i];
    }
    return total / size;
}

#include "pattern.h"

#include <math.h>

advance pattern_advance(double turn, double w, double duration)
{
    const double complex frame = cexp(-I * turn * duration), swing = cexp(I * w * duration);
    const advance a = {frame * swing, frame * conj(swing)};
    return a;
}

orbit pattern_of(double complex up, double complex down, double turn, double w)
{
    const orbit o = {up + down, I * (w - turn) * up - I * (w + turn) * down};
    return o;
}

double pattern_orientation(orbit o, double turn, double w)
{
    const double complex v = (o.v + I * turn * o.z) / w;
    const double cross = 2.0 * (creal(o.z) * cimag(o.z) + creal(v) * cimag(v));
    return 0.5 * atan2(cross, creal(o.z * conj(o.z)) + 2.0 * creal(v) * creal(v) - 2.0 * cimag(o.z) * cimag(o.z) - creal(v * conj(v)));
}

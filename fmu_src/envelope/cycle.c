#include "cycle.h"

/* cos 2π k/32: written out, since platforms' libm differ in the last bit. */
static const double COSINE[GYRO_PHASES] = {
    1.0, 0.9807852804032304, 0.9238795325112867, 0.8314696123025452,
    0.7071067811865476, 0.5555702330196023, 0.38268343236508984, 0.19509032201612833,
    0.0, -0.19509032201612833, -0.38268343236508984, -0.5555702330196023,
    -0.7071067811865476, -0.8314696123025452, -0.9238795325112867, -0.9807852804032304,
    -1.0, -0.9807852804032304, -0.9238795325112867, -0.8314696123025452,
    -0.7071067811865476, -0.5555702330196023, -0.38268343236508984, -0.19509032201612833,
    0.0, 0.19509032201612833, 0.38268343236508984, 0.5555702330196023,
    0.7071067811865476, 0.8314696123025452, 0.9238795325112867, 0.9807852804032304,
};

static double cosine(int k) { return COSINE[k & (GYRO_PHASES - 1)]; }

static double sine(int k) { return cosine(k - GYRO_PHASES / 4); }

gyro_cycle gyro_around(const gyro_harmonics *s)
{
    gyro_cycle values;
    for (int k = 0; k < GYRO_PHASES; k++) {
        for (int axis = 0; axis < 2; axis++) {
            double sum = s->mean[axis];
            for (int h = 1; h <= GYRO_HARMONICS; h++) {
                const number part = s->part[h - 1].e[axis];
                sum += part.re * cosine(h * k) - part.im * sine(h * k);
            }
            values.at[k][axis] = sum;
        }
    }
    return values;
}

gyro_harmonics gyro_spectrum(const gyro_cycle *s)
{
    gyro_harmonics spectrum = {{0.0, 0.0}, {{{{0.0, 0.0}, {0.0, 0.0}}}}};
    for (int k = 0; k < GYRO_PHASES; k++) {
        for (int axis = 0; axis < 2; axis++) {
            const double value = s->at[k][axis] / GYRO_PHASES;
            spectrum.mean[axis] += value;
            for (int h = 1; h <= GYRO_HARMONICS; h++) {
                number *part = &spectrum.part[h - 1].e[axis];
                part->re += 2.0 * value * cosine(h * k);
                part->im -= 2.0 * value * sine(h * k);
            }
        }
    }
    return spectrum;
}

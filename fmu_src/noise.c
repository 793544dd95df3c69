/* Philox 4x32-10 (J. K. Salmon et al., SC'11), then the inverse of the normal distribution. */

#include "noise.h"

#include <stddef.h>
#include <string.h>

#include "gyro_math.h"

/* Constants of Philox 4x32, table 2 of the paper. */
static const uint32_t MULTIPLIER_0 = 0xD2511F53u, MULTIPLIER_1 = 0xCD9E8D57u;
static const uint32_t WEYL_0 = 0x9E3779B9u, WEYL_1 = 0xBB67AE85u;
enum { ROUNDS = 10 };

/* Ten rounds on `n` counters side by side, so that a compiler can do some at once; word k of counter i is word[k][i]. */
static void philox(uint32_t word[4][GYRO_MOST_LANES], int n, uint32_t key_0, uint32_t key_1)
{
    for (int round = 0; round < ROUNDS; round++) {
        for (int i = 0; i < n; i++) {
            const uint64_t product_0 = (uint64_t)MULTIPLIER_0 * word[0][i];
            const uint64_t product_1 = (uint64_t)MULTIPLIER_1 * word[2][i];
            word[0][i] = (uint32_t)(product_1 >> 32) ^ word[1][i] ^ key_0;
            word[1][i] = (uint32_t)product_1;
            word[2][i] = (uint32_t)(product_0 >> 32) ^ word[3][i] ^ key_1;
            word[3][i] = (uint32_t)product_0;
        }
        key_0 += WEYL_0;
        key_1 += WEYL_1;
    }
}

/* Uniform on (0, 1), never 0 or 1: 53 bits, half a step in. */
static double uniform(uint32_t high, uint32_t low)
{
    const uint64_t bits = ((uint64_t)high << 21) ^ (low >> 11);
    return ((double)bits + 0.5) * (1.0 / 9007199254740992.0);
}

static inline double ratio(const double numerator[8], const double denominator[8], double r)
{
    double above = numerator[7], below = denominator[7];
    for (int k = 6; k >= 0; k--) {
        above = above * r + numerator[k];
        below = below * r + denominator[k];
    }
    return above / below;
}

/* Inverse of the normal distribution, M. J. Wichura, algorithm AS 241 (PPND16), Applied Statistics 37, 1988: 1e-16 relative; of n numbers
   in place. */
static void inverse_normal(double *number, int n)
{
    static const double a[8] = {3.3871328727963666080e0, 1.3314166789178437745e2, 1.9715909503065514427e3,
                                1.3731693765509461125e4, 4.5921953931549871457e4, 6.7265770927008700853e4,
                                3.3430575583588128105e4, 2.5090809287301226727e3};
    static const double b[8] = {1.0, 4.2313330701600911252e1, 6.8718700749205790830e2, 5.3941960214247511077e3,
                                2.1213794301586595867e4, 3.9307895800092710610e4, 2.8729085735721942674e4,
                                5.2264952788528545610e3};
    static const double c[8] = {1.42343711074968357734e0, 4.63033784615654529590e0, 5.76949722146069140550e0,
                                3.64784832476320460504e0, 1.27045825245236838258e0, 2.41780725177450611770e-1,
                                2.27238449892691845833e-2, 7.74545014278341407640e-4};
    static const double d[8] = {1.0, 2.05319162663775882187e0, 1.67638483018380384940e0, 6.89767334985100004550e-1,
                                1.48103976427480074590e-1, 1.51986665636164571966e-2, 5.47593808499534494600e-4,
                                1.05075007164441684324e-9};
    static const double e[8] = {6.65790464350110377720e0, 5.46378491116411436990e0, 1.78482653991729133580e0,
                                2.96560571828504891230e-1, 2.65321895265761230930e-2, 1.24266094738807843860e-3,
                                2.71155556874348757815e-5, 2.01033439929228813265e-7};
    static const double f[8] = {1.0, 5.99832206555887937690e-1, 1.36929880922735805310e-1, 1.48753612908506148525e-2,
                                7.86869131145613259100e-4, 1.84631831751005468180e-5, 1.42151175831644588870e-7,
                                2.04426310338993978564e-15};
    /* The middle of all first, then the one in seven that is no middle: without a branch that a processor could only guess, so that it can do
       some at once. */
    double middle[2 * GYRO_MOST_LANES], far[2 * GYRO_MOST_LANES];
    int tail[2 * GYRO_MOST_LANES], tails = 0;
    for (int i = 0; i < n; i++) {
        const double q = number[i] - 0.5;
        middle[i] = q * ratio(a, b, 0.180625 - q * q);
    }
    for (int i = 0; i < n; i++) {
        tail[tails] = i;
        tails += fabs(number[i] - 0.5) > 0.425;
    }
    for (int i = 0; i < tails; i++) {
        const double p = number[tail[i]], other = 1.0 - p;
        const double r = sqrt(-gyro_log(p < other ? p : other));
        far[i] = (p < other ? -1.0 : 1.0) * (r <= 5.0 ? ratio(c, d, r - 1.6) : ratio(e, f, r - 5.0));
    }
    memcpy(number, middle, (size_t)n * sizeof *number);
    for (int i = 0; i < tails; i++) {
        number[tail[i]] = far[i];
    }
}

void gyro_normal_pairs(uint32_t seed, uint32_t stream, uint64_t counter, int lanes, double normal[][2])
{
    uint32_t word[4][GYRO_MOST_LANES];
    for (int i = 0; i < lanes; i++) {
        word[0][i] = (uint32_t)counter;
        word[1][i] = (uint32_t)(counter >> 32);
        word[2][i] = (uint32_t)i;
        word[3][i] = 0u;
    }
    philox(word, lanes, seed, stream);
    for (int i = 0; i < lanes; i++) {
        normal[i][0] = uniform(word[0][i], word[1][i]);
        normal[i][1] = uniform(word[2][i], word[3][i]);
    }
    inverse_normal(normal[0], 2 * lanes);
}

void gyro_normal_pair(uint32_t seed, uint32_t stream, uint64_t counter, uint32_t lane, double normal[2])
{
    uint32_t word[4][GYRO_MOST_LANES];
    word[0][0] = (uint32_t)counter;
    word[1][0] = (uint32_t)(counter >> 32);
    word[2][0] = lane;
    word[3][0] = 0u;
    philox(word, 1, seed, stream);
    normal[0] = uniform(word[0][0], word[1][0]);
    normal[1] = uniform(word[2][0], word[3][0]);
    inverse_normal(normal, 2);
}

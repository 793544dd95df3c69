/* tau v' = v_in - v in the time z counted in time constants, z = ∫dt/tau, in which the lag is the same throughout:

       v(Z) = e^-Z v(0) + ∫ v_in e^-(Z - z) dz

   With v_in a polynomial in z/Z through its values at the nodes, the integral is a sum of those values with weights; they add up to
   1 - e^-Z, so that a voltage that stays is kept to the last bit. */

#include "lag.h"

#include <string.h>

enum { N = GYRO_LAG_NODES };

/* 0, 1 and the zeros of P_5' on [0, 1]: 1/2 -+ sqrt((7 +- 2 sqrt 7)/21)/2. */
const double gyro_lag_nodes[N] = {0.0, 0.11747233803526765, 0.35738424175967748, 0.64261575824032252, 0.88252766196473235, 1.0};

/* The integrals from 0 to each later node of the polynomials of degree N - 1 that are 1 at one node and 0 at the others. */
static const double to_node[N - 1][N] = {
    {0.04567980513375504, 0.08186781700897067, -0.014874605789089836, 0.00762767611825096, -0.004471780440573709, 0.0016434260039545343},
    {0.02590838538787982, 0.21384080863282573, 0.13396073565086083, -0.024004074733154874, 0.011807696377659695, -0.004129309556393747},
    {0.03746264288972708, 0.17742978177126378, 0.30143326325089803, 0.14346845286688234, -0.02460333048390223, 0.007424947945453511},
    {0.0316899073293788, 0.1937092585894972, 0.26980151239949224, 0.292303794306833, 0.10736966113995282, -0.012346471800421706},
    {0.03333333333333333, 0.1892374781489235, 0.2774291885177432, 0.2774291885177432, 0.1892374781489235, 0.03333333333333333}};

/* The weights w of the nodes that are right for each power of x below N, sum w_i x_i^j = I_j, put in place of I: the Vandermonde system by
   A. Björck, V. Pereyra, Solution of Vandermonde systems of equations, Mathematics of Computation 24, 1970. */
static void weigh_nodes(const double node[N], double weight[N])
{
    for (int k = 0; k < N - 1; k++) {
        for (int i = N - 1; i > k; i--) {
            weight[i] -= node[k] * weight[i - 1];
        }
    }
    for (int k = N - 2; k >= 0; k--) {
        for (int i = k + 1; i < N; i++) {
            weight[i] /= node[i] - node[i - k - 1];
        }
        for (int i = k; i < N - 1; i++) {
            weight[i] -= weight[i + 1];
        }
    }
}

/* The integrals Z ∫ x^j e^-Z(1 - x) dx over [0, 1], which obey I_j = 1 - j/Z I_(j-1). Backward for Z <= BORDER, each step making errors
   Z/j times as large: what is left of I_40 = 0 is 5^35 5!/40! = 4e-22. */
enum { BORDER = N - 1, FAR = 40 };

static void integrals_backward(double z, double integral[N])
{
    double value = 0.0;
    for (int j = FAR; j > 0; j--) {
        value = z / j * (1.0 - value);
        if (j <= N) {
            integral[j - 1] = value;
        }
    }
}

/* 1 - e^-z, z > BORDER, from + - * / alone, so that every platform gives the same bits. */
static double gone(double z)
{
    double left = 0.0;
    if (z < 50.0) {
        int doublings = 0;
        double integral[N];
        for (; z > BORDER; doublings++) {
            z *= 0.5;
        }
        integrals_backward(z, integral);
        for (left = 1.0 - integral[0]; doublings > 0; doublings--) {
            left *= left;
        }
    }
    return 1.0 - left;
}

static void integrals(double z, double integral[N])
{
    if (z <= BORDER) {
        integrals_backward(z, integral);
    } else {
        /* Forward, each step making errors j/Z < 1 times as large. */
        integral[0] = gone(z);
        for (int j = 1; j < N; j++) {
            integral[j] = 1.0 - j / z * integral[j - 1];
        }
    }
}

/* The nodes in parts of Z, from time constants that move: 1/tau is taken as a polynomial in time. Gives Z; 0 where it is not that smooth. */
static double moving_nodes(double step, const double tau[N], double node[N])
{
    double rate[N], z[N] = {0.0};
    int rising = 1;
    for (int i = 0; i < N; i++) {
        rate[i] = step / tau[i];
    }
    for (int at = 1; at < N; at++) {
        for (int i = 0; i < N; i++) {
            z[at] += to_node[at - 1][i] * rate[i];
        }
    }
    for (int at = 1; at < N; at++) {
        rising = rising && z[at] > z[at - 1];
        node[at] = z[at] / z[N - 1];
    }
    node[0] = 0.0;
    return rising ? z[N - 1] : 0.0;
}

static void find_weights(gyro_lag_weights *lag, double step, const double tau[N])
{
    double node[N], z = 0.0;
    int moves = 0, acts = 1;
    lag->step = step;
    memcpy(lag->tau, tau, sizeof lag->tau);
    for (int i = 0; i < N; i++) {
        moves = moves || tau[i] != tau[N - 1];
        acts = acts && tau[i] > 0.0;
    }
    if (moves && acts) {
        z = moving_nodes(step, tau, node);
    }
    if (!(z > 0.0)) {
        memcpy(node, gyro_lag_nodes, sizeof node);
        z = step / tau[N - 1];
    }
    memset(lag->weight, 0, sizeof lag->weight);
    if (tau[N - 1] > 0.0) {
        integrals(z, lag->weight);
        weigh_nodes(node, lag->weight);
    }
}

static int weights_fit(const gyro_lag_weights *lag, double step, const double tau[N])
{
    return step == lag->step && memcmp(tau, lag->tau, sizeof lag->tau) == 0;
}

void gyro_weigh_lag(gyro_lag *lag, double step, const double tau[N])
{
    if (!weights_fit(&lag->kept[lag->latest], step, tau)) {
        lag->latest = 1 - lag->latest;
        if (!weights_fit(&lag->kept[lag->latest], step, tau)) {
            find_weights(&lag->kept[lag->latest], step, tau);
        }
    }
}

double gyro_lagged(const gyro_lag *lag, double before, const double entering[N])
{
    const gyro_lag_weights *weights = &lag->kept[lag->latest];
    double sum = 0.0;
    for (int i = 0; i < N; i++) {
        sum += weights->weight[i] * (entering[i] - before);
    }
    /* Without a lag it is the voltage itself, to the last bit. */
    return weights->tau[N - 1] > 0.0 ? before + sum : entering[N - 1];
}

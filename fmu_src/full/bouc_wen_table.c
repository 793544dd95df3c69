#include "bouc_wen_table.h"

#include <stddef.h>

#include "gyro_math.h"

/* Of a series in powers of s, by which the curve is followed from piece to piece: their width is a sixteenth of s, 1e-19 of it is left. */
enum { LONG = 16 };

/* What the first powers that are left out may add within a piece, in z. */
static const double LEFT_OUT = 1e-11;

/* Gauss' quadrature on half a piece, of what turns w into s. */
static const double NODE[3] = {0.1127016653792583, 0.5, 0.8872983346207417}, WEIGHT[3] = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};

/* 1 (first curve) or -1 times w^n is taken from the rate. */
static double sign_of(int curve) { return curve == 0 ? 1.0 : -1.0; }

/* w + c[1] s + ...: w' = 1 - sign p, and p = w^n by w p' = n p w'. */
static void expand_curve(double n, double sign, double w, int power, double c[LONG + 1])
{
    double p[LONG + 1];
    c[0] = w;
    p[0] = gyro_power(w, n);
    for (int k = 1; k <= power; k++) {
        double sum = 0.0;
        c[k] = ((k == 1 ? 1.0 : 0.0) - sign * p[k - 1]) / k;
        for (int j = 1; j <= k; j++) {
            sum += (n * j - (k - j)) * c[j] * p[k - j];
        }
        p[k] = sum / (k * w);
    }
}

static double sum_of_powers(const double *c, int power, double t)
{
    double sum = c[power];
    for (int k = power - 1; k >= 0; k--) {
        sum = sum * t + c[k];
    }
    return sum;
}

/* A piece that begins at `begin` with the value w; gives the value at its end. */
static double lay_piece(gyro_curve_piece *piece, double n, double sign, double begin, double width, double w)
{
    double c[LONG + 1], left = 0.0, power = 1.0;
    expand_curve(n, sign, w, LONG, c);
    const double end = sum_of_powers(c, LONG, width);
    piece->centre = begin + 0.5 * width;
    expand_curve(n, sign, sum_of_powers(c, LONG, 0.5 * width), GYRO_CURVE_POWER + 2, c);
    memcpy(piece->c, c, sizeof piece->c);
    for (int k = 1; k <= GYRO_CURVE_POWER + 2; k++) {
        power *= 0.5 * width;
        left += k > GYRO_CURVE_POWER ? gyro_fabs(c[k]) * power : 0.0;
    }
    if (!(left <= LEFT_OUT)) {
        piece->c[0] = NAN;
    }
    return end;
}

static void lay_curve(gyro_curve_piece curve[GYRO_CURVE_PIECES + 2], double n, double sign)
{
    double begin = 1.0 / (1 << -GYRO_CURVE_LOWEST), octave = begin, w = begin - sign * gyro_power(begin, n + 1.0) / (n + 1.0);
    memset(curve, 0, (GYRO_CURVE_PIECES + 2) * sizeof *curve);
    curve[0].c[1] = 1.0;
    for (int i = 0; i < GYRO_CURVE_PIECES; i++) {
        const double width = octave / (1 << GYRO_CURVE_BITS);
        w = lay_piece(&curve[i + 1], n, sign, begin, width, w);
        begin += width;
        octave = (i + 1) % (1 << GYRO_CURVE_BITS) == 0 ? 2.0 * octave : octave;
    }
    /* Beyond, the first curve is 1, and the other has gone to infinity. */
    curve[GYRO_CURVE_PIECES + 1].c[0] = sign > 0.0 ? 1.0 : NAN;
}

/* 1 - sign w^n; `d` = 1 - w, of which it is made where that is small. */
static double rate_of(double n, double sign, double w, double d)
{
    return sign > 0.0 && d < 0.5 ? -gyro_expm1(n * gyro_log1p(-d)) : 1.0 - sign * gyro_power(w, n);
}

/* s by w about the middle of a piece, from ds/dw = 1/g; toward lower w where `way` is -1, and then by 1 - w. */
static void lay_back(gyro_back_piece *piece, double n, double sign, double w, double d, double way, double s)
{
    const double g = rate_of(n, sign, w, d), p = 1.0 - g, first = -n * p / w, second = -n * (n - 1.0) * p / (w * w);
    piece->centre = way > 0.0 ? w : d;
    piece->c[0] = s;
    piece->c[1] = way / g;
    piece->c[2] = -first / (2.0 * g * g);
    piece->c[3] = way * (2.0 * first * first / g - second) / (6.0 * g * g);
}

/* The integral of 1/g over half a piece of w from `w` on, d = 1 - w going down as it goes up. */
static double half_way(double n, double sign, double w, double d, double half)
{
    double sum = 0.0;
    for (int i = 0; i < 3; i++) {
        sum += WEIGHT[i] * half / rate_of(n, sign, w + NODE[i] * half, d - NODE[i] * half);
    }
    return sum;
}

/* The places on a curve by w below the last octave; gives s at w = 1/2. */
static double lay_way_back(gyro_back_piece back[GYRO_BACK_PIECES + 1], double n, double sign)
{
    double w = 1.0 / (1 << -GYRO_CURVE_LOWEST), octave = w, s = w + sign * gyro_power(w, n + 1.0) / (n + 1.0), at_half = s;
    memset(back, 0, (GYRO_BACK_PIECES + 1) * sizeof *back);
    back[0].c[1] = 1.0;
    for (int i = 0; i < GYRO_BACK_PIECES; i++) {
        const double half = 0.5 * octave / (1 << GYRO_BACK_BITS), middle = s + half_way(n, sign, w, 1.0 - w, half);
        at_half = w == 0.5 ? s : at_half;
        lay_back(&back[i + 1], n, sign, w + half, 1.0 - (w + half), 1.0, middle);
        s = middle + half_way(n, sign, w + half, 1.0 - (w + half), half);
        w += 2.0 * half;
        octave = (i + 1) % (1 << GYRO_BACK_BITS) == 0 ? 2.0 * octave : octave;
    }
    return at_half;
}

/* Those of the first curve beyond w = 1/2, by 1 - w. */
static void lay_beside(gyro_back_piece beside[GYRO_NEAR_PIECES + 1], double n, double s)
{
    double d = 0.5, octave = 0.25;
    memset(beside, 0, (GYRO_NEAR_PIECES + 1) * sizeof *beside);
    for (int i = GYRO_NEAR_PIECES; i > 0; i--) {
        const double half = 0.5 * octave / (1 << GYRO_BACK_BITS), middle = s + half_way(n, 1.0, 1.0 - d, d, half);
        lay_back(&beside[i], n, 1.0, 1.0 - (d - half), d - half, -1.0, middle);
        s = middle + half_way(n, 1.0, 1.0 - (d - half), d - half, half);
        d -= 2.0 * half;
        octave = (i - 1) % (1 << GYRO_BACK_BITS) == 0 ? 0.5 * octave : octave;
    }
    /* Nearer to 1 the curve is as good as there. */
    beside[0].c[0] = 2.0 * s;
}

void gyro_tabulate_bouc_wen(gyro_bouc_wen_table *table, double n)
{
    table->n = n;
    for (int curve = 0; curve < 2; curve++) {
        lay_curve(table->curve[curve], n, sign_of(curve));
        const double at_half = lay_way_back(table->back[curve], n, sign_of(curve));
        if (curve == 0) {
            lay_beside(table->beside, n, at_half);
        }
    }
}

/* A Kalman filter for a device with many constants: a fast filter for what moves, and the constants beside it in blocks.

   What moves, z = [states, rate, lagging voltages, slope of the rate], has a Kalman filter of its own, run as if the constants p were right. Y = dz/dp is how its
   estimate answers to an error of them (B. Friedland, IEEE Trans. Automatic Control 14, 1969, treatment of bias; eqs. in correction.c and docs/theory/loop.md). Every
   innovation is then a measurement of that error, e = h dp + noise, and those of a block of samples are folded into p at once, by Cholesky factors
   that rounding can't make negative. Where a block moves p by more than its uncertainty, it is filtered again from its beginning at the new p
   (Gauss-Newton, an iterated extended Kalman filter). The first block grows from a few samples to the whole start, filtered again from the first
   sample each time it has doubled: wide priors are then narrowed at the constants found last, not at those guessed first. */

#ifndef FILTER_H
#define FILTER_H

#include "motion.h"
#include "settings.h"
#include "wide.h"

#define LAGGED (HAS_LAG ? 2 : 0)
#define OMEGA NS
#define LAG (NS + 1)
#define SLOPE (NS + 1 + LAGGED) /* of the rate; no sample shows it at once */
#define NZ (SLOPE + 1)
#define ZW ((NZ + WIDE - 1) / WIDE * WIDE) /* length of a row by z */
#define ZB (ZW / WIDE)
#define BLOCK_MAX 200
#define START_MAX 16384 /* samples of the start at most */
#define QUEUE 65536     /* commands kept; a power of two, above START_MAX and 1 ms of delay at 1e7 samples a second */

#define RECENT 4096     /* samples of which what was measured is kept, and how the motion was, every so many; powers of two */
#define EVERY 16
#define TIMES 512 /* samples back from where a step of the rate has shown that it may have had */

/* A sample and the inputs with it. */
typedef struct {
    double v[2], in[IN];
} heard;

/* The motion after a sample, with all that was uncertain of it. */
typedef struct {
    double z[NZ], P[NZ][ZW];
} before_now;

/* The motion where the rate has not stepped yet, and twice the negative logarithm of the likelihood so far. */
typedef struct {
    before_now motion;
    double unlikely;
} still;

/* What moves, with its uncertainty: all that a block starts from. */
typedef struct {
    double z[NZ];      /* [SI] */
    double P[NZ][ZW];  /* covariance of z for given p */
    double Y[NZ][NW];  /* dz/dp */
    double stray[NZ];  /* covariance of the error of z with what the pattern has strayed by (stray.c) [rad times SI] */
    double sum[2], sum_variance[2]; /* of the corrections of the rate and of its slope lately, fading */
} moving;

typedef struct {
    known k;
    motion m;
    filter_settings settings;
    double prior[NP]; /* standard deviation of p at the start */
    double lowest[NP], first_lowest[NP]; /* of p, and by the design */
    moving now, begun; /* at present, and where the block began */
    double W[NP][NP];     /* covariance of p where the block began = W W', upper triangular */
    double W_now[NP][NP]; /* at the last fit of the block */
    double eta[NP];       /* p = p_begun + W eta at that fit */
    double p_begun[NP];
    double followed[NP]; /* p where what the voltages see was last made to move straight (straight.h) */
    double reopened[NP]; /* deviation of p that the block must not take away: along it a lag ends (no_lag.h) */
    double H[2 * START_MAX][NW]; /* measurement rows of the block over the root of their variance */
    double r[2 * START_MAX];     /* innovations over it */
    double v[START_MAX][2], in[START_MAX][IN];
    unsigned char opened[START_MAX]; /* whether the rate was opened after a sample of the block */
    double u[QUEUE][2]; /* commands, by sample */
    double top;  /* largest voltage of either sign and axis so far [V] */
    int clipped; /* whether it has been met again, to the bit: the end of the converter */
    heard heard[RECENT];
    before_now past[RECENT / EVERY];
    still stills[TIMES]; /* of the last search for a step */
    int64_t sample;     /* of the last correction; -1 before the first */
    int64_t block_begun, in_block, length; /* in_block: its samples so far; length: at which it ends */
    int64_t rows, kept;                    /* rows that count, and after them those left for the next block */
    int growing;                           /* whether the block is filtered again as it doubles */
    int64_t since; /* sample at which the constants were last opened */
    double walk, slope_walk; /* of the rate [rad/s per s^0.5] and of its slope [rad/s2 per s^0.5] */
    double surprises, restarts, wait, share;
    double roaming, roamed_from, roamed_variance; /* of the slope of the rate: mean square of its change per time [rad2/s5]; at the stretch's beginning */
    int64_t roamed_at;                            /* sample at which that was */
    double strayed; /* variance of what the pattern has turned by that is no turn of the device, by noise and by steps of the rate [rad^2] */
    int64_t jumped_at; /* sample at which the rate was last taken to have jumped; -1 before the first */
    double forget[NP], moving[NP]; /* rate at which each constant, the others given, is forgotten [1/s]; running excess of its squared motion */
    double unseen[NP][NP];     /* changes of p that no sample of the start shows, row by row; those come first of which none shows something now */
    double unseen_eta[NP][NP]; /* what they span, in units of W, orthonormal */
    int shown[NP]; /* blocks in a row that showed something of them */
    int unseen_count, hidden;
    int hardly_told; /* whether the start told some direction of the reading but a little */
    double left; /* mean squared innovation that the last whole start has left; infinite where it has ended beside its fit or is not whole yet */
    int tries; /* starts taken because one had ended beside its fit */
    int lost;               /* whether a whole start has found no device */
    double effort; /* samples that may still be filtered again */
    double fit; /* mean squared innovation at the last fit of a growing block */
    int fresh; /* whether this sample brought new constants */
    double chi2, white[2], last_r[2]; /* running means: squared innovation over its variance; product of neighbours beyond that of pink noise */
    double inverse[2];      /* running mean of 1/S of either axis [1/V2] */
    double pink[2];         /* what pink noise makes of the product of neighbours, in the mean */
    double restarted_at;    /* time of the last restart from the design [s], below zero: none */
    double first_W[NP][NP], first_p[NP]; /* of the design */
    moving first;
    int64_t origin; /* sample at which the motion was taken up */
} filter;

/* z [NZ] and its standard deviations, p and its lowest values [NP], W row by row. */
void filter_start(filter *f, const filter_settings *settings, const double *c, const double *z, const double *dz, const double *p,
                  const double *W, const double *lowest, double period);

/* Predicts with the command u [N] held since the last sample and corrects with the sample v [V], the inputs `in` being measured. */
void filter_step(filter *f, const double u[2], const double v[2], const double in[IN]);

/* The same where the truth is told: z_true [NS + 1] at this sample; the covariance is then the bound on what can be known. */
void filter_step_told(filter *f, const double u[2], const double *z_true, const double in[IN]);

#endif

/* The controller of TW 201137310 (eqs. 5-7): an isotropic lossless oscillator and tones, on the model that the loop knows.

   force u = K q + D q' - k q + w(t) from the current estimates, w sines along either axis. The free part of the motion then turns like a
   Foucault pendulum. Beyond the patent: the force is computed for the instant at which it will act, from the state predicted with the forces
   under way; the hold is undone (hold.h); what the model knows beyond springs and dampers is cancelled; actuators are inverted; the Coriolis
   force on the forced motion is cancelled, without which every change of the rate would kick the pattern; and optional loops hold the energy
   of the pattern and keep its orbit straight. */

#ifndef FOUCAULT_H
#define FOUCAULT_H

#include "hold.h"
#include "settings.h"

#define TONES 4
#define PAST 16384 /* commands kept; a power of two */

/* Order of an estimate: states and rate, the seven constants of the plant [SI], effects' parameters, effects' states. */
#define ESTIMATE_KXX 5
#define ESTIMATE_M 11
#define ESTIMATE_SIZE (12 + NP - 7 + NS - 4)

/* Of an oscillation, over a time that stays as it is while the gains do. */
typedef struct {
    double sine, cosine;
} phase;

typedef struct {
    foucault_settings settings;
    known k;
    held_loop loop;
    double stiffness;          /* of the isotropic oscillator [N/m] */
    double by_omega[8];        /* change of the gain with the rate */
    double by_own_rate[8];     /* and with that at which the controller turns the pattern */
    double coupling;           /* Coriolis coupling relative to that of a point mass [1] */
    piece rest, step, half;    /* the motion at rest over the delay's part of a period, a period, half of one */
    double a[NS * NS];         /* rate by state at rest, without a rate of turn */
    int64_t delay_samples;
    double delay;              /* [s] */
    double boost;
    double phasor[TONES][8];   /* responses to the tones where a command begins to act */
    double straight[16];       /* 4 x 4: the pattern as an oscillator would have it at a sample, by how it is there (hold.h) */
    double phasor_now[TONES][8]; /* and at the sample before the next one does, in the same phase */
    double frequency[TONES];   /* of the tones [Hz] */
    phase tone[TONES], tone_step[TONES]; /* where they stand at a sample, and over a period */
    int64_t tones_at;          /* sample at which they stand there */
    double omega;              /* of the isotropic oscillator [rad/s] */
    phase turn;                /* of it over a period */
    phase late[TONES];         /* back over the age of the command that acts when a sample is taken */
    phase ahead[TONES];        /* from a sample to mid-hold */
    double near_share;         /* of the second pair's amplitude */
    double in_use[7];          /* the seven constants in the gains */
    double formed_with[NP], formed_in[IN]; /* all constants and inputs in them */
    double compared[NP];       /* constants that they were last compared with */
    double behind;             /* as in foucault_output */
    int64_t formed_at;         /* sample at which they were formed */
    int64_t followed_at;       /* sample at which constants that had changed were taken last */
    double u[PAST][2];         /* commands, by sample */
    int64_t count;
    double period;
    double energy, momentum, smoothed; /* of the pattern, per mass [m2/s2], [m2/s]; whether they have begun */
    double turned;             /* angle by which the pattern has been turned electronically [rad] */
    int64_t reversal_every, reversal_takes; /* samples from one reversal of the modes to the next, and of the turn */
    int formed;
} foucault;

/* What a step gives. */
typedef struct {
    double u[2];          /* command [N] */
    double forced[4];     /* response to the tones at t_k, and what held forces make of the pattern there: x, x', y, y' [m, m/s] */
    double near[4];       /* the part of it that is due to the second pair, near the loop's own frequency */
    double omega_squared; /* k/m of the isotropic oscillator [1/s2] */
    double turned;        /* angle by which the pattern has been turned electronically [rad] */
    double lacking;       /* force that its limit has taken away [N] */
    double own_rate;      /* at which the pattern is turned electronically [rad/s] */
    double behind;        /* at which it is turned, at its worst angle, by gains that are older than the constants [rad/s] */
} foucault_output;

void foucault_start(foucault *c, const foucault_settings *settings, const double *known_values, double period);

/* At t_k, after the observer's correction with sample k: the command for [t_k, t_k+1). `estimate`, `deviation` [ESTIMATE_SIZE]. */
void foucault_step(foucault *c, const double *estimate, const double *deviation, const double in[IN], foucault_output *out);

#endif

/* 64 threads, each with an instance of its own, for ThreadSanitizer; or many lives one after another, for LeakSanitizer:
   `lives threads`, `lives COUNT`. */

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <fmi3Functions.h>

#include "generated/model.h"

enum { THREADS = 64, STEPS = 400 };

static const unsigned outputs[] = {GYRO_N_INPUTS, GYRO_N_INPUTS + 1};

/* What a life has of this, where the FMU knows it: noise, something allocated, a force that bends the motion, memories. */
static const struct {
    const char *name;
    double value; /* SI */
} busy[] = {{"sense_noise", 1e-3},       {"actuator_delay", 7e-6}, {"k3_x", 1e9},          {"structure_lag", 1e-3},
            {"angle_random_walk", 1e-4}, {"bias_instability", 1e-5}, {"rate_random_walk", 1e-5}, {"turn_on", 1e-3}};

static void make_busy(fmi3Instance c)
{
    for (size_t i = 0; i < sizeof busy / sizeof *busy; i++) {
        for (unsigned vr = 0; vr < GYRO_N_VARIABLES; vr++) {
            if (strcmp(gyro_variables[vr].name, busy[i].name) == 0 && fmi3SetFloat64(c, &vr, 1, &busy[i].value, 1) != fmi3OK) {
                abort();
            }
        }
    }
}

/* A life with noise, saved states and refused calls; the last outputs go to `last`. */
static void live(unsigned which, unsigned steps, double last[2])
{
    bool event, terminate, early;
    double reached, x;
    const double step = gyro_variables[GYRO_INTERNAL_STEP].start;
    const unsigned seed_at = GYRO_SEED, force_at = 0;
    const int seed = 7;
    fmi3FMUState state = NULL, carried = NULL;
    fmi3Instance c = fmi3InstantiateCoSimulation("life", gyro_token, NULL, false, false, false, false, NULL, 0, NULL, NULL, NULL);
    fmi3SetInt32(c, &seed_at, 1, &seed, 1);
    make_busy(c);
    fmi3EnterInitializationMode(c, false, 0.0, 0.0, false, 0.0);
    fmi3ExitInitializationMode(c);
    for (unsigned k = 0; k < steps; k++) {
        x = 1e-8 * (double)(k % 7);
        fmi3SetFloat64(c, &force_at, 1, &x, 1);
        if (fmi3DoStep(c, (double)k * step, step, true, &event, &terminate, &early, &reached) != fmi3OK) {
            abort();
        }
        if ((k + which) % 50 == 3) {
            size_t size = 0;
            fmi3GetFMUState(c, &state);
            fmi3SerializedFMUStateSize(c, state, &size);
            unsigned char *bytes = malloc(size);
            fmi3SerializeFMUState(c, state, bytes, size);
            fmi3DeserializeFMUState(c, bytes, size, &carried);
            fmi3SetFMUState(c, carried);
            bytes[size / 2] ^= 1;
            fmi3FreeFMUState(c, &carried);
            if (fmi3DeserializeFMUState(c, bytes, size, &carried) == fmi3OK) {
                abort();
            }
            free(bytes);
        }
    }
    fmi3GetFloat64(c, outputs, 2, last, 2);
    fmi3FreeFMUState(c, &state);
    fmi3FreeInstance(c);
}

typedef struct {
    pthread_t thread;
    unsigned which;
    double last[2];
} one_life;

static void *in_a_thread(void *argument)
{
    one_life *l = argument;
    live(l->which, STEPS, l->last);
    return NULL;
}

int main(int argc, char **argv)
{
    static one_life lives[THREADS];
    double last[2];
    int equal = 1;
    if (argc == 2 && strcmp(argv[1], "threads") == 0) {
        for (unsigned i = 0; i < THREADS; i++) {
            lives[i].which = i;
            if (pthread_create(&lives[i].thread, NULL, in_a_thread, &lives[i]) != 0) {
                return 1;
            }
        }
        for (unsigned i = 0; i < THREADS; i++) {
            pthread_join(lives[i].thread, NULL);
            equal = equal && memcmp(lives[i].last, lives[0].last, sizeof last) == 0;
        }
        printf("%d threads, %d steps each, outputs %s\n", THREADS, STEPS, equal ? "equal" : "DIFFER");
    } else {
        const unsigned count = argc == 2 ? (unsigned)strtoul(argv[1], NULL, 10) : 0;
        for (unsigned i = 0; i < count; i++) {
            live(i, 5, last);
        }
        printf("%u lives\n", count);
    }
    return equal ? 0 : 1;
}

/* What the parts of a step cost that no method of integration spares: once the rates of all states, once all laws, and the random numbers of a
   sample. Compiled with the C of the FMU. */

#include "whole.c"

#include <time.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

static double since(clock_t began, int64_t count) { return 1e9 * (double)(clock() - began) / CLOCKS_PER_SEC / (double)count; }

/* Times [ns] of rates, laws and random numbers, each the mean of `count`, of an instance with these parameters [SI] after some steps; gives 0
   where it does not start. */
EXPORT int parts_time(const char *token, const uint32_t *references, const double *values, size_t size, int64_t count, double spent[3])
{
    fmi3Instance instance = fmi3InstantiateCoSimulation("parts", token, NULL, 0, 0, 0, 0, NULL, 0, NULL, NULL, NULL);
    int good = instance != NULL && fmi3SetFloat64(instance, references, size, values, size) <= fmi3Warning &&
               fmi3EnterInitializationMode(instance, 0, 0.0, 0.0, 0, 0.0) <= fmi3Warning && fmi3ExitInitializationMode(instance) <= fmi3Warning;
    for (int k = 0; good && k < 200; k++) {
        bool event, terminate, early;
        double reached;
        good = fmi3DoStep(instance, 5e-6 * k, 5e-6, 0, &event, &terminate, &early, &reached) <= fmi3Warning;
    }
    if (good) {
        gyro_instance *g = ((fmi_instance *)instance)->core;
        double rate[GYRO_N_STATES];
        volatile double kept;
        clock_t began = clock();
        for (int64_t i = 0; i < count; i++) {
            g->view.s[GYRO_STATE_X_DOT] += 1e-15;
            state_rate(&g->view, rate);
            kept = rate[GYRO_STATE_X_DOT];
        }
        spent[0] = since(began, count);
        began = clock();
        for (int64_t i = 0; i < count; i++) {
            g->view.t += 1e-15;
            apply_laws(&g->view, g->value);
        }
        spent[1] = since(began, count);
        began = clock();
        for (int64_t i = 0; i < count; i++) {
            g->memory.clock.sample++;
            draw_noise(g);
        }
        spent[2] = since(began, count);
        (void)kept;
    }
    if (instance != NULL) {
        fmi3FreeInstance(instance);
    }
    return good;
}
